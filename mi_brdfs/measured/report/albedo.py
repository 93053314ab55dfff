"""The directional albedo of a table, ∫ f cosθo dωo, by a fixed quadrature.

The plane through the normal that is perpendicular to the plane of incidence cuts the hemisphere in two. Each part has
polar coordinates about its centre, the mirror direction of the one and wi of the other, with nodes that grow dense
towards it, where highlights and retro-reflection are; great circles bound it, so that none is wasted and no edge lies
between them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from ..arrays import stacked
from ..coordinates import TWO_PI, spherical
from ..grid import Extrapolation, Grid

RADII = 96
"""The nodes along a radius."""
TURNS = 64
"""Those within a quarter of a turn about the centre of a part."""
_gauss = functools.cache(np.polynomial.legendre.leggauss)


def albedos(grid: Grid, theta_i: np.ndarray, phi_i: float = 0, extrapolate: Extrapolation = "hold") -> np.ndarray:
    """Return the directional albedos at angles of incidence in [0, π/2), shape (N, channels).

    Good to 0.1 % for lobes of any width down to that of GGX facets of α = .001, and to 1 % where the measured range
    ends before f does.
    """
    return np.array([
        grid.integrated(wi, wo, solid_angle * wo[:, 2], extrapolate)
        for wi, wo, solid_angle in _nodes(theta_i, phi_i)
    ])  # fmt: skip


def coverage(grid: Grid, theta_i: np.ndarray, phi_i: float = 0) -> np.ndarray:
    """Return the shares of the hemisphere of wo, by solid angle, that were measured at angles θi, shape (N,)."""
    return np.array([
        solid_angle @ grid.measured(wi, wo) / TWO_PI for wi, wo, solid_angle in _nodes(theta_i, phi_i)
    ])  # fmt: skip


def _nodes(theta_i: np.ndarray, phi_i: float) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    for theta in np.maximum(theta_i, 1e-6):  # the normal has no azimuth
        wo, solid_angle = hemisphere(theta, phi_i)
        yield stacked(spherical(theta, phi_i)), wo, solid_angle


def hemisphere(theta_i: float, phi_i: float = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return directions above the horizon, shape (N, 3), and their solid angles, for an integral over functions with
    peaks at the mirror direction of ``(theta_i, phi_i)`` or at this direction itself."""
    parts = [part for towards in (-1, 1) for part in _part(theta_i, towards)]
    wo, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    cos, sin = np.cos(phi_i), np.sin(phi_i)
    return wo @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]), weight


def _part(theta: float, towards: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the directions and solid angles of the part about the direction in the xz plane at an angle to the normal,
    on the side of positive or negative x."""
    cos, sin = np.cos(theta), np.sin(theta)
    nodes, weights = _gauss(TURNS)
    u, of_u = nodes / 2 + 0.5, weights[:, None] / 2
    # Shifted from one azimuth to the next, by the golden ratio: where f ends as at a wall, at the edge of what was
    # measured, the errors of the rows cancel.
    t = (np.arange(RADII) + np.mod(np.arange(TURNS)[:, None] * 0.6180339887498949, 1)) / RADII
    # The azimuth about the centre is 0 towards the normal. Up to a quarter of a turn the plane x = 0 bounds the part,
    # and the horizon from there on.
    for start in (0, np.pi / 2):
        psi = (start + np.pi / 2 * u)[:, None]
        end = np.arctan2(cos, -sin * np.cos(psi)) if start else np.arctan2(sin, cos * np.cos(psi))
        radius = end * t * t
        weight = np.pi / 2 * of_u * 2 * end * t / RADII * np.sin(radius)
        x = sin * np.cos(radius) - cos * np.sin(radius) * np.cos(psi)
        y = np.sin(radius) * np.sin(psi)
        z = cos * np.cos(radius) + sin * np.sin(radius) * np.cos(psi)
        for side in (-1, 1):
            yield np.stack([towards * x, side * y, z], axis=-1).reshape(-1, 3), weight.ravel()
