"""The estimated albedo of microfacet lobes: its constants minimise what it is for, the mean relative variance of
samples of such a lobe over a diffuse one, over distributions, shadowing and Fresnel terms and four angles of incidence.

    python tests/calibration/estimated_albedo.py [--check] [NAME ...]

The variance would have the loss of long tails twice as large, and so narrow lobes of which many samples are wasted
underestimated; the estimate is an output of its own, too, and is to be near the albedo: hence the tolerance there.
"""

from __future__ import annotations

from collections.abc import Iterator

from harness import Fit, OverDiffuse, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet import shadowing
from mi_brdfs.microfacet.distributions import ABC, GGX, GTR, Beckmann, Blinn, Distribution, HemiEPD
from mi_brdfs.microfacet.fresnel import Dielectric, Schlick, Unit
from mi_brdfs.models.ward import Ward1992, WardDuer

ANGLES = 5, 30, 60, 80
ALPHAS = 0.05, 0.2, 0.5, 1


def beckmann() -> list[Distribution]:
    return [Beckmann(alpha, alpha) for alpha in map(number, ALPHAS)]


def ggx() -> list[Distribution]:
    return [GGX(alpha, alpha) for alpha in map(number, ALPHAS)]


def blinn() -> list[Distribution]:
    return [Blinn(number(exponent)) for exponent in (1, 8, 30)]


def others() -> list[Distribution]:
    settings = [(GTR, 0.2, 1), (GTR, 0.5, 3), (ABC, 100, 1.5), (ABC, 1e4, 0.8), (HemiEPD, -5, 100), (HemiEPD, 5, 10)]
    return [kind(*map(number, values)) for kind, *values in settings]


def smith(distribution):
    return [distribution.smith(correlated) for correlated in (False, True)]


def cavities(distribution):
    return [shadowing.VCavity(), shadowing.Kelemen()]


def conserving(distribution):
    return [*smith(distribution), *cavities(distribution)]


def leaning(distribution):
    """Those that do not conserve energy, but for two of Ward's."""
    return [
        shadowing.Implicit(),
        shadowing.Neumann(),
        shadowing.AshikhminPremoze(),
        shadowing.KurtShadowing(number(0.25)),
        shadowing.SchlickSmith(0.8 * distribution.roughness()),
    ]


def upright(distribution):
    return [shadowing.AshikhminShirleyShadowing(), WardDuer(), Ward1992()]


def lobes(facets, shadows, *fresnel):
    return [OverDiffuse(MicrofacetLobe(1, it, g, f)) for it in facets for g in shadows(it) for f in fresnel]


def fits() -> Iterator[Fit]:
    rising = Schlick(number(0.04)), Dielectric(number(1.5))
    everything = [*beckmann(), *ggx(), *blinn()]

    def of(owner, names, *lobes_of, **options):
        return attributes(owner, names, variance_loss(lobes_of, ANGLES), **options)

    short_tailed = [*beckmann(), *blinn()]
    yield of(Distribution, "LOSS", *lobes(short_tailed, conserving, Unit()), *lobes(others(), cavities, Unit()))
    yield of(GGX, "LOSS", *lobes(ggx(), conserving, Unit()), tolerance=0.1)
    both = *lobes(everything, leaning, Unit()), *lobes(everything, upright, Unit())
    yield of(MicrofacetLobe, "TYPICAL LOST", *both)
    yield of(MicrofacetLobe, "NEARER", *lobes(everything, leaning, *rising), *lobes(beckmann(), smith, *rising))
    yield of(MicrofacetLobe, "NEARER_LONG_TAILED", *lobes(ggx(), smith, *rising))
    yield of(MicrofacetLobe, "NEARER_UPRIGHT", *lobes(everything, cavities, *rising))


if __name__ == "__main__":
    main(__doc__, fits)
