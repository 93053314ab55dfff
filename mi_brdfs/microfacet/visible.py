"""The half vectors of GGX that are visible from ``wi``."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import SMALL, safe_sqrt, sin_theta
from .facet import Facet
from .sampling import draw_linear, linear_density
from .terms import Distribution


class VisibleNormals:
    """The visible normals of GGX, bounded to those that can reflect above the horizon (Eto and Tokuyoshi 2023,
    doi:10.1145/3610543.3626163, after Dupuy and Benyoub 2023, doi:10.1111/cgf.14867), and tilted towards the normal.

    In the space stretched to α = 1 a normal is the half vector of ``wi`` and a point of a cap, the part -b <= z <= 1 of
    the sphere. Uniform points leave the weight rising with z, as grazing reflections are shadowed; a density
    ∝ 1 - l + 2 l v in the height v = (z + b)/(1 + b) makes up for it, with l = ¾ min(1, α). Images are mirrored about
    the axis of the cap.
    """

    BIAS = 0.75
    """l/α, fitted by tests/calibration/half_vectors.py."""

    def __init__(self, distribution: Distribution, wi: mi.Vector3f) -> None:
        self.distribution, self.wi = distribution, wi
        stretched = mi.Vector3f(distribution.alpha_u * wi.x, distribution.alpha_v * wi.y, wi.z)
        length = dr.sqrt(dr.dot(stretched, stretched))
        self.unit = stretched * dr.rcp(length)
        alpha = dr.minimum(dr.minimum(distribution.alpha_u, distribution.alpha_v), 1)
        s = 1 + sin_theta(wi)
        s2, a2 = s * s, alpha * alpha
        k = (1 - a2) * s2 / (s2 + a2 * wi.z * wi.z)
        self.b, self.bias = k * self.unit.z, self.BIAS * alpha
        self.scale = 0.5 / (k * wi.z + length)
        """The density of reflected directions over D, for uniform points."""

    def draw(self, v: mi.Point2f) -> tuple[Facet, Facet]:
        z = draw_linear(-self.bias, v.y) * (1 + self.b) - self.b
        sin = safe_sqrt(1 - z * z)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.x)
        sum = self.unit + mi.Vector3f(sin * cos_phi, sin * sin_phi, z)
        return self._facet(sum), self._facet(self._mirrored(sum))

    def pdf(self, facet: Facet) -> mi.Float:
        height = dr.maximum(self._sum(facet).z - self.unit.z + self.b, 0) * dr.rcp(1 + self.b)
        return self.distribution.eval(facet) * self.scale * linear_density(-self.bias, height)

    def image(self, facet: Facet) -> Facet:
        return self._facet(self._mirrored(self._sum(facet)))

    def weight(self, facet: Facet) -> float:
        return 1

    def _sum(self, facet: Facet) -> mi.Vector3f:
        """Return the sum of the stretched ``wi`` and the point, both of length one."""
        normal = self.distribution.unstretched(facet)
        return normal * (2 * dr.dot(self.unit, normal) * dr.rcp(dr.dot(normal, normal)))

    def _mirrored(self, sum: mi.Vector3f) -> mi.Vector3f:
        """Return that sum for the point's image."""
        return mi.Vector3f(2 * self.unit.x - sum.x, 2 * self.unit.y - sum.y, sum.z)

    def _facet(self, sum: mi.Vector3f) -> Facet:
        """Return the facet of that sum."""
        z = dr.maximum(sum.z, SMALL)  # the sum vanishes at the end of a cap that is nearly the whole sphere
        h = mi.Vector3f(self.distribution.alpha_u * sum.x, self.distribution.alpha_v * sum.y, z)
        inverse, cos = dr.rcp(dr.dot(h, h)), dr.dot(self.wi, h)
        scale = dr.sqrt(inverse)
        return Facet(self.wi, dr.fma(h, 2 * cos * inverse, -self.wi), h * scale, cos * scale)
