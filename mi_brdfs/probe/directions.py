"""Directions of the local frame as float32 arrays of shape (3,) or (N, 3); angles are in degrees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array

STEEPEST = 88.5
"""The angles of scattered directions end here: nearer to grazing, float32 knows little of a cosine."""


def direction(theta: ArrayLike, phi: ArrayLike = 0) -> Array:
    """Return the unit vector at these angles, shape (3,), or (3, …) for arrays of them."""
    theta, phi = np.radians(np.array([theta, phi]))
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], np.float32)


def on_side(w: Array, side: ArrayLike) -> Array:
    """Return directions above the horizon, or for a side of -1 their mirror images below; each may have its side."""
    return w * np.stack(np.broadcast_arrays(1, 1, side), axis=-1).astype(np.float32)


def hemisphere(count: int, seed: int, lowest: float = 0.01) -> Array:
    """Draw uniform directions above the horizon, with cosines of at least ``lowest``, shape (count, 3)."""
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(lowest, 1, count), rng.uniform(0, 2 * np.pi, count)
    sin = np.sqrt(1 - z * z)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), z], axis=-1).astype(np.float32)


def beside(w: Array, seed: int) -> Array:
    """Draw such directions on the sides that others are on."""
    return on_side(hemisphere(len(w), seed), np.sign(w[:, 2]))


def scattered(count: int, seed: int, sides: Sequence[int]) -> Array:
    """Draw directions whose angles and azimuths fill their ranges evenly, on some sides in turn, shape (count, 3)."""
    jitter = np.random.default_rng(seed).random((2, count))
    lane = np.arange(count)
    theta = STEEPEST * (lane + jitter[0]) / count
    # The golden ratio spreads the azimuths of any interval of angles.
    phi = 2 * np.pi * ((lane * 0.6180339887498949 + 0.3 * jitter[1]) % 1)
    sin = np.sin(np.radians(theta))
    w = np.stack([sin * np.cos(phi), sin * np.sin(phi), np.cos(np.radians(theta))], axis=-1).astype(np.float32)
    w[:, 2] *= np.array(sides)[lane % len(sides)]
    return w


def angles_of(w: Array) -> str:
    """Return a direction in words."""
    theta = np.degrees(np.arctan2(np.hypot(w[0], w[1]), w[2]))
    phi = f"{np.degrees(np.arctan2(w[1], w[0])):.4g}".replace("-", "−")
    return f"θ = {theta:.4g}°, φ = {phi}°"


def azimuth_axis(w: Array) -> Array:
    """Return the azimuth of a direction as a unit vector (cosφ, sinφ); (1, 0) at the normal."""
    length = np.hypot(w[0], w[1])
    return np.array([w[0], w[1]], np.float64) / length if length > 1e-4 else np.array([1.0, 0.0])


# --- The azimuthal equidistant projection ---------------------------------------------------------------------------


def to_plane(w: Array, axis: ArrayLike) -> tuple[Array, Array]:
    """Project directions of shape (N, 3) onto a plane seen from the normal: ``(x, y)`` at the distance θ from the
    centre, in degrees, with the azimuth ``axis`` (cosφ, sinφ) to the left.

    Unlike in an orthographic view, what is at grazing angles can be seen, and a scale along the plane of incidence is
    one of θ wherever a window is. Directions below the horizon fall where their mirror images above do.
    """
    cos, sin = np.asarray(axis)
    along, across = w @ [cos, sin, 0], w @ [-sin, cos, 0]
    length = np.hypot(along, across)
    scale = np.degrees(np.arctan2(length, abs(w[:, 2]))) / np.maximum(length, 1e-30)
    return -along * scale, -across * scale


def from_plane(x: Array, y: Array, side: int, axis: ArrayLike) -> Array:
    """Return the directions that :func:`to_plane` projects to some points, on a side, float64 of shape (N, 3)."""
    cos, sin = np.asarray(axis)
    theta = np.hypot(x, y)
    scale = np.sin(np.radians(theta)) / np.maximum(theta, 1e-30)
    along, across, up = -x * scale, -y * scale, side * np.cos(np.radians(theta))
    return np.stack([cos * along - sin * across, sin * along + cos * across, up], axis=-1)
