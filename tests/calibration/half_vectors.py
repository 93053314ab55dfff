"""Pairs of half vectors: the constants of their density, and how far those lean that count at grazing, for each
shadowing term, which have the least mean relative variance.

    python tests/calibration/half_vectors.py [--check] [NAME ...]
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet import shadowing
from mi_brdfs.microfacet.distributions import GGX, Beckmann, Blinn
from mi_brdfs.microfacet.fresnel import Dielectric, Schlick, Unit
from mi_brdfs.microfacet.grazing import (
    AntitheticImplicitNormals,
    AntitheticNormalsTowardViewer,
    AntitheticSteepNormals,
)
from mi_brdfs.microfacet.sampling import AntitheticNormals, Stretch
from mi_brdfs.microfacet.tails import ABC, EPD, GTR
from mi_brdfs.models.blinnphong import ResponseShadowing
from mi_brdfs.models.brady import Exponential, Projected
from mi_brdfs.models.schlick import Unshadowed

ANGLES = 5, 30, 60, 80
GRAZING = 60, 75, 85
STEEPEST = 80, 85, 88
ALPHAS = 0.1, 0.25, 0.5, 1
ANISOTROPIC = (0.1, 0.5), (0.1, 1), (0.3, 1), (0.05, 2), (0.3, 2), (1, 2)


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


def schlick(distribution):
    return shadowing.SchlickSmith(0.8 * distribution.roughness())


def fits() -> Iterator[Fit]:
    unit, rising = [Unit()], [Schlick(number(0.04)), Dielectric(number(1.5))]
    upright = [shadowing.VCavity(), shadowing.AshikhminShirleyShadowing()]
    everything = [*of_alpha(Beckmann), *of_alpha(GGX), *blinn()]

    yield attributes(AntitheticNormals, "SHADOWED BROAD", variance_loss(lobes(everything, upright, unit), ANGLES))
    yield attributes(AntitheticNormals, "RISING", variance_loss(lobes(everything, upright, rising), ANGLES))

    stretched = [kind(*map(number, it)) for kind in (Beckmann, GGX) for it in ANISOTROPIC]
    terms = [*upright, smith, shadowing.KurtShadowing(number(0.25))]
    yield attributes(
        Stretch, "LOWEST", variance_loss(lobes(stretched, terms, [*unit, *rising]), [*ANGLES, 85], (0, 40, 90))
    )

    short_tailed = [*of_alpha(Beckmann), *blinn()]
    leaning = [smith, shadowing.Implicit(), shadowing.Neumann(), shadowing.AshikhminPremoze()]
    yield attributes(
        AntitheticNormalsTowardViewer, "OUTWARD", variance_loss(lobes(short_tailed, leaning, unit), GRAZING)
    )
    yield attributes(
        AntitheticNormalsTowardViewer, "LEANING", variance_loss(lobes(everything, leaning, rising), GRAZING)
    )
    long_tailed = [*of_alpha(GGX), *(GTR(alpha, number(1.5)) for alpha in map(number, ALPHAS))]
    yield attributes(
        AntitheticNormalsTowardViewer, "STEEP", variance_loss(lobes(long_tailed, leaning[1:], unit), GRAZING)
    )
    longer_tailed = [
        kind(*map(number, values))
        for kind, *values in [(GTR, 0.1, 1), (ABC, 1e4, 0.8), (ABC, 100, 1), (EPD, 0.05, 0.3), (EPD, 0.2, 0.5)]
    ]
    broad = [GTR(number(alpha), number(gamma)) for alpha, gamma in [(0.5, 2), (1, 2), (0.5, 1.5), (1, 0.5)]]
    upright = lobes([*broad, *(Blinn(number(exponent)) for exponent in (0.1, 1))], upright[1:], unit)
    yield attributes(AntitheticSteepNormals, "STEEP", variance_loss(upright, STEEPEST))
    implicit = lobes([*long_tailed, *longer_tailed], [shadowing.Implicit()], unit)
    yield attributes(AntitheticImplicitNormals, "STEEPEST", variance_loss(implicit, STEEPEST))

    for kind, term in {
        shadowing.Smith: smith,
        shadowing.SchlickSmith: schlick,
        shadowing.Implicit: shadowing.Implicit(),
        shadowing.Neumann: shadowing.Neumann(),
        shadowing.AshikhminPremoze: shadowing.AshikhminPremoze(),
        shadowing.KurtShadowing: shadowing.KurtShadowing(number(0.25)),
        ResponseShadowing: ResponseShadowing(),
        Unshadowed: Unshadowed(),
    }.items():
        yield attributes(kind, "lean", variance_loss(lobes(short_tailed, [term], unit), GRAZING))
    brady = [Exponential(number(beta**2), number(0.5 * a), True) for beta, a in product((0.2, 0.3, 0.5), (0.8, 1.4, 2))]
    yield attributes(Projected, "lean", variance_loss(lobes(brady, [Projected()], unit), GRAZING))


if __name__ == "__main__":
    main(__doc__, fits)
