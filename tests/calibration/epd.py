"""The exponential power distribution: how far the law that it is drawn from reaches, and at which slopes D is
evaluated, for the least mean relative variance of half vectors.

    python tests/calibration/epd.py [--check]
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet.distributions import EPD
from mi_brdfs.microfacet.fresnel import Unit
from mi_brdfs.microfacet.shadowing import VCavity

ANGLES = 5, 30, 60, 80
ALPHAS = 0.02, 0.1, 0.5
GAMMAS = 0.2, 0.35, 0.5, 0.75, 1, 1.5, 3


def fits() -> Iterator[Fit]:
    def loss():
        lobes = [
            MicrofacetLobe(1, EPD(number(alpha), number(gamma)), VCavity(), Unit())
            for alpha, gamma in product(ALPHAS, GAMMAS)
        ]
        return variance_loss(lobes, ANGLES)()

    yield attributes(EPD, "FAR GROWTH", loss)


if __name__ == "__main__":
    main(__doc__, fits)
