"""What the preview scene shows, as a mesh: a ball and a ribbon."""

from __future__ import annotations

from itertools import accumulate

import mitsuba as mi
import numpy as np

RADIUS, CENTRE = 1.0, 1.0
"""The ball's radius and the height of its centre."""
TILT, AZIMUTH = np.radians(62), np.radians(-72)
"""How far the ball's axis leans, and where to."""

LENGTH, WIDTH, SLOPE = 2.0, 0.36, np.radians(38)
"""The ribbon's extent from left to right and across, and the angle at which it leans against the ball."""
CRESTS, AMPLITUDE = 3, 0.09

Grid = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Positions, normals and texture coordinates of a surface, shape (rows, columns, 3 or 2)."""


def ball_and_ribbon(bsdf: mi.BSDF) -> mi.Mesh:
    """Return the ball and the ribbon. u runs around the ball's axis, and along the ribbon over its waves."""
    return mesh("body", bsdf, _ball(), _ribbon())


def _ball() -> Grid:
    u, v = _uv(385, 257)
    phi, polar = 2 * np.pi * u, np.pi * (1 - v)
    normals = np.stack([np.sin(polar) * np.cos(phi), np.sin(polar) * np.sin(phi), np.cos(polar)], axis=-1)
    cos, sin = np.cos(TILT), np.sin(TILT)
    lean = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    cos, sin = np.cos(AZIMUTH), np.sin(AZIMUTH)
    normals = normals @ (np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ lean).T
    return RADIUS * normals + [0, 0, CENTRE], normals, np.stack([u, v], axis=-1)


def _ribbon() -> Grid:
    u, v = _uv(241, 2)
    phase = 2 * np.pi * CRESTS * u[..., None]
    height, slope = AMPLITUDE * np.sin(phase), 2 * np.pi * CRESTS * AMPLITUDE / LENGTH * np.cos(phase)
    along, across, up = np.array([[1, 0, 0], [0, np.cos(SLOPE), np.sin(SLOPE)], [0, -np.sin(SLOPE), np.cos(SLOPE)]])
    corner = np.array([-LENGTH / 2, -1.3 * RADIUS, 0.02 + AMPLITUDE * np.cos(SLOPE)])
    positions = corner + LENGTH * u[..., None] * along + WIDTH * v[..., None] * across + height * up
    return positions, (up - slope * along) / np.hypot(1, slope), np.stack([u, v], axis=-1)


def _uv(columns: int, rows: int) -> tuple[np.ndarray, ...]:
    return tuple(np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)))


def mesh(name: str, bsdf: mi.BSDF, *grids: Grid) -> mi.Mesh:
    """Return the mesh of several grids of vertices."""
    sizes = [grid[0].shape[:2] for grid in grids]
    starts = accumulate((rows * columns for rows, columns in sizes), initial=0)
    faces = np.concatenate([start + _faces(*size) for start, size in zip(starts, sizes, strict=False)])

    props = mi.Properties()
    props["bsdf"] = bsdf
    count = sum(rows * columns for rows, columns in sizes)
    made = mi.Mesh(name, count, len(faces), props, has_vertex_normals=True, has_vertex_texcoords=True)
    params = mi.traverse(made)
    for key, parts in zip(("positions", "normals", "texcoords"), zip(*grids, strict=True), strict=True):
        params[f"vertex_{key}"] = np.concatenate([part.ravel() for part in parts]).astype(np.float32)
    params["faces"] = faces.astype(np.uint32).ravel()
    params.update()
    return made


def _faces(rows: int, columns: int) -> np.ndarray:
    """Return the triangles of a grid, with normals along the cross product of a row's and a column's direction."""
    corner = np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)
    right, up = corner + 1, corner + columns
    return np.stack([corner, right, up + 1, corner, up + 1, up], axis=-1).reshape(-1, 3)
