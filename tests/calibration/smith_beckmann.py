"""Smith's term for Beckmann's distribution: the polynomial in a whose -8th power is √π i(a), with the least error.

    python tests/calibration/smith_beckmann.py [--check]

Up to twice the least error will do: it is below that of rounding to float32, 6e-8.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Fit, main
from scipy.optimize import least_squares
from scipy.special import erfc

from mi_brdfs.microfacet.shadowing import SmithBeckmann

LIMIT = 10
"""Of a; beyond 5, i(a) is no float32 beside the cosine."""


def exact(a: np.ndarray) -> np.ndarray:
    return np.exp(-a * a) / np.sqrt(np.pi) - a * erfc(a)


def error(coefficients: np.ndarray, a: np.ndarray) -> np.ndarray:
    return np.polynomial.polynomial.polyval(a, coefficients) ** -8.0 / np.sqrt(np.pi) - exact(a)


def largest_error(*coefficients: float) -> float:
    return float(abs(error(np.array(coefficients), np.linspace(0, LIMIT, 20001))).max())


def search() -> np.ndarray:
    """Lawson's method: least squares, with weights that rise where the error is largest until all its peaks are as
    high."""
    a = 2.5 + 2.5 * np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    weight, coefficients = np.ones_like(a), np.array(SmithBeckmann.FIT[1:])
    for _ in range(40):
        root = 1e8 * np.sqrt(weight)

        def residuals(free, root=root):
            return root * error(np.array([1, *free]), a)

        coefficients = least_squares(residuals, coefficients, method="lm", x_scale=abs(coefficients)).x
        now = abs(error(np.array([1, *coefficients]), a))
        weight *= now / now.max() + 1e-3
        weight /= weight.mean()
    return np.array([1, *coefficients])


def fits() -> Iterator[Fit]:
    yield Fit("SmithBeckmann.FIT", SmithBeckmann.FIT, largest_error, tolerance=1, search=search)


if __name__ == "__main__":
    main(__doc__, fits)
