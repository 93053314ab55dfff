"""What microfacet lobes are drawn by: pairs of half vectors, the law of the exponential power distribution, visible
normals, and forward directions of dielectrics that hardly reflect elsewhere; the constants of least mean relative
variance.

python tests/calibration/half_vectors.py [--check] [NAME ...]
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet import sampling, shadowing
from mi_brdfs.microfacet.distributions import ABC, EPD, GGX, GTR, Beckmann, Blinn
from mi_brdfs.microfacet.forward import ForwardDirections
from mi_brdfs.microfacet.fresnel import Dielectric, Schlick, Unit
from mi_brdfs.microfacet.visible import VisibleNormals

ANGLES = 5, 30, 60, 80
GRAZING = 60, 75, 85
STEEPEST = 80, 85, 88
FORWARD = 60, 75, 85, 88


def of_alpha(kind, *alphas):
    return [kind(alpha, alpha) for alpha in map(number, alphas or (0.1, 0.25, 0.5, 1))]


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


def separable(distribution):
    return distribution.smith(correlated=False)


def epd_loss():
    facets = [EPD(number(a), number(g)) for a, g in product((0.02, 0.1, 0.5), (0.2, 0.35, 0.5, 0.75, 1, 1.5, 3))]
    return variance_loss(lobes(facets, [shadowing.VCavity()], [Unit()]), ANGLES)()


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

    yield attributes(EPD, "FAR GROWTH", epd_loss)

    seen = lobes(of_alpha(GGX, 0.1, 0.25, 0.5, 0.75, 1), [separable], [*unit, *rising])
    yield attributes(VisibleNormals, "BIAS", variance_loss(seen, ANGLES))

    def of_indices(*indices):
        facets = [*of_alpha(Beckmann, 0.1, 0.3, 1), *of_alpha(GGX, 0.1, 0.3, 1)]
        reflectances = [Dielectric(number(eta)) for eta in indices]
        return variance_loss(lobes(facets, [smith, shadowing.VCavity()], reflectances), FORWARD)

    yield attributes(ForwardDirections, "INDISTINCT", of_indices(1.1, 1.2, 1.3, 1.5))
    yield attributes(ForwardDirections, "LARGEST TYPICAL", of_indices(0.95, 1.01, 1.05, 1.2))


if __name__ == "__main__":
    main(__doc__, fits)
