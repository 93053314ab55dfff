"""Pictures of our BSDF and of the built-in, alternating."""

from __future__ import annotations

from time import perf_counter
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, luminance
from . import sizes
from .cases import Plugin
from .scenes import scene_of


class Renders(NamedTuple):
    """Pictures of two BSDFs, one for each seed."""

    seconds: Array
    """The render times, of shape (2, seeds)."""
    pictures: Array
    """The luminance of the pixels, of shape (2, seeds, pixels)."""

    @property
    def slower(self) -> Array:
        """Return the time of the first over that of the second, for each pair."""
        return self.seconds[0] / self.seconds[1]


def alternate(ours: Plugin, theirs: Plugin, scene: str) -> Renders:
    """Render both in a scene, alternating which comes first. Only one of the two is loaded at a time: a render's kernel
    contains the code of every live BSDF."""
    seconds = np.zeros((2, sizes.PAIRS))
    pictures: tuple[list[Array], list[Array]] = [], []
    dicts = [scene_of(bsdf, scene) for bsdf in (ours, theirs)]
    for each in dicts:
        render(each, 0)  # compiles
    for seed in range(sizes.PAIRS):
        for k in (0, 1) if seed % 2 else (1, 0):
            seconds[k, seed], picture = render(dicts[k], seed)
            pictures[k].append(luminance(picture.reshape(-1, picture.shape[-1])))
    return Renders(seconds, np.array(pictures))


def render(scene: dict[str, Any], seed: int) -> tuple[float, Array]:
    """Return ``(seconds, picture)`` of a scene, loaded before and discarded afterwards."""
    loaded = mi.load_dict(scene)
    dr.sync_thread()
    start = perf_counter()
    picture = mi.render(loaded, spp=sizes.SPP, seed=seed)
    dr.eval(picture)
    dr.sync_thread()
    return perf_counter() - start, np.array(picture, np.float64)
