"""The studio's environment, computed: softboxes, a window, strips and a horizon."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

WIDTH, HEIGHT = 512, 256
BAR, EDGE = 0.014, 0.02
"""Half the width of a window's bars, and the width of all edges, as tangents."""


class Light(NamedTuple):
    """A rectangle that faces the body. It is brightest in its middle."""

    towards: tuple[float, float, float]
    """Where its middle is, as seen from the body: to the right, away from the camera, up."""
    half: tuple[float, float]
    """Half its width and height, as tangents."""
    radiance: tuple[float, float, float]
    panes: tuple[int, int] = (1, 1)
    """Columns and rows."""


LIGHTS = [
    Light((-0.76, -0.58, 0.64), (0.72, 0.62), (3.8, 3.45, 2.9)),
    Light((0.88, -0.30, 0.38), (0.50, 0.32), (2.6, 2.5, 2.3), (4, 2)),
    Light((0.222, 0.043, 0.975), (0.34, 0.34), (1.3, 1.25, 1.1)),
    Light((0.74, 0.70, 0.30), (0.08, 0.50), (3.6, 3.8, 4.1)),
    Light((-0.74, 0.74, 0.36), (0.05, 0.50), (3.2, 3.3, 3.6)),
]


@cache
def environment() -> np.ndarray:
    """Return the radiance in all directions, linear rgb, shape (256, 512, 3), float32. Rows run from the zenith to the
    nadir; columns from behind the body over the right, the camera's side and the left."""
    polar, azimuth = (np.arange(HEIGHT)[:, None] + 0.5) * np.pi / HEIGHT, (np.arange(WIDTH) + 0.5) * 2 * np.pi / WIDTH
    directions = np.stack(
        np.broadcast_arrays(np.sin(azimuth) * np.sin(polar), np.cos(azimuth) * np.sin(polar), np.cos(polar)), axis=-1
    )
    z = directions[..., 2:]
    # The walls are brightest above the horizon; below it, the ground hides everything.
    walls = np.where(z > 0, 0.1 + 0.3 * np.exp(-np.square((z - 0.08) / 0.12)), 0.1)
    picture = walls * [1.06, 1.0, 0.88] + sum(_shine(light, directions) for light in LIGHTS)
    return picture.astype(np.float32)


def _shine(light: Light, directions: np.ndarray) -> np.ndarray:
    middle = np.array(light.towards) / np.linalg.norm(light.towards)
    right = np.cross(middle, [0, 0, 1])
    right /= np.linalg.norm(right)
    ahead = directions @ middle
    shine = (ahead > 0).astype(float)
    for axis, half, panes in zip((right, np.cross(right, middle)), light.half, light.panes, strict=True):
        position = directions @ axis / np.maximum(ahead, 1e-3) / half
        within_pane = abs((position + 1) / 2 * panes % 1 * 2 - 1)
        inwards = half * np.minimum(1 - abs(position), (1 - within_pane) / panes)
        shine *= np.clip((inwards - BAR) / EDGE, 0, 1) * (1 - 0.45 * np.minimum(position**2, 1))
    return shine[..., None] * light.radiance
