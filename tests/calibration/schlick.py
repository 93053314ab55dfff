"""Schlick's model: the cosine for which its reflectance is estimated where directions are no mirror images, by the
least mean square log ratio of the estimated albedo to the measured one.

    python tests/calibration/schlick.py [--check]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from harness import Fit, attributes, estimate_loss, main

from mi_brdfs.lobes import Lobe
from mi_brdfs.models import schlick
from mi_brdfs.probe.arrays import interaction

import mitsuba as mi  # isort: skip

ANGLES = 5, 30, 60, 80


def lobes(roughness: float, upper: float, lower: float) -> Sequence[Lobe]:
    """The interreflection and the lower layer."""
    given = {"roughness": roughness, "specular_reflectance": upper, "diffuse_reflectance": lower}
    model = mi.load_dict({"type": "schlick", "variant": "interreflection", **given}).model
    return model.lobes(model.evaluate(interaction([0, 0, 1]), True))[1:]


def fits() -> Iterator[Fit]:
    settings = list(product((0.01, 0.1, 1), (0.04, 0.3), (0.2, 0.8)))

    def loss():
        return estimate_loss([lobe for setting in settings for lobe in lobes(*setting)], ANGLES)()

    yield attributes(schlick, "TYPICAL", loss, tolerance=0.1)


if __name__ == "__main__":
    main(__doc__, fits)
