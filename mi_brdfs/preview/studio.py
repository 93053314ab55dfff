"""The studio: its lights, as an environment that is computed, and the backdrop of all stages."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import mitsuba as mi
import numpy as np

from .body import mesh

WIDTH, HEIGHT = 512, 256
EDGE = 0.02
"""The width of the lights' edges, as a tangent."""

DARK, GLOW = np.array([0.035, 0.042, 0.06]), np.array([0.06, 0.12, 0.25])
"""The backdrop's reflectance, and what it has in addition behind the body."""
REACH, BEND, TOP = 40.0, (5.0, 6.0), 6.5
"""How far the floor extends, where it begins to curve and with which radius, and the height of the wall."""


class Light(NamedTuple):
    """A rectangle that faces the body. It is brightest in its middle."""

    towards: tuple[float, float, float]
    """Where its middle is, as seen from the body: to the right, away from the camera, up."""
    half: tuple[float, float]
    """Half its width and height, as tangents."""
    radiance: tuple[float, float, float]


LIGHTS = [
    # A softbox and a thin strip on the left, a strip on the right, a small panel above, a rim from behind.
    Light((-0.80, -0.52, 0.42), (0.34, 0.80), (4.6, 4.1, 3.3)),
    Light((-0.30, -0.80, 0.62), (0.05, 0.55), (4.2, 3.9, 3.4)),
    Light((0.90, -0.34, 0.36), (0.13, 0.80), (4.4, 3.8, 3.0)),
    Light((0.63, 0.24, 0.74), (0.24, 0.24), (1.7, 1.6, 1.4)),
    Light((-0.10, 0.72, 0.70), (0.95, 0.13), (3.4, 3.7, 4.4)),
]


@cache
def environment() -> np.ndarray:
    """Return the radiance in all directions, linear rgb, shape (256, 512, 3), float32. Rows run from the zenith to the
    nadir; columns from behind the body over the right, the camera's side and the left."""
    polar, azimuth = (np.arange(HEIGHT)[:, None] + 0.5) * np.pi / HEIGHT, (np.arange(WIDTH) + 0.5) * 2 * np.pi / WIDTH
    directions = np.stack(
        np.broadcast_arrays(np.sin(azimuth) * np.sin(polar), np.cos(azimuth) * np.sin(polar), np.cos(polar)), axis=-1
    )
    room = (0.09 + 0.08 * np.maximum(directions[..., 2:], 0)) * [0.95, 0.97, 1.05]
    return (room + sum(_shine(light, directions) for light in LIGHTS)).astype(np.float32)


def _shine(light: Light, directions: np.ndarray) -> np.ndarray:
    middle = np.array(light.towards) / np.linalg.norm(light.towards)
    right = np.cross(middle, [0, 0, 1])
    right /= np.linalg.norm(right)
    ahead = directions @ middle
    shine = (ahead > 0).astype(float)
    for axis, half in zip((right, np.cross(right, middle)), light.half, strict=True):
        position = directions @ axis / np.maximum(ahead, 1e-3) / half
        inwards = half * (1 - abs(position))
        shine *= np.clip(inwards / EDGE, 0, 1) * (1 - 0.45 * np.minimum(position**2, 1))
    return shine[..., None] * light.radiance


def backdrop() -> mi.Mesh:
    """Return a dark floor that curves into a wall without an edge, which glows behind the body."""
    start, radius = BEND
    turn = np.linspace(0, np.pi / 2, 49)
    y = np.array([-REACH, *(start + radius * np.sin(turn)), start + radius])
    z = np.array([0, *(radius * (1 - np.cos(turn))), TOP])
    along = np.concatenate([[0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    slope = np.array([0, *turn, np.pi / 2])
    u, v = np.meshgrid([0.0, 1.0], along / along[-1])
    positions = np.stack([REACH * (2 * u - 1), y[:, None] + 0 * u, z[:, None] + 0 * u], axis=-1)
    normals = np.stack([0 * u, -np.sin(slope)[:, None] + 0 * u, np.cos(slope)[:, None] + 0 * u], axis=-1)

    v_of_pixels, x = (np.arange(256) + 0.5) / 256, ((np.arange(512) + 0.5) / 256 - 1) * REACH
    depth, height = (np.interp(v_of_pixels * along[-1], along, each)[:, None] for each in (y, z))
    glow = np.exp(-np.square(x / 2.4) - np.square((height - 1.3) / 1.9)) * np.clip(depth / 9, 0, 1)
    reflectance = (DARK + glow[..., None] * GLOW).astype(np.float32)
    bsdf = mi.load_dict({"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": mi.Bitmap(reflectance)}})
    return mesh("ground", bsdf, (positions, normals, np.stack([u, v], axis=-1)))
