"""The share of forward directions of dielectrics that hardly reflect elsewhere, with the least mean relative variance.

python tests/calibration/forward.py [--check] [NAME ...]
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet.distributions import GGX, Beckmann
from mi_brdfs.microfacet.forward import ForwardDirections
from mi_brdfs.microfacet.fresnel import Dielectric
from mi_brdfs.microfacet.shadowing import VCavity

ANGLES = 60, 75, 85, 88
ALPHAS = 0.1, 0.3, 1


def fits() -> Iterator[Fit]:
    facets = [kind(alpha, alpha) for kind in (Beckmann, GGX) for alpha in map(number, ALPHAS)]

    def of_indices(*indices):
        return variance_loss(
            [
                MicrofacetLobe(1, it, g, Dielectric(number(eta)))
                for it, eta in product(facets, indices)
                for g in (it.smith(correlated=True), VCavity())
            ],
            ANGLES,
        )

    yield attributes(ForwardDirections, "INDISTINCT", of_indices(1.1, 1.2, 1.3, 1.5))
    yield attributes(ForwardDirections, "LARGEST TYPICAL", of_indices(0.95, 1.01, 1.05, 1.2))


if __name__ == "__main__":
    main(__doc__, fits)
