"""Pairs of half vectors: the constants of their density which have the least mean relative variance.

python tests/calibration/half_vectors.py [--check] [NAME ...]
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet import sampling, shadowing
from mi_brdfs.microfacet.distributions import ABC, EPD, GGX, GTR, Beckmann, Blinn
from mi_brdfs.microfacet.fresnel import Dielectric, Schlick, Unit

ANGLES = 5, 30, 60, 80
GRAZING = 60, 75, 85
STEEPEST = 80, 85, 88
ALPHAS = 0.1, 0.25, 0.5, 1


def of_alpha(kind):
    return [kind(alpha, alpha) for alpha in map(number, ALPHAS)]


def blinn():
    return [Blinn(number(exponent)) for exponent in (1, 10, 100)]


def lobes(facets, terms, reflectances):
    """Of all distributions with all shadowing terms, which are given or made of the distribution."""
    return [
        MicrofacetLobe(1, it, g(it) if isinstance(g, type(smith)) else g, f)
        for it, g, f in product(facets, terms, reflectances)
    ]


def smith(distribution):
    return distribution.smith(correlated=True)


def fits() -> Iterator[Fit]:
    unit, rising = [Unit()], [Schlick(number(0.04)), Dielectric(number(1.5))]
    upright = [shadowing.VCavity(), shadowing.AshikhminShirleyShadowing()]
    everything = [*of_alpha(Beckmann), *of_alpha(GGX), *blinn()]

    yield attributes(sampling, "SHADOWED", variance_loss(lobes(everything, upright, unit), ANGLES))
    yield attributes(sampling, "RISING", variance_loss(lobes(everything, upright, rising), ANGLES))

    short_tailed = [*of_alpha(Beckmann), *blinn()]
    leaning = [smith, shadowing.Implicit(), shadowing.Neumann(), shadowing.AshikhminPremoze()]
    yield attributes(sampling, "OUTWARD", variance_loss(lobes(short_tailed, leaning, unit), GRAZING))
    yield attributes(sampling, "LEANING", variance_loss(lobes(everything, leaning, rising), GRAZING))

    long_tailed = [GTR(number(0.1), number(1.0)), ABC(number(100), number(1.0)), EPD(number(0.05), number(0.3))]
    steep = lobes([*everything, *long_tailed], leaning[2:], [*unit, *rising])
    yield attributes(shadowing.Shadowing, "UNIFORM", variance_loss(steep, STEEPEST))


if __name__ == "__main__":
    main(__doc__, fits)
