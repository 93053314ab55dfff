"""The directions of incidence that a BSDF is checked at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..probe.arrays import CENTRE, Array
from ..probe.bsdf import Part
from ..probe.directions import STEEPEST, angles_of, direction, on_side, scattered

AZIMUTH_STEP = 137.5
"""In degrees: each direction has an azimuth of its own, so that what is turned wrongly shows."""
SCATTERED = 1 << 15
RANDOM = 16
"""Directions at random on each side, beside those that were asked for."""


class Incident(NamedTuple):
    """A direction of incidence, float32 and of length one to its precision; or many, of shape (N, 3)."""

    name: str
    wi: Array
    uv: tuple[float, float] = CENTRE
    """Where on the surface statistical tests look."""

    def at(self, lanes: Array | int) -> Array:
        """Return the directions of some lanes, shape (3,) if they all have the same, or that of one."""
        return self.wi if self.wi.ndim == 1 else self.wi[lanes]


def incidents(part: Part, angles: Sequence[float]) -> list[Incident]:
    """Return a direction for each angle of incidence, in degrees, on each side that a part is seen from."""
    return [
        Incident(named(theta, side), on_side(direction(theta, AZIMUTH_STEP * k), side))
        for side in part.sides
        for k, theta in enumerate(angles)
    ]


def all_over(part: Part) -> Incident:
    """Return directions all over the sides that a part is seen from, which find what is wrong at some angles or
    azimuths only."""
    return Incident("all directions", scattered(SCATTERED, 41, part.sides))


def random_incidents(part: Part, count: int = RANDOM) -> list[Incident]:
    """Draw directions, one in each of some intervals of angles, whose azimuths go around the normal, each at a point of
    its own, also outside the unit square of textures."""
    rng, places, drawn = np.random.default_rng(51), np.random.default_rng(52), []
    for side in part.sides:
        turn = rng.permutation(count)
        for k in range(count):
            theta, phi = STEEPEST * (k + rng.random()) / count, 360 * (turn[k] + rng.random()) / count
            u, v = places.uniform(-1, 2, 2).astype(np.float32).tolist()
            drawn.append(Incident(angles_of(w := on_side(direction(theta, phi), side)), w, (u, v)))
    return drawn


def named(theta: float, side: int) -> str:
    """Return an angle of incidence and its side in words."""
    return f"{theta:g}°" if side > 0 else f"{theta:g}° behind"
