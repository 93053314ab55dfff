"""A scene that shows a material."""

from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi

from ..given import check_given, described, load_described
from ..parameters.messages import listed
from .body import ball_and_ribbon
from .studio import backdrop, environment


def preview_scene(bsdf: str | dict | mi.BSDF, stage: str = "studio") -> dict:
    """Return the dict of a scene that shows a material: ``mi.render(mi.load_dict(preview_scene({"type": "ward"})))``.

    A ball and a wavy ribbon stand before a dark backdrop. dp_du runs around the ball's axis, which leans towards the
    camera, and along the ribbon over its waves. The picture has 512 x 512 pixels and 128 samples.

    Args:
        bsdf: the material: a plugin dict, the name of a plugin or of a published material, the path of a measured
            file, or a loaded BSDF of the active variant.
        stage: the light. ``studio``, an environment with something to reflect: a softbox and a thin strip on the left,
            a strip on the right, a panel above and a rim from behind; no radiance is above 5, and white paper is about
            1. ``lamp``, two small lamps in the dark, for the shape of highlights and their tails. ``point``, one point
            light on the left, a faint sky and no interreflection, for bands, limb and terminator.

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
        "integrator": {"type": "path", "max_depth": 2 if stage == "point" else 5},
        "sensor": {
            "type": "perspective",
            "fov": 22.5,
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, -7, 1.9], target=[0, 0, 0.88], up=[0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 512, "height": 512},
            "sampler": {"type": "independent", "sample_count": 128},
        },
        "body": ball_and_ribbon(load_described(described(bsdf))),
        "ground": backdrop(),
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
    light = {"type": "point", "position": [-15.5, -16.0, 10.0], "intensity": 1700.0}
    return {"light": light, "sky": {"type": "constant", "radiance": 0.06}}  # shows the whole outline


STAGES: dict[str, Callable[[], dict[str, dict]]] = {"studio": _studio, "lamp": _lamps, "point": _point}
"""The lights of each stage."""
