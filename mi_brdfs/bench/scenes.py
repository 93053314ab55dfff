"""The scenes in which BSDFs are rendered."""

from __future__ import annotations

from math import asin, atan, degrees, radians, sin, sqrt, tan
from typing import Any

import mitsuba as mi

from . import sizes
from .cases import Plugin

DISTANCE = 4
"""The distance of the camera from the centre of a sphere of radius 1."""
LIMB = 85
"""The angle, in degrees, at which the sphere is seen in the corners of the picture. The sphere fills the picture, so
that all noise comes from the BSDF and none from the sphere's edge."""


def sphere(bsdf: Plugin, integrator: Plugin, size: int) -> dict[str, Any]:
    """Return a sphere under a constant environment."""
    corner = asin(sin(radians(LIMB)) / DISTANCE)
    return {
        "type": "scene",
        "integrator": integrator,
        "sensor": _camera(2 * degrees(atan(tan(corner) / sqrt(2))), DISTANCE, size),
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "sky": {"type": "constant"},
    }


def spheres(bsdfs: list[Plugin], size: int) -> dict[str, Any]:
    """Return a scene with a sphere for each BSDF."""
    balls = {
        f"sphere_{k}": {"type": "sphere", "center": [2 * k - len(bsdfs) + 1, 0, 0], "bsdf": bsdf}
        for k, bsdf in enumerate(bsdfs)
    }
    camera = _camera(60, 2 * len(bsdfs), size)
    return {"type": "scene", "integrator": PATH, "sensor": camera, "sky": {"type": "constant"}, **balls}


def cornell_box(bsdf: Plugin, size: int) -> dict[str, Any]:
    """Return the Cornell box, in which the BSDF replaces white."""
    box = mi.cornell_box()
    box["sensor"]["film"] |= {"width": size, "height": size, "rfilter": {"type": "box"}}
    return box | {"white": bsdf}


def _camera(fov: float, distance: float, size: int) -> dict[str, Any]:
    return {
        "type": "perspective",
        "fov": fov,
        "to_world": mi.ScalarTransform4f().look_at([0, 0, distance], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
    }


PATH = {"type": "path", "max_depth": 6}
BSDF_SAMPLES = {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}

ALONE, SPHERE, BOX = "BSDF samples alone", "sphere", "Cornell box"


def scene_of(bsdf: Plugin, name: str) -> dict[str, Any]:
    """Return the scene of one of the three names above."""
    if name == BOX:
        return cornell_box(bsdf, sizes.PICTURE // 2)
    return sphere(bsdf, BSDF_SAMPLES if name == ALONE else PATH, sizes.PICTURE)
