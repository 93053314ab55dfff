"""Burley's model: the base lobe's uniform directions and the radial density of its sheen, which have the least mean
relative variance, and the estimates of their albedos, which have the least mean square log ratio to the measured ones.

    python tests/calibration/burley.py [--check] [NAME ...]

The exponents of the sheen's density are halves, as that needs no powers; nearby ones would do as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from harness import Fit, attributes, directions, estimate_loss, main, number, variance_loss

from mi_brdfs.models.burley import BaseLobe, SheenLobe
from mi_brdfs.probe.arrays import vectors

import mitsuba as mi  # isort: skip

ANGLES = 5, 30, 60, 80
EXPONENTS = 4.5, 3
"""A and B of the sheen's density ∝ t^(A-1) (1 - t^A)^(B-1)."""


def base(*subsurface: float) -> list[BaseLobe]:
    roughnesses = 0.1, 0.3, 0.5, 0.7, 1
    return [BaseLobe(1, number(roughness), number(share)) for roughness in roughnesses for share in subsurface]


def shares() -> np.ndarray:
    """The t that the sheen's sampler draws for variates 0.05, 0.15, … 0.95, from the normal."""
    v = (np.arange(10) + 0.5) / 10
    wi = vectors(np.repeat(directions([0]), len(v), axis=0))
    wo = SheenLobe(1).sample(wi, mi.Float(0.5), mi.Point2f(mi.Float(v), 0.3))
    m = 1 - np.sqrt(0.5 * (1 + np.array(wo.z, np.float64)))
    return m / (1 - np.sqrt(0.5))


def radial_variance(a: float, b: float) -> float:
    """The relative variance that the density of m leaves, if that of the azimuth leaves none."""
    variances = []
    for theta in np.radians([5, 30, 60, 80, 88]):
        largest = 1 - np.sqrt(0.5 * (1 - np.sin(theta)))
        t = (np.arange(2000) + 0.5) / 2000
        cos_d = 1 - largest * t
        # Of the directions at an angle of 2θ_d to wi, f times the integral of cosθ_o over those above the horizon.
        cos = 2 * cos_d**2 - 1
        axial, lateral = np.cos(theta) * cos, np.sin(theta) * np.sqrt(1 - cos**2)
        end = np.arccos(np.clip(-axial / np.maximum(lateral, 1e-12), -1, 1))
        target = (1 - cos_d) ** 5 * cos_d * (axial * end + lateral * np.sin(end))
        density = t ** (a - 1) * (1 - t**a) ** (b - 1)
        target, density = target / target.mean(), density / density.mean()
        variances.append((target**2 / density).mean() - 1)
    return float(np.mean(variances))


def fits() -> Iterator[Fit]:
    a, b = EXPONENTS
    v = (np.arange(10) + 0.5) / 10
    if not np.allclose(shares() ** a, 1 - (1 - v) ** (1 / b), atol=1e-4):
        raise SystemExit(f"SheenLobe does not sample the density of the exponents {a} and {b}.")
    yield Fit("SheenLobe's exponents", EXPONENTS, radial_variance, tolerance=0.1)
    yield attributes(SheenLobe, "ALBEDO", estimate_loss([SheenLobe(1)], (5, 30, 45, 60, 70, 80, 85, 88)), tolerance=0.1)
    yield attributes(BaseLobe, "UNIFORM", variance_loss(base(0, 0.3, 1), ANGLES))
    yield attributes(BaseLobe, "SUBSURFACE", estimate_loss(base(1), ANGLES), tolerance=0.1)


if __name__ == "__main__":
    main(__doc__, fits)
