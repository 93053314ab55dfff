"""Forward reflection at grazing, for the dielectrics that hardly reflect elsewhere."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, safe_sqrt, sin_theta, unit
from .facet import Facet
from .terms import Distribution


class ForwardDirections:
    """Directions about the horizon opposite to ``wi``, where a dielectric of nearly the same index on both sides
    reflects by far the most.

    Where both directions are low, with the cosines z and z' and the azimuth δ from the plane of incidence, cosθ_d² is
    about ((z + z')² + δ²)/4. z'/(z + z') is uniform. tan(δ/2) has a density ∝ (σ² + (tan(δ/2) - m)²)^(-3/2): m is where
    the half vector lies on the ridge of anisotropic facets, and σ is (z + z')/2, limited by how far the facets reach
    across. Where the indices differ more, z² is larger in σ, by |η² - 1|.
    """

    # Fitted by tests/calibration/half_vectors.py.
    TYPICAL = 0.6
    """Which part of the facets is less steep along ``wi`` than those that count."""
    INDISTINCT = 0.016
    """The reflectance at normal incidence below which dielectrics need a share of these directions."""
    LARGEST = 0.6
    """The share where they need it most."""

    def __init__(
        self, fresnel: Any, wi: mi.Vector3f, fraction: mi.Float, cos2: mi.Float, slopes2: Any = (1e6, 1e6)
    ) -> None:
        """For what ``fraction`` of the lobe lies there if F = 1, the square of the cosθ_d that is typical of the rest,
        and the squares of typical slopes along u and v."""
        self.z, self.sin = dr.maximum(wi.z, 1e-3), sin_theta(wi)  # cosines divide
        z2 = self.z * self.z
        self.broad = dr.sqrt(z2 + abs(fresnel.eta * fresnel.eta - 1))
        self.x, self.y = x, y = unit(wi.x, wi.y)
        u, v = (dr.rcp(slope2) for slope2 in slopes2)
        self.across = x * x * v + y * y * u
        self.ridge = x * y * (u - v) / (1 + self.across)

        # Of narrow lobes only the last directions before the horizon, with cosθ_d² = (1 - sinθ_i)/2, are like that.
        last = fresnel(self.z * dr.rsqrt(2 + 2 * self.sin))
        near = dr.lerp(fresnel(self.z), last, dr.square(dr.square(z2 / cos2)))
        distinct = dr.square((fresnel.eta - 1) / (fresnel.eta + 1)) / self.INDISTINCT
        self.reflectance = fraction * near / (1 + dr.square(dr.square(distinct)))
        """What these directions add to the mean reflectance of the others."""
        rest = dr.maximum(fresnel(dr.minimum(dr.sqrt(cos2), 1)), EPSILON)
        self.share = self.LARGEST * self.reflectance / (self.reflectance + rest)

    @classmethod
    def of_facets(cls, fresnel: Any, distribution: Distribution, wi: mi.Vector3f) -> ForwardDirections:
        x, y = unit(wi.x, wi.y)
        alphas2 = dr.square(distribution.alpha_u), dr.square(distribution.alpha_v)
        along = alphas2[0] * x * x + alphas2[1] * y * y
        slope2 = distribution.inverse_cdf(cls.TYPICAL, 1 - cls.TYPICAL, 1 / along)
        slopes2 = [alpha2 * (slope2 / along) for alpha2 in alphas2]
        z2 = dr.square(dr.maximum(wi.z, 1e-3))
        cos2 = z2 + slope2 / (1 + dr.maximum(*slopes2))
        low = dr.minimum(z2 / cos2, 1)  # a GPU's quotients are rounded up, too
        return cls(fresnel, wi, dr.sqrt(low) * (1 - low), cos2, slopes2)

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        z = self.z * v.x / (self.z + (1 - v.x))
        sin = safe_sqrt(1 - z * z)
        m, sigma = self._azimuth(z, sin)
        uniform = 2 * v.y - 1
        tan = m + sigma * uniform / dr.maximum(safe_sqrt(1 - uniform * uniform), SMALL)
        cos2 = dr.rcp(1 + tan * tan)  # of δ/2
        sin_delta, cos_delta = 2 * tan * cos2, (1 - tan * tan) * cos2
        x, y = -cos_delta * self.x - sin_delta * self.y, sin_delta * self.x - cos_delta * self.y
        return mi.Vector3f(sin * x, sin * y, z)

    def pdf(self, facet: Facet) -> mi.Float:
        z = facet.wo.z
        x, y = unit(facet.wo.x, facet.wo.y)
        m, sigma = self._azimuth(z, safe_sqrt(1 - z * z))
        tan = (self.x * y - self.y * x) / dr.maximum(1 - (self.x * x + self.y * y), SMALL)
        inverse = dr.rsqrt(1 + dr.square((tan - m) / sigma))
        density_z = self.z * (1 + self.z) / dr.square(self.z + z)
        return density_z * 0.25 * (1 + tan * tan) / sigma * inverse * dr.square(inverse)

    def _azimuth(self, z: mi.Float, sin: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return ``(m, σ)`` of a z' = cosθ_o."""
        narrow, broad = 0.5 * (self.z + z), 0.5 * (self.broad + z)
        sigma = dr.rsqrt(self.across / dr.square(narrow) + 1 / dr.square(broad))
        difference = z * z - self.z * self.z
        root = safe_sqrt(sin * sin - dr.square(self.ridge) * difference)
        # Far from the horizon nothing is drawn: there sines need not vanish.
        return self.ridge * difference / (dr.maximum(self.sin + sin, 0.1) * dr.maximum(sin + root, 0.1)), sigma
