"""Samplers of microfacet lobes by normals visible from ``wi``, for GGX and similar distributions."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, safe_sqrt, select, sin_theta
from .distributions import Distribution
from .facet import Facet
from .sampling import FacetLobe, Sampler, draw_linear, linear_density, reflected


class Cap:
    """The mirror images of ``wi`` at the visible normals, in the space stretched to α = 1: the part -b <= z <= 1 of the
    sphere, without most of what would be reflected below the horizon. Uniform points leave the weight rising with z, as
    grazing reflections are shadowed; a density ∝ 1 - l + 2 l v in the height v = (z + b)/(1 + b) makes up for it, with
    l = ¾ min(1, α)."""

    BIAS = 0.75
    """l/α, fitted by tests/calibration/visible_normals.py."""

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

    def draw(self, v: mi.Point2f) -> mi.Vector3f:
        """Draw a point, and return its normal: the sum of it and the stretched ``wi``, both of length one."""
        z = draw_linear(-self.bias, v.y) * (1 + self.b) - self.b
        sin = safe_sqrt(1 - z * z)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.x)
        return self.unit + mi.Vector3f(sin * cos_phi, sin * sin_phi, z)

    def normal(self, facet: Facet) -> mi.Vector3f:
        """Return that sum for a facet."""
        normal = self.distribution.unstretched(facet)
        return normal * (2 * dr.dot(self.unit, normal) * dr.rcp(dr.dot(normal, normal)))

    def image(self, normal: mi.Vector3f) -> mi.Vector3f:
        """Return the normal of the point's mirror image about the axis of the cap."""
        return mi.Vector3f(2 * self.unit.x - normal.x, 2 * self.unit.y - normal.y, normal.z)

    def facet(self, normal: mi.Vector3f) -> Facet:
        """Return the facet of a normal."""
        z = dr.maximum(normal.z, SMALL)  # the normal vanishes at the end of a cap that is nearly the whole sphere
        h = mi.Vector3f(self.distribution.alpha_u * normal.x, self.distribution.alpha_v * normal.y, z)
        inverse, cos = dr.rcp(dr.dot(h, h)), dr.dot(self.wi, h)
        scale = dr.sqrt(inverse)
        return Facet(self.wi, dr.fma(h, 2 * cos * inverse, -self.wi), h * scale, cos * scale)

    def density(self, facet: Facet, normal: mi.Vector3f) -> mi.Float:
        """Return the density of the direction that a facet reflects, given its normal."""
        height = dr.maximum(normal.z - self.unit.z + self.b, 0) * dr.rcp(1 + self.b)
        return self.distribution.eval(facet) * self.scale * linear_density(-self.bias, height)


class BoundedVisibleNormals(Sampler):
    """The visible normals of GGX, bounded to those that can reflect above the horizon (Eto and Tokuyoshi 2023,
    doi:10.1145/3610543.3626163, after Dupuy and Benyoub 2023, doi:10.1111/cgf.14867), and tilted towards the normal: in
    the space stretched to α = 1 a normal is the half vector of wi and a point of a spherical :class:`Cap`."""

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        cap = Cap(lobe.distribution, wi)
        return cap.facet(cap.draw(v)).wo

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        cap = Cap(lobe.distribution, facet.wi)
        return cap.density(facet, cap.normal(facet))


class AntitheticVisibleNormals(Sampler):
    """Draw two such normals, whose points in the cap are mirror images about its axis, and choose one in proportion to
    how much each reflects: where the Fresnel term, or the shadowing, is larger for one, it is smaller for the other. As
    both points have the same density in the cap, the chosen direction has the density 2 p W/(W + W') and the weight
    (W + W')/2, where p and W ∝ F G are those of a single draw.

    Kernels with a :meth:`complete` that hands on the pair's weights were slower: what it saves is less than waiting for
    the directions of other lobes costs."""

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        cap = Cap(lobe.distribution, wi)
        normal = cap.draw(v)
        facet, image = cap.facet(normal), cap.facet(cap.image(normal))
        weight, other = self._weight(reflected(lobe, facet)), self._weight(reflected(lobe, image))
        return select(u * (weight + other) < weight, facet.wo, image.wo)

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        cap = Cap(lobe.distribution, facet.wi)
        normal = cap.normal(facet)
        weight = self._weight(lobe.shadowed(facet))  # as in AntitheticNormals
        other = self._weight(reflected(lobe, cap.facet(cap.image(normal))))
        return 2 * cap.density(facet, normal) * (weight / (weight + other))

    @staticmethod
    def _weight(reflected: mi.Float) -> mi.Float:
        return dr.maximum(reflected, EPSILON)
