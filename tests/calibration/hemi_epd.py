"""The hemispherical exponential power distribution: its estimated mean square slope, which has the least mean square
log ratio to that of the mean of log(cosθ), and the variable of its quadrature, which has the least largest error.

    python tests/calibration/hemi_epd.py [--check] [NAME ...]

The slope is an estimate, and a quadrature twice as bad would still do.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise

import numpy as np
from harness import Fit, attributes, main, number
from scipy.integrate import quad

from mi_brdfs.microfacet.tails import HemiEPD

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


def quadrature_loss():
    def of(kappa, gamma):
        integral = np.array(HemiEPD(number(kappa), number(gamma)).integral)[0]
        return abs(integral / exact(kappa, gamma)[0] - 1)

    return max(of(*it) for sign in (1, -1) for it in settings(sign))


def fits() -> Iterator[Fit]:
    yield attributes(HemiEPD, "NARROWER", slope_loss(1), tolerance=0.1)
    yield attributes(HemiEPD, "BROADER", slope_loss(-1), tolerance=0.1)
    yield attributes(HemiEPD, "SPREAD", quadrature_loss, tolerance=1)


if __name__ == "__main__":
    main(__doc__, fits)
