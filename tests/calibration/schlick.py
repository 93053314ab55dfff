"""Schlick's model: the cosine for which its reflectance is estimated where directions are no mirror images, by the
least mean square log ratio of the estimated albedo to the measured one.

    python tests/calibration/schlick.py [--check]
"""

from __future__ import annotations

from collections.abc import Iterator

from harness import Fit, attributes, estimate_loss, main, number

from mi_brdfs.microfacet.fresnel import Schlick
from mi_brdfs.models import schlick

ANGLES = 5, 30, 60, 80


def fits() -> Iterator[Fit]:
    layers = [Schlick(number(f0)) for f0 in (0.04, 0.3)]
    lobes = [schlick.InterreflectionLobe(number(roughness), it) for roughness in (0.01, 0.1, 0.5, 1) for it in layers]
    lobes += [schlick.LowerLayerLobe(number(reflectance), it) for reflectance in (0.2, 0.8) for it in layers]
    yield attributes(schlick, "TYPICAL", estimate_loss(lobes, ANGLES), tolerance=0.1)


if __name__ == "__main__":
    main(__doc__, fits)
