"""The density from which a table's directions are drawn."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import choose, select, unit
from ..measured.arrays import DRJIT, stacked, vector
from ..measured.coordinates import TWO_PI, polar_angle, spherical, wrapped
from ..measured.grid import Extrapolation, Grid, Interpolation

COSINE_SHARE = 0.02
"""The share of directions drawn in proportion to the cosine, wherever the table is zero or coarser than its nodes."""
NODES_I = np.radians([*np.linspace(0, 80, 49), *range(81, 90)])
"""The angles θi at which the density is tabulated, and between which it is interpolated: all multiples of 5°, to which
goniometers are set, and close enough in between, because highlights from scattered samples are sharp at these alone."""
AZIMUTHS_I = np.linspace(0, TWO_PI, 37)
NODES_I_ANISOTROPIC = NODES_I[::3]
"""The azimuths φi and the angles θi at which that of an anisotropic table is."""
NODES_U, NODES_V = 129, 65


class Proposal:
    """A density tabulated over the half vector, for angles θi, and φi where the table is anisotropic.

    Over (u, v) in the unit square with θh = π/2 u² and φh - φi = 2π v, it is in proportion to

        f cosθo |∂ωo/∂(u, v)| ∝ f cosθo 4 (wi·h) sinθh u

    at the nodes, with f the mean of the channels' values or their luminance; between nodes it is bilinear, and linear
    in θi and φi. An isotropic one is the mean of both sides of the plane of incidence, |φh - φi| = π v: half of the
    memory pays for the many θi. Mitsuba's ``MarginalContinuous2D`` draws from it exactly and returns its density.
    """

    def __init__(self, brightness: Grid, interpolation: Interpolation, extrapolate: Extrapolation) -> None:
        self.anisotropic = brightness.anisotropic
        thetas = NODES_I_ANISOTROPIC if self.anisotropic else NODES_I
        phis = AZIMUTHS_I[:-1] if self.anisotropic else np.zeros(1)
        density = _tabulated(brightness, phis, thetas, interpolation, extrapolate)
        if self.anisotropic:
            self.warp = mi.MarginalContinuous2D2(np.concatenate([density, density[:1]]), [AZIMUTHS_I, thetas])
        else:
            folded = (density + density[..., ::-1])[0, ..., : NODES_V // 2 + 1]
            self.warp = mi.MarginalContinuous2D1(folded, [thetas])

    def pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Float:
        """Return the density of :meth:`sample` per solid angle of wo."""
        x, y, z = wi.x + wo.x, wi.y + wo.y, wi.z + wo.z
        across = DRJIT.sqrt(x * x + y * y)
        u = DRJIT.sqrt(DRJIT.atan2(across, z) * (2 / dr.pi))
        cos_phi, sin_phi = unit(wi.x, wi.y)
        turn = DRJIT.atan2(y * cos_phi - x * sin_phi, x * cos_phi + y * sin_phi) * dr.inv_two_pi
        v = turn - dr.floor(turn) if self.anisotropic else 2 * abs(turn)
        # As in half_vectors, where 4 (wi·h) sinθh = 2 |(x, y)|.
        solid_angle = 4 * dr.square(dr.pi) * u * across
        table = self.warp.eval(mi.Point2f(v, u), self._given(wi)) / dr.maximum(solid_angle, 1e-12)
        return (1 - COSINE_SHARE) * table + COSINE_SHARE * dr.inv_pi * wo.z

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        """Draw a direction wo."""
        cosine, side = choose(u, COSINE_SHARE)
        disk = mi.warp.square_to_cosine_hemisphere(v)
        place, _ = self.warp.sample(v, self._given(wi))
        turn = place.x if self.anisotropic else place.x * dr.select(side < 0.5, 0.5, -0.5)
        (sin, cos), (y, x) = dr.sincos(dr.square(place.y) * (dr.pi / 2)), dr.sincos(turn * dr.two_pi)
        cos_phi, sin_phi = unit(wi.x, wi.y)
        h = mi.Vector3f(sin * (x * cos_phi - y * sin_phi), sin * (y * cos_phi + x * sin_phi), cos)
        return select(cosine, disk, 2 * dr.dot(wi, h) * h - wi)

    def _given(self, wi: mi.Vector3f) -> list[mi.Float]:
        """Return the parameters of the slice for wi."""
        theta = polar_angle(wi, DRJIT)
        return [wrapped(DRJIT.atan2(wi.y, wi.x), TWO_PI, DRJIT), theta] if self.anisotropic else [theta]


def _tabulated(
    brightness: Grid, phis: np.ndarray, thetas: np.ndarray, interpolation: Interpolation, extrapolate: Extrapolation
) -> np.ndarray:
    """Return the density at the nodes, not normalized: shape (azimuths, angles θi, u, v). Where the table is dark, it
    is in proportion to the cosine."""
    u, v = np.meshgrid(np.linspace(0, 1, NODES_U), np.linspace(0, 1, NODES_V), indexing="ij")
    density = np.empty((len(phis), len(thetas), *u.shape), np.float32)
    for j, phi in enumerate(phis):
        for k, theta in enumerate(thetas):
            wi, wo, solid_angle = half_vectors(theta, phi, u, v)
            f = brightness.evaluate(wi, wo, interpolation, extrapolate)[..., 0]
            cosine = np.maximum(wo[..., 2], 0) * solid_angle
            density[j, k] = f * cosine if np.any(f * cosine > 0) else cosine
    return density


def half_vectors(theta: float, phi: float, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ``(wi, wo, |∂ωo/∂(u, v)|)`` for θi, φi, and places in the unit square with θh = π/2 u² and
    φh - φi = 2π v. The one wi has the shape (3,); wo may lie below the horizon."""
    wi, h = spherical(theta, phi), spherical(np.square(u) * (np.pi / 2), phi + TWO_PI * v)
    cos = wi.x * h.x + wi.y * h.y + wi.z * h.z
    wo = stacked(vector(2 * cos * h.x - wi.x, 2 * cos * h.y - wi.y, 2 * cos * h.z - wi.z))
    # dωo = 4 (wi·h) sinθh dθh dφh, with dθh = π u du and dφh = 2π dv.
    solid_angle = 4 * np.maximum(cos, 0) * np.hypot(h.x, h.y) * 2 * np.pi**2 * u
    return stacked(wi), wo, solid_angle
