"""The hemispherical exponential power distribution: its estimated mean square slope, which has the least mean square
log ratio to that of the mean of log(cosθ), and its quadrature, which has the least largest error, and none for κ = 0.

    python tests/calibration/hemi_epd.py [--check] [NAME ...]

The slope is an estimate, and a quadrature twice as bad would still do.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import numpy as np
from harness import Fit, attributes, main, number, replaced
from scipy.integrate import quad

from mi_brdfs.microfacet.distributions import HemiEPD

KAPPAS = 0.5, 1, 2, 5, 10, 20, 40, 80
GAMMAS = 1, 10, 100, 1e4


@cache
def exact(kappa: float, gamma: float) -> tuple[float, float]:
    """``(J, the mean of log(cosθ))``, J over exp(46) for a large κ as in the code."""
    power, shift = gamma / (gamma + 2), 46 if kappa > 40 else 0

    def bent(s):
        x = kappa * s**power
        return (np.exp(x - shift) - np.exp(-shift)) / x

    def integral(f):
        # In s = t³, and with a border where the end at 1 begins.
        ends = 0, (1 - min(1, 20 / abs(kappa)) / 2) ** (1 / 3), 1
        return sum(quad(lambda t: 3 * t * t * f(t**3), *it, epsrel=1e-11, limit=200)[0] for it in pairwise(ends))

    total = integral(bent)
    return total, integral(lambda s: np.log(s) * bent(s)) / (gamma + 2) / total


def settings(sign: int) -> list[tuple[float, float]]:
    return [(sign * kappa, gamma) for kappa in KAPPAS for gamma in GAMMAS]


def slope_loss(sign: int):
    distributions = [HemiEPD(number(kappa), number(gamma)) for kappa, gamma in settings(sign)]
    of_blinn = [-2 * exact(*it)[1] for it in settings(sign)]

    def loss():
        estimated = [np.array(it.mean_square_slope())[0] for it in distributions]
        return float(np.mean(np.log(np.array(estimated) / of_blinn) ** 2))

    return loss


def largest_error(step: float, closer: float, *weights: float) -> float:
    constants = {"STEP": number(step), "CLOSER": number(closer), "WEIGHTS": [number(weight) for weight in weights]}
    with replaced(HemiEPD, constants):
        found = [
            np.array(HemiEPD(number(kappa), number(gamma)).integral)[0] / exact(kappa, gamma)[0]
            for kappa, gamma in settings(1) + settings(-1)
        ]
    return float(abs(np.array(found) - 1).max())


def search() -> list[float]:
    """Lawson's method for the weights: least squares, with factors that rise where the error is largest."""
    kappas = np.concatenate([-np.geomspace(0.1, 80, 30), np.geomspace(0.1, 80, 30)])
    powers = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 20))
    kappa, power = (grid.ravel() for grid in np.meshgrid(kappas, powers, indexing="ij"))
    n, largest = np.cumsum(np.arange(len(HemiEPD.WEIGHTS))), np.maximum(kappa, 0)[:, None]

    def terms(y, weights):
        """What J over exp(κ⁺) is the sum of, where s = exp(-y)."""
        x = kappa[:, None] * np.exp(-power[:, None] * y)
        return weights * np.exp(-y) * (np.exp(x - largest) - np.exp(-largest)) / x

    x, weight = np.polynomial.legendre.leggauss(60)
    ends = np.concatenate([[0], np.geomspace(1e-3, 45, 16)])
    widths, middles = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
    fine = terms(np.ravel(middles[:, None] + widths[:, None] * x), np.ravel(widths[:, None] * weight))
    integral = fine.sum(axis=1, keepdims=True)

    def fit(step, closer):
        scale = 1 / (1 + closer * power[:, None] * largest)
        matrix = terms(step * n * scale, scale) / integral
        factor, best, least = np.ones(len(matrix)), None, np.inf
        for _ in range(100):
            root = np.append(np.sqrt(factor), 1e3)  # the last row is κ = 0
            rows = np.concatenate([matrix, np.exp(-step * n)[None]])
            found = np.linalg.lstsq(rows * root[:, None], root, rcond=1e-15)[0]
            error = abs(matrix @ found - 1)
            if error.max() < least:
                best, least = found, error.max()
            factor *= error / error.max() + 0.05
            factor /= factor.mean()
        return least, [step, closer, *best]

    return min(fit(step, closer) for step in (0.16, 0.17, 0.18, 0.19) for closer in (0.18, 0.2, 0.22))[1]


def fits() -> Iterator[Fit]:
    yield attributes(HemiEPD, "NARROWER", slope_loss(1), tolerance=0.1)
    yield attributes(HemiEPD, "BROADER", slope_loss(-1), tolerance=0.1)
    code = HemiEPD.STEP, HemiEPD.CLOSER, *HemiEPD.WEIGHTS
    yield Fit("HemiEPD.STEP, CLOSER, WEIGHTS", code, largest_error, tolerance=1, search=search)


if __name__ == "__main__":
    main(__doc__, fits)
