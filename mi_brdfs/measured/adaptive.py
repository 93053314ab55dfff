"""The adaptive coordinates of Dupuy and Jakob, in which a table's nodes gather where normals are seen."""

from __future__ import annotations

import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..math import EPSILON
from .arrays import vector
from .coordinates import TWO_PI, Coordinates, azimuth_of, polar_angle, spherical
from .warp import Map, MitsubaMap, MitsubaWarp, Warp

FLOOR = 1e-9
"""The least density of a normal, of the mean one: a row in which no normal is seen would be divided by 0."""


class Adaptive(Coordinates):
    """``(θi, u1, u2)``, and φi before them if there is more than one of it: (u1, u2) are the uniform numbers from which
    the half vector is drawn as a visible normal.

    J. Dupuy, W. Jakob, An adaptive parameterization for efficient material acquisition and rendering, ACM TOG 37(6),
    2018, doi:10.1145/3272127.3275059. A direction is at (√(2θ/π), (φ + π)/2π) on the maps ``ndf``, the distribution of
    normals D, ``sigma``, the projected area σ of the normals seen from it, and ``vndf``, the density of the visible
    normals on these two coordinates. Tables hold f cosθo times 4 σ(wi)/D(h), or f cosθo if not ``jacobian``.

    With one or two φi the material is isotropic, and azimuths of normals are relative to that of wi. With more, they
    are absolute; if the φi span half of a turn, [-π, 0], both directions are turned by π where wi lies in the other
    half, and if a quarter, [-π, -π/2], they are mirrored at the x and y axes.

    Args:
        phi_i: nodes in radians, shape (P,).
        theta_i: nodes in radians, shape (T,).
        ndf: shape (rows, columns) of φ and θ.
        sigma: shape (rows, columns) of φ and θ.
        vndf: shape (P, T, rows, columns).
        jacobian: whether the table is of f cosθo 4 σ/D.
    """

    def __init__(
        self,
        phi_i: np.ndarray,
        theta_i: np.ndarray,
        ndf: np.ndarray,
        sigma: np.ndarray,
        vndf: np.ndarray,
        jacobian: bool = True,
    ) -> None:
        self._relative, self._jacobian = len(phi_i) <= 2, jacobian
        self._symmetry = 1 if self._relative else round(TWO_PI / float(phi_i[-1] - phi_i[0]))
        self._nodes = (phi_i, theta_i) if len(phi_i) > 1 else (theta_i,)
        self.anisotropic = len(self._nodes) > 1
        mean = vndf.mean(axis=(2, 3), dtype=np.float64, keepdims=True)
        vndf = np.maximum(vndf, (FLOOR * mean).astype(np.float32))
        self._tables = ndf, sigma, vndf if len(phi_i) > 1 else vndf[0]
        self._warp: Any = Warp(self._tables[2], self._nodes)
        self._ndf: Any = Map(ndf)
        self._sigma: Any = Map(sigma)
        self.names = ("phi_i", "theta_i", "u1", "u2")[2 - len(self._nodes) :]

    def prepared(self) -> Adaptive:
        ndf, sigma, vndf = self._tables
        result = copy.copy(self)
        result._warp, result._ndf, result._sigma = MitsubaWarp(vndf, self._nodes), MitsubaMap(ndf), MitsubaMap(sigma)
        return result

    @property
    def captured(self) -> list[Any]:
        return [self._warp.table, self._ndf.table, self._sigma.table]

    def locate(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[Any, ...]:
        return self.locate_scaled(wi, wo, xp)[0]

    def locate_scaled(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[tuple[Any, ...], Any]:
        x, y = wi.x + wo.x, wi.y + wo.y
        theta_i, phi_i = polar_angle(wi, xp), xp.atan2(wi.y, wi.x)
        theta_m = polar_angle(vector(x, y, wi.z + wo.z), xp)
        if self._symmetry >= 2:
            flip_y = xp.select(wi.y < 0, 1.0, -1.0)
            flip_x = xp.select(wi.x < 0, 1.0, -1.0) if self._symmetry == 4 else flip_y
            x, y = x * flip_x, y * flip_y
            phi_i = -abs(xp.atan2(wi.y * flip_y, wi.x * flip_x))
        if self._relative:
            cos_phi, sin_phi = azimuth_of(wi, xp)
            x, y = x * cos_phi + y * sin_phi, y * cos_phi - x * sin_phi
        on_map = on_theta(theta_m, xp), on_phi(xp.atan2(y, x), xp)
        parameters = (phi_i, theta_i)[2 - len(self._nodes) :]
        places = (*parameters, *self._warp.invert(*on_map, parameters))
        scale = 1 / xp.maximum(wo.z, EPSILON)
        if self._jacobian:
            area = self._sigma.eval(on_theta(theta_i, xp), on_phi(phi_i, xp))
            scale = scale * self._ndf.eval(*on_map) / (4 * xp.maximum(area, EPSILON))
        return places, xp.select(wo.z > 0, scale, 0)

    def directions(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
        wi, m, cosine, _ = self._normals(*places)
        return wi, vector(2 * cosine * m.x - wi.x, 2 * cosine * m.y - wi.y, 2 * cosine * m.z - wi.z)

    def solid_angle(self, *places: np.ndarray) -> np.ndarray:
        """Return |∂ωo/∂(u1, u2)|."""
        _, _, cosine, around = self._normals(*places)
        return 4 * np.maximum(cosine, 0) * around

    def _normals(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace, np.ndarray, np.ndarray]:
        """Return ``(wi, h, wi·h, |∂ωh/∂(u1, u2)|)``."""
        *parameters, u1, u2 = places
        x, y, density = self._warp.sample(u1, u2, parameters)
        phi_i = parameters[0] if len(parameters) > 1 else np.zeros(())
        theta_m = np.square(x) * (np.pi / 2)
        wi = spherical(parameters[-1], phi_i)
        m = spherical(theta_m, (2 * y - 1) * np.pi + (phi_i if self._relative else 0))
        around = 2 * np.pi**2 * x * np.sin(theta_m) / np.maximum(density, FLOOR)
        return wi, m, wi.x * m.x + wi.y * m.y + wi.z * m.z, around


def on_theta(theta: Any, xp: SimpleNamespace) -> Any:
    """Return where a polar angle is on the maps."""
    return xp.sqrt(theta * (2 / np.pi))


def on_phi(phi: Any, xp: SimpleNamespace) -> Any:
    """Return where an azimuth is on the maps: π is at 0, as -π."""
    turned = phi * (1 / TWO_PI) + 0.5
    return xp.select(turned < 1, turned, 0)
