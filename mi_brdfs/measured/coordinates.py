"""Coordinates of pairs of directions, in which tables are regular grids.

Directions are unit vectors of the local frame (n = z) that point away from the surface. ``wi`` is the one that a file
calls incident, and Mitsuba's ``wi``, as in Mitsuba's ``measured``. All angles are in radians.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from .arrays import NUMPY, vector

TWO_PI = 2 * np.pi


class Coordinates:
    """Where pairs of directions lie on the axes of a grid; by itself, for what depends on no direction."""

    names: tuple[str, ...] = ()
    """The axes, in the order of the array's."""
    poles: tuple[tuple[int, int], ...] = ()
    """Pairs of axes, of a polar angle and of an azimuth that means nothing where that is 0."""
    reciprocal = False
    """Whether exchanging the two directions changes nothing."""
    anisotropic = False
    """Whether turning both directions about the normal changes the place."""
    mirrored = False
    """Whether mirroring both directions at a plane through the normal changes nothing."""

    def locate(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[Any, ...]:
        """Return the value on each axis for directions by component, x, y and z, of NumPy arrays or Dr.Jit floats;
        ``xp`` has the functions of the one or the other (:mod:`mi_brdfs.measured.arrays`)."""
        return ()

    def locate_scaled(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[tuple[Any, ...], Any]:
        """Return ``(places, scale)``: the values on the axes, and by what the grid's values are multiplied to be f,
        which is 1 unless a table is adaptive."""
        return self.locate(wi, wo, xp), 1

    def prepared(self) -> Coordinates:
        """Return these coordinates with what kernels of the active variant read, which is then ``captured``."""
        return self

    @property
    def captured(self) -> list[Any]:
        return []

    def directions(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
        """Return ``(wi, wo)``, by component, for values on the axes: one of the pairs that lie there."""
        raise NotImplementedError


class HalfDifference(Coordinates):
    """Rusinkiewicz's coordinates (1998), of the half vector h and of the difference vector d, which is wi turned with h
    to the pole: ``(√(2θh/π), θd, φd)``, and φh behind them if ``anisotropic``.

    S. M. Rusinkiewicz, A new change of variables for efficient BRDF representation, Eurographics Workshop on Rendering
    1998, doi:10.1007/978-3-7091-6453-2_2. The root is MERL's (Matusik et al. 2003): it spends half of the nodes on the
    innermost quarter of θh.

    φd lies in [0, π) if reciprocal, where d and -d are the same, and in [0, 2π) otherwise.
    """

    def __init__(self, reciprocal: bool = True, anisotropic: bool = False) -> None:
        self.reciprocal, self.anisotropic = reciprocal, anisotropic
        self.poles = () if anisotropic else ((0, 2), (1, 2))
        self.names = ("sqrt_theta_h", "theta_d", "phi_d", *(("phi_h",) if anisotropic else ()))

    def locate(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[Any, ...]:
        sx, sy, sz = wi.x + wo.x, wi.y + wo.y, wi.z + wo.z
        dx, dy, dz = wi.x - wo.x, wi.y - wo.y, wi.z - wo.z
        across = xp.sqrt(sx * sx + sy * sy)
        length = xp.sqrt(across * across + sz * sz)
        theta_h = xp.atan2(across, sz)
        theta_d = xp.atan2(xp.sqrt(dx * dx + dy * dy + dz * dz), length)
        # d on the unit vectors towards growing θh and φh, both times |s|.
        cos_phi, sin_phi = azimuth_of(vector(sx, sy, sz), xp)
        polar = (dx * cos_phi + dy * sin_phi) * sz - dz * across
        azimuthal = (dy * cos_phi - dx * sin_phi) * length
        phi_d = wrapped(xp.atan2(azimuthal, polar), np.pi if self.reciprocal else TWO_PI, xp)
        place = xp.sqrt(theta_h * (2 / np.pi)), theta_d, phi_d
        return (*place, wrapped(xp.atan2(sin_phi, cos_phi), TWO_PI, xp)) if self.anisotropic else place

    def directions(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
        root, theta_d, phi_d, *phi_h = places
        theta_h = np.square(root) * (np.pi / 2)
        d = spherical(theta_d, phi_d)
        pair = (tilted(vector(side * d.x, side * d.y, d.z), theta_h) for side in (1, -1))
        wi, wo = (turned_about_normal(w, phi_h[0]) for w in pair) if phi_h else pair
        return wi, wo


class Spherical(Coordinates):
    """Polar angles ``(θi, θo, Δφ)`` with Δφ = φo - φi, and φi behind them if ``anisotropic``.

    Δφ lies in [0, π] if ``mirrored``, where Δφ and -Δφ are the same, and in [0, 2π) otherwise; φi in [0, 2π).
    """

    def __init__(self, mirrored: bool, anisotropic: bool = False) -> None:
        self.mirrored, self.anisotropic = mirrored, anisotropic
        self.poles = () if anisotropic else ((0, 2), (1, 2))
        self.names = ("theta_i", "theta_o", "delta_phi", *(("phi_i",) if anisotropic else ()))

    def locate(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[Any, ...]:
        cos_phi, sin_phi = azimuth_of(wi, xp)
        delta = xp.atan2(wo.y * cos_phi - wo.x * sin_phi, wo.x * cos_phi + wo.y * sin_phi)
        delta = abs(delta) if self.mirrored else wrapped(delta, TWO_PI, xp)
        place = polar_angle(wi, xp), polar_angle(wo, xp), delta
        return (*place, wrapped(xp.atan2(sin_phi, cos_phi), TWO_PI, xp)) if self.anisotropic else place

    def directions(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
        theta_i, theta_o, delta, *phi_i = places
        phi = phi_i[0] if phi_i else np.zeros(())
        return spherical(theta_i, phi), spherical(theta_o, phi + delta)


class SpecularPolar(Coordinates):
    """Polar angles about the mirror direction r of wi, ``(θi, azimuth, radial)``, and the azimuth of wi behind them if
    ``anisotropic``: goniometers' files write them, because highlights stay in place when wi moves.

    ``radial`` is the angle between wo and r. ``azimuth``, the angle about r, is 0 where wo lies from r towards the
    normal and beyond, and a quarter of a turn counter-clockwise about r from there; it lies in [0, π] if ``mirrored``
    and in [0, 2π) otherwise.
    """

    def __init__(self, mirrored: bool, anisotropic: bool = False) -> None:
        self.mirrored, self.anisotropic = mirrored, anisotropic
        self.poles = ((2, 1),) if anisotropic else ((0, 1), (2, 1))
        self.names = ("theta_i", "azimuth", "radial", *(("phi_i",) if anisotropic else ()))

    def locate(self, wi: Any, wo: Any, xp: SimpleNamespace) -> tuple[Any, ...]:
        sin = xp.sqrt(wi.x * wi.x + wi.y * wi.y)
        cos_phi, sin_phi = azimuth_of(wi, xp)
        # wo in the frame whose x axis lies below wi, then turned so that the mirror direction is the pole.
        x, y = wo.x * cos_phi + wo.y * sin_phi, wo.y * cos_phi - wo.x * sin_phi
        towards, along = x * wi.z + wo.z * sin, wo.z * wi.z - x * sin
        azimuth = xp.atan2(y, towards)
        azimuth = abs(azimuth) if self.mirrored else wrapped(azimuth, TWO_PI, xp)
        radial = xp.atan2(xp.sqrt(towards * towards + y * y), along)
        place = polar_angle(wi, xp), azimuth, radial
        return (*place, wrapped(xp.atan2(sin_phi, cos_phi), TWO_PI, xp)) if self.anisotropic else place

    def directions(self, *places: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
        theta_i, azimuth, radial, *phi_i = places
        wo, phi = tilted(spherical(radial, azimuth), -theta_i), phi_i[0] if phi_i else np.zeros(())
        return spherical(theta_i, phi), turned_about_normal(wo, phi)


def polar_angle(w: Any, xp: SimpleNamespace = NUMPY) -> Any:
    """Return the angle from the normal, with the digits that the arc cosine loses near it."""
    return xp.atan2(xp.sqrt(w.x * w.x + w.y * w.y), w.z)


def azimuth_of(w: Any, xp: SimpleNamespace = NUMPY) -> tuple[Any, Any]:
    """Return the cosine and the sine of the azimuth, which is 0 at the normal."""
    sin = xp.sqrt(w.x * w.x + w.y * w.y)
    upright = sin > 1e-7
    sin = xp.select(upright, sin, 1)
    return xp.select(upright, w.x / sin, 1), xp.select(upright, w.y / sin, 0)


def wrapped(angle: Any, period: float, xp: SimpleNamespace = NUMPY) -> Any:
    """Return an angle in [0, period)."""
    turned = angle - period * xp.floor(angle * (1 / period))
    return xp.select(turned < period, turned, 0)


def spherical(theta: Any, phi: Any) -> SimpleNamespace:
    """Return the unit vectors of polar angles θ and azimuths φ, NumPy arrays."""
    return vector(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi)


def tilted(w: SimpleNamespace, theta: Any) -> SimpleNamespace:
    """Return directions turned about y, by which the normal comes to the polar angle θ towards x."""
    cos, sin = np.cos(theta), np.sin(theta)
    return vector(w.x * cos + w.z * sin, w.y + 0 * theta, w.z * cos - w.x * sin)


def turned_about_normal(w: SimpleNamespace, phi: Any) -> SimpleNamespace:
    return vector(w.x * np.cos(phi) - w.y * np.sin(phi), w.x * np.sin(phi) + w.y * np.cos(phi), w.z + 0 * phi)
