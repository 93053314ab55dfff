"""The toon band's quantile: a start of Newton's method for x³ (1 - x/2) = y on [0, 1], with the least relative error.

    python tests/calibration/toon.py [--check]

The error is squared, and squared again: half as much again leaves it below that of rounding to float32.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Fit, main

from mi_brdfs.models.toon import Step


def largest_error(linear: float, quadratic: float) -> float:
    x = np.linspace(1e-3, 1, 1000)
    root = np.cbrt(x**3 * (1 - 0.5 * x))
    return float(abs(root * (1 + root * (linear + quadratic * root)) / x - 1).max())


def fits() -> Iterator[Fit]:
    yield Fit("Step.START", Step.START, largest_error, tolerance=0.5)


if __name__ == "__main__":
    main(__doc__, fits)
