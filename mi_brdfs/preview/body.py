"""The turned body of the preview scene, as a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mitsuba as mi
import numpy as np

RADIUS, CENTRE = 0.95, 1.22
"""The ball's radius and the height of its centre."""

# The outlines below and above the ball: control points (radius, height) of smooth curves.
FOOT = [(0.00, 0.00), (0.56, 0.00), (0.74, 0.04), (0.73, 0.13), (0.47, 0.20), (0.39, 0.29), (0.46, 0.39)]
KNOB = [(0.36, 2.10), (0.27, 2.15), (0.24, 2.21), (0.28, 2.28), (0.18, 2.37), (0.00, 2.39)]

GROOVE, GROOVE_WIDTH, DEPTH = np.radians(-27), np.radians(1.6), 0.055
"""The elevation of the groove, as seen from the ball's centre, half its width, and its depth."""
AZIMUTH, ELEVATION, ANGLE = np.radians(-78), np.radians(50), np.radians(17)
"""Where the normal of the flat facet points to, and half the angle that the facet spans at the ball's centre."""
BEVEL = 0.004


def turned_body(bsdf: mi.BSDF) -> mi.Mesh:
    """Return the body, with u around its axis and v along it."""
    foot, knob = _smooth(FOOT, 72), _smooth(KNOB, 56)
    low, high = np.arcsin((np.array([foot[-1, 1], knob[0, 1]]) - CENTRE) / RADIUS)
    elevation = np.linspace(low, high, 260)
    radius = RADIUS - DEPTH / (1 + ((elevation - GROOVE) / GROOVE_WIDTH) ** 6)
    ball = np.stack([radius * np.cos(elevation), CENTRE + radius * np.sin(elevation)], axis=-1)
    positions, normals, uv = _revolve(np.concatenate([foot[:-1], ball, knob[1:]]), 384)
    rings = slice(len(foot) - 1, 1 - len(knob))
    _cut(positions[rings], normals[rings])
    return _mesh(positions, normals, uv, bsdf)


def _smooth(points: Sequence[Any], count: int) -> np.ndarray:
    """Return ``count`` points on the Catmull-Rom curve through ``points``, shape (count, 2)."""
    p = np.array([points[0], *points, points[-1]])
    t = np.linspace(0, len(points) - 1, count)
    k = np.minimum(t.astype(int), len(points) - 2)
    t = (t - k)[:, None]
    p0, p1, p2, p3 = (p[k + offset] for offset in range(4))
    a, b, c = p2 - p0, 2 * p0 - 5 * p1 + 4 * p2 - p3, 3 * (p1 - p2) + p3 - p0
    curve = p1 + 0.5 * (a * t + b * t**2 + c * t**3)
    curve[:, 0] = np.maximum(curve[:, 0], 0)
    return curve


def _revolve(outline: np.ndarray, segments: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, normals and texture coordinates of the surface that an outline of (radius, height) sweeps
    around the z axis, shape (rings, segments + 1, …)."""
    radius, height = outline.T
    d_radius, d_height = np.gradient(outline, axis=0).T
    phi = np.linspace(0, 2 * np.pi, segments + 1)
    cos, sin, one = np.cos(phi), np.sin(phi), np.ones_like(phi)
    positions = np.stack([np.outer(radius, cos), np.outer(radius, sin), np.outer(height, one)], axis=-1)
    normals = np.stack([np.outer(d_height, cos), np.outer(d_height, sin), np.outer(-d_radius, one)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    uv = np.stack(np.meshgrid(phi / (2 * np.pi), np.linspace(0, 1, len(outline))), axis=-1)
    return positions, normals, uv


def _cut(positions: np.ndarray, normals: np.ndarray) -> None:
    """Cut a facet with a rounded edge off the ball, in place: the surface is the smooth minimum of two distances from
    the ball's centre, its own and the plane's."""
    normal = np.array([np.cos(AZIMUTH) * np.cos(ELEVATION), np.sin(AZIMUTH) * np.cos(ELEVATION), np.sin(ELEVATION)])
    centre = np.array([0, 0, CENTRE])
    ray = positions - centre
    distance = np.linalg.norm(ray, axis=-1, keepdims=True)
    cosine = (ray @ normal)[..., None] / distance
    beyond = (distance - RADIUS * np.cos(ANGLE) / np.maximum(cosine, 1e-3)) / BEVEL
    positions[:] = centre + ray * (1 - BEVEL * np.logaddexp(0, beyond) / distance)
    share = 0.5 * (1 + np.tanh(beyond / 2))
    normals[:] += share * (normal - normals)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)


def _mesh(positions: np.ndarray, normals: np.ndarray, uv: np.ndarray, bsdf: mi.BSDF) -> mi.Mesh:
    """Return the mesh of a grid of vertices."""
    rings, columns = positions.shape[:2]
    corner = np.arange(rings - 1)[:, None] * columns + np.arange(columns - 1)
    right, up = corner + 1, corner + columns
    faces = np.stack([corner, right, up + 1, corner, up + 1, up], axis=-1).reshape(-1, 3)

    props = mi.Properties()
    props["bsdf"] = bsdf
    mesh = mi.Mesh("body", rings * columns, len(faces), props, has_vertex_normals=True, has_vertex_texcoords=True)
    params = mi.traverse(mesh)
    params["vertex_positions"] = positions.astype(np.float32).ravel()
    params["vertex_normals"] = normals.astype(np.float32).ravel()
    params["vertex_texcoords"] = uv.astype(np.float32).ravel()
    params["faces"] = faces.astype(np.uint32).ravel()
    params.update()
    return mesh
