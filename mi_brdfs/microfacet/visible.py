"""Samplers of microfacet lobes by normals visible from ``wi``, for GGX and similar distributions."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import SMALL, safe_sqrt, select, sin_theta
from .distributions import Distribution
from .facet import Facet
from .sampling import FacetLobe, Sampler, draw_linear, linear_density, reflected, reflected_above


class BoundedVisibleNormals(Sampler):
    """The visible normals of GGX, bounded to those that can reflect above the horizon (Eto and Tokuyoshi 2023,
    doi:10.1145/3610543.3626163, after Dupuy and Benyoub 2023, doi:10.1111/cgf.14867), and tilted towards the normal.

    In the space stretched to α = 1 a normal is the half vector of wi and a point of a spherical cap -b <= z <= 1.
    Uniform points leave the weight rising with z, as grazing reflections are shadowed; a density ∝ 1 - l + 2 l v in
    the height v = (z + b)/(1 + b) makes up for it, with l = ¾ min(1, α).
    """

    BIAS = 0.75
    """l/α, fitted by tests/calibration/visible_normals.py."""

    def _cap(
        self, distribution: Distribution, wi: mi.Vector3f
    ) -> tuple[mi.Vector3f, mi.Float, mi.Float, mi.Float, mi.Float]:
        """Return ``(unit vector of the stretched wi, its length, k, b, l)``."""
        alpha_u, alpha_v = distribution.alpha_u, distribution.alpha_v
        stretched = mi.Vector3f(alpha_u * wi.x, alpha_v * wi.y, wi.z)
        length = dr.sqrt(dr.dot(stretched, stretched))
        alpha = dr.minimum(dr.minimum(alpha_u, alpha_v), 1)
        s = 1 + sin_theta(wi)
        s2, a2 = s * s, alpha * alpha
        k = (1 - a2) * s2 / (s2 + a2 * wi.z * wi.z)
        return stretched / length, length, k, k * wi.z / length, self.BIAS * alpha

    def _draw(self, distribution: Distribution, wi: mi.Vector3f, v: mi.Point2f) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Draw ``(unit vector of the stretched wi, point of the cap)``."""
        unit, _, _, b, bias = self._cap(distribution, wi)
        z = draw_linear(-bias, v.y) * (1 + b) - b
        sin = safe_sqrt(1 - z * z)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.x)
        return unit, mi.Vector3f(sin * cos_phi, sin * sin_phi, z)

    @staticmethod
    def _facet(distribution: Distribution, wi: mi.Vector3f, unit: mi.Vector3f, point: mi.Vector3f) -> Facet:
        """Return the facet whose stretched normal is the half vector of the unit vector and a point."""
        normal = unit + point
        z = dr.maximum(normal.z, SMALL)  # the normal vanishes at the end of a cap that is nearly the whole sphere
        h = mi.Vector3f(distribution.alpha_u * normal.x, distribution.alpha_v * normal.y, z)
        return Facet.reflecting(wi, h * dr.rsqrt(dr.dot(h, h)))

    def _density(self, distribution: Distribution, facet: Facet) -> tuple[mi.Float, mi.Vector3f, mi.Vector3f]:
        """Return ``(density, unit vector of the stretched wi, point of the cap)``."""
        unit, length, k, b, bias = self._cap(distribution, facet.wi)
        normal = mi.Vector3f(facet.h.x / distribution.alpha_u, facet.h.y / distribution.alpha_v, facet.cos_h)
        point = normal * (2 * dr.dot(unit, normal) / dr.dot(normal, normal)) - unit
        height = dr.maximum(point.z + b, 0) / (1 + b)
        uniform = distribution.eval(facet) / (2 * (k * facet.cos_i + length))
        return uniform * linear_density(-bias, height), unit, point

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self._facet(lobe.distribution, wi, *self._draw(lobe.distribution, wi, v)).wo

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        return self._density(lobe.distribution, facet)[0]


class AntitheticVisibleNormals(BoundedVisibleNormals):
    """Draw two such normals, whose points in the cap are mirror images about its axis, and choose one in proportion to
    how much each reflects: where the Fresnel term, or the shadowing, is larger for one, it is smaller for the other. As
    both points have the same density in the cap, the chosen direction has the density 2 p W/(W + W') and the weight
    (W + W')/2, where p and W are those of a single draw."""

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        unit, point = self._draw(lobe.distribution, wi, v)
        facet, image = (self._facet(lobe.distribution, wi, unit, w) for w in (point, self._image(point)))
        weight, other = self._weight(lobe, facet), self._weight(lobe, image)
        return select(u * (weight + other) < weight, facet.wo, image.wo)

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        density, unit, point = self._density(lobe.distribution, facet)
        image = self._facet(lobe.distribution, facet.wi, unit, self._image(point))
        weight = reflected_above(lobe, facet) / dr.maximum(facet.cos_d, SMALL)
        return 2 * density * (weight / (weight + self._weight(lobe, image)))

    @staticmethod
    def _image(point: mi.Vector3f) -> mi.Vector3f:
        return mi.Vector3f(-point.x, -point.y, point.z)

    @staticmethod
    def _weight(lobe: FacetLobe, facet: Facet) -> mi.Float:
        """Return f cosθ_o over the density, except for factors common to both."""
        return reflected(lobe, facet) / dr.maximum(facet.cos_d, SMALL)
