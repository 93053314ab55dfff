"""The tilt of visible normals towards the normal, and so l/α, which has the least mean relative variance.

python tests/calibration/visible_normals.py [--check]
"""

from __future__ import annotations

from collections.abc import Iterator

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet.distributions import GGX
from mi_brdfs.microfacet.fresnel import Dielectric, Schlick, Unit
from mi_brdfs.microfacet.visible import VisibleNormals

ANGLES = 5, 30, 60, 80


def fits() -> Iterator[Fit]:
    facets = [GGX(alpha, alpha) for alpha in map(number, (0.1, 0.25, 0.5, 0.75, 1))]
    reflectances = Unit(), Schlick(number(0.04)), Dielectric(number(1.5))
    lobes = [MicrofacetLobe(1, it, it.smith(correlated=False), f) for it in facets for f in reflectances]
    yield attributes(VisibleNormals, "BIAS", variance_loss(lobes, ANGLES))


if __name__ == "__main__":
    main(__doc__, fits)
