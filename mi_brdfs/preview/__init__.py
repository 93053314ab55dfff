"""A scene that shows a material."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mitsuba as mi
import numpy as np

from ..given import check_given, described, load_described
from ..parameters.messages import listed
from .body import CENTRE, turned_body
from .studio import environment


def preview_scene(bsdf: str | dict | mi.BSDF, stage: str = "studio") -> dict:
    """Return the dict of a scene that shows a material: ``mi.render(mi.load_dict(preview_scene({"type": "ward"})))``.

    A turned body stands on a checkered ground: a ball, with a flat facet that mirrors one direction and a groove, on a
    foot; dp_du runs around its axis. The ball is in the middle of the picture, of 512 x 512 pixels and 128 samples.

    Args:
        bsdf: the material: a plugin dict, the name of a plugin or of a published material, the path of a measured
            file, or a loaded BSDF of the active variant.
        stage: the light. ``studio``, an environment with something to reflect: a softbox on the left, a window with
            bars on the right, strips behind, a horizon; no radiance is above 4, and white paper is about 1. ``lamp``,
            two small lamps in the dark, for the shape of highlights and their tails. ``point``, one point light on the
            left and no interreflection, for bands, limb and terminator.

    Returns:
        A dict for ``mi.load_dict``, to be changed at will before loading; it belongs to the active variant.

    Raises:
        ValueError: if there is no such stage, or for what is no BSDF or cannot be loaded.
    """
    if stage not in STAGES:
        raise ValueError(f"there is no stage {stage!r}; there are {listed(tuple(STAGES))}")
    check_given(bsdf)
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2 if stage == "point" else 6},
        "sensor": {
            "type": "perspective",
            "fov": 25.4,
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, -6.2, 2.9], target=[0, 0, CENTRE], up=[0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 512, "height": 512},
            "sampler": {"type": "independent", "sample_count": 128},
        },
        "body": turned_body(load_described(described(bsdf))),
        "ground": _ground(),
        **STAGES[stage](),
    }


def _studio() -> dict[str, dict]:
    # The environment's y is up, the scene's z.
    to_world = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    return {"studio": {"type": "envmap", "bitmap": mi.Bitmap(environment()), "to_world": to_world}}


def _lamps() -> dict[str, dict]:
    def lamp(centre: list[float], radius: float, radiance: float) -> dict:
        return {"type": "sphere", "center": centre, "radius": radius, "emitter": {"type": "area", "radiance": radiance}}

    sky = {"type": "constant", "radiance": 0.04}
    return {"key": lamp([-4.4, -4.2, 5.2], 0.16, 3300.0), "rim": lamp([3.8, 3.2, 3.0], 0.16, 1100.0), "sky": sky}


def _point() -> dict[str, dict]:
    return {"light": {"type": "point", "position": [-15.5, -16.0, 10.0], "intensity": 1700.0}}


STAGES: dict[str, Callable[[], dict[str, dict]]] = {"studio": _studio, "lamp": _lamps, "point": _point}
"""The lights of each stage."""


def _ground() -> dict[str, Any]:
    """Return a plane beyond the horizon of the picture, with checks that fade into plain grey."""
    size, reach, plain = 60.0, 7.0, 0.2
    position = np.linspace(-reach, reach, 128)
    fade = np.clip(np.hypot(*np.meshgrid(position, position)) / reach, 0, 1)[..., None] ** 1.5

    def shade(near: float) -> dict[str, Any]:
        values = (near + (plain - near) * fade).astype(np.float32)
        # The bitmap covers the middle of the plane; its edge goes on outside.
        uv = mi.ScalarTransform3f().translate([0.5, 0.5]).scale(size / reach).translate([-0.5, -0.5])
        return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "wrap_mode": "clamp", "to_uv": uv}

    checks = {"type": "checkerboard", "color0": shade(0.42), "color1": shade(0.22),
              "to_uv": mi.ScalarTransform3f().scale(size / 0.5)}  # fmt: skip
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().rotate([0, 0, 1], 28).scale(size),
        "bsdf": {"type": "diffuse", "reflectance": checks},
    }
