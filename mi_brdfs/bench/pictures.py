"""Pictures of BSDFs in turn, with their render times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import asin, atan, degrees, radians, sin, sqrt, tan
from time import perf_counter
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, luminance
from .statistics import in_turn

SIZE = 128
"""The width and height of pictures."""
SPP = 64
ROUNDS = 15
"""Pictures of each BSDF."""
DISTANCE = 4
"""The distance of the camera from the centre of a sphere of radius 1."""
LIMB = 85
"""The angle, in degrees, at which the sphere is seen in the corners of the picture. The sphere fills the picture, so
that all noise comes from the BSDF and none from the sphere's edge."""
PATH = {"type": "path", "max_depth": 6}

Scene = dict[str, Any]


class Pictures(NamedTuple):
    """Pictures of some BSDFs, one for each seed."""

    seconds: Array
    """The render times, of shape (BSDFs, seeds)."""
    luminance: Array
    """That of the pixels, of shape (BSDFs, seeds, pixels)."""


def sphere(bsdf: Any, size: int, integrator: Scene = PATH) -> Scene:
    """Return a sphere under a constant environment."""
    corner = asin(sin(radians(LIMB)) / DISTANCE)
    return {
        "type": "scene",
        "integrator": integrator,
        "sensor": {
            "type": "perspective",
            "fov": 2 * degrees(atan(tan(corner) / sqrt(2))),
            "to_world": mi.ScalarTransform4f().look_at([0, 0, DISTANCE], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "sky": {"type": "constant"},
    }


def render_in_turn(scenes: Sequence[Callable[[], Scene]]) -> Pictures:
    """Render each scene with each seed. Only one of them is loaded at a time: a render's kernel contains the code of
    every live BSDF."""
    seconds = np.zeros((len(scenes), ROUNDS))
    pictures: list[list[Array]] = [[] for _ in scenes]
    for scene in scenes:
        render(scene(), 0)  # compiles
    for k, seed in in_turn(len(scenes), ROUNDS):
        seconds[k, seed], picture = render(scenes[k](), seed)
        pictures[k].append(luminance(picture.reshape(-1, picture.shape[-1])))
    return Pictures(seconds, np.array(pictures))


def render(scene: Scene, seed: int, spp: int = SPP) -> tuple[float, Array]:
    """Return ``(seconds, picture)`` of a scene, loaded before and discarded afterwards."""
    loaded = mi.load_dict(scene)
    dr.sync_thread()
    start = perf_counter()
    picture = mi.render(loaded, spp=spp, seed=seed)
    dr.eval(picture)
    dr.sync_thread()
    return perf_counter() - start, np.array(picture, np.float64)
