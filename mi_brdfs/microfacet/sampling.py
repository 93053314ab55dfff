"""Samplers of microfacet lobes. Each draws a direction for ``wi`` and answers the density that it draws it with."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import clamp, normalize_or, safe_sqrt
from .facet import Facet


class Orbit:
    r"""Draws a half vector from the distribution's own density q, clipped to what can reflect above the horizon, and
    then one of its images with probability ∝ what they reflect. Exact for any shadowing and Fresnel term.

    A half vector is a point (ψ, u) of the unit square: an azimuth, and a fraction u of the mass on that line within
    |tanθ_h| <= R(ψ), beyond which neither end of the line reflects ``wi`` above the horizon. Opposite points of a line
    (2 images), and with them a quarter turn of ψ and u → 1 - u (8 images), map the uniform measure of that square to
    itself. With W = f cosθ_o · 4 cosθ_d · C(R)/q of an image and W̄ the mean over its orbit, choosing an image ∝ W
    gives the density f cosθ_o / W̄ and the weight W̄. (Two images, unclipped, would be the V-cavity sampler of Heitz
    and d'Eon 2014, doi:10.1111/cgf.12417, with W in place of its visibility.)
    """

    def __init__(self, images: int):
        self.lines = {2: 1, 8: 2}[images]

    def _line(self, distribution, wi, cos_psi, sin_psi):
        """``(x, y, g, C(R), 1 - C(R))`` of the line of azimuth ψ, of unit slope direction (x, y)."""
        x, y = distribution.alpha_u * cos_psi, distribution.alpha_v * sin_psi
        scale = dr.rsqrt(x * x + y * y)
        x, y = x * scale, y * scale
        along = abs(x * wi.x + y * wi.y)
        limit = (along + dr.sqrt(along * along + wi.z * wi.z)) / wi.z
        g = scale * scale
        return x, y, g, *distribution.cdf(limit * limit, g)

    def _orbit(self, lobe, wi, cos_psi, sin_psi, u, complement):
        """The images of a half vector and their weights W: ``[(facet, W), …]``, itself among the first two."""
        images = []
        for _ in range(self.lines):
            x, y, g, mass, rest = self._line(lobe.distribution, wi, cos_psi, sin_psi)
            fractions = [(u, complement), (complement, u)] if self.lines == 2 else [(u, complement)]
            for inner, outer in fractions:
                tan2 = lobe.distribution.inverse_cdf(inner * mass, rest + outer * mass, g)
                scale, tan = mass * lobe.distribution.over_density(tan2, g), safe_sqrt(tan2)
                for side in (tan, -tan):
                    facet = Facet.at(wi, side * x, side * y)
                    images.append((facet, scale * self._reflected(lobe, facet)))
            cos_psi, sin_psi = -sin_psi, cos_psi
        return images

    @staticmethod
    def _reflected(lobe, facet):
        valid = (facet.cos_d > 0) & (facet.cos_o > 0)
        # Elsewhere the formulas need not make sense: give them the mirror direction.
        facet = Facet(
            facet.wi,
            dr.select(valid, facet.wo, mi.Vector3f(0, 0, 1)),
            dr.select(valid, facet.h, mi.Vector3f(0, 0, 1)),
            dr.select(valid, facet.cos_d, 1),
        )
        return dr.select(valid, lobe.over_facets(facet), 0)

    def sample(self, lobe, wi, u, v):
        sin_psi, cos_psi = dr.sincos(dr.two_pi * v.x)
        images = self._orbit(lobe, wi, cos_psi, sin_psi, v.y, 1 - v.y)
        threshold = u * sum(weight for _, weight in images)
        wo = images[0][0].wo
        for facet, weight in images:
            wo = dr.select(threshold >= 0, facet.wo, wo)
            threshold -= weight
        return wo

    def pdf(self, lobe, facet):
        distribution = lobe.distribution
        cos_psi, sin_psi = normalize_or(facet.h.x / distribution.alpha_u, facet.h.y / distribution.alpha_v, (1, 0))
        _, _, g, mass, rest = self._line(distribution, facet.wi, cos_psi, sin_psi)
        c, complement = distribution.cdf(facet.sin2_h / dr.square(facet.cos_h), g)
        u, v = clamp(c / mass, 0, 1), clamp((complement - rest) / mass, 0, 1)
        images = self._orbit(lobe, facet.wi, cos_psi, sin_psi, u, v)
        mean = sum(weight for _, weight in images) / len(images)
        valid = mean > 0
        return dr.select(valid, lobe.response(facet) / dr.select(valid, mean, 1), 0)


class BoundedVisibleNormals:
    """The visible normals of GGX, bounded to those that can reflect above the horizon (Eto and Tokuyoshi 2023,
    doi:10.1145/3610543.3626163, after Dupuy and Benyoub 2023, doi:10.1111/cgf.14867), and tilted towards the normal.

    In the space stretched to α = 1 a normal is the half vector of wi and a point of a spherical cap -b <= z <= 1.
    Uniform points leave the weight rising with z, as grazing reflections are shadowed; a density ∝ 1 - l + 2 l v in
    the height v = (z + b)/(1 + b) makes up for it. l = ¾ min(1, α) was chosen by measurement.
    """

    TILT = 0.75

    def _cap(self, distribution, wi):
        """``(stretched wi, its unit vector, k, b, l)``"""
        alpha_u, alpha_v = distribution.alpha_u, distribution.alpha_v
        stretched = mi.Vector3f(alpha_u * wi.x, alpha_v * wi.y, wi.z)
        length = dr.sqrt(dr.dot(stretched, stretched))
        alpha = dr.minimum(dr.minimum(alpha_u, alpha_v), 1)
        s = 1 + dr.sqrt(wi.x * wi.x + wi.y * wi.y)
        s2, a2 = s * s, alpha * alpha
        k = (1 - a2) * s2 / (s2 + a2 * wi.z * wi.z)
        return stretched / length, length, k, k * wi.z / length, self.TILT * alpha

    def sample(self, lobe, wi, u, v):
        distribution = lobe.distribution
        unit, _, _, b, tilt = self._cap(distribution, wi)
        # The inverse of the linear density; the small tilt of narrow lobes must not cancel.
        height = 2 * v.y / (1 - tilt + dr.sqrt(dr.square(1 - tilt) + 4 * tilt * v.y))
        z = height * (1 + b) - b
        sin = safe_sqrt(1 - z * z)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.x)
        normal = unit + mi.Vector3f(sin * cos_phi, sin * sin_phi, z)
        h = mi.Vector3f(distribution.alpha_u * normal.x, distribution.alpha_v * normal.y, normal.z)
        return h * (2 * dr.dot(wi, h) / dr.dot(h, h)) - wi

    def pdf(self, lobe, facet):
        distribution = lobe.distribution
        unit, length, k, b, tilt = self._cap(distribution, facet.wi)
        normal = mi.Vector3f(facet.h.x / distribution.alpha_u, facet.h.y / distribution.alpha_v, facet.cos_h)
        z = 2 * dr.dot(unit, normal) * normal.z / dr.dot(normal, normal) - unit.z
        height = dr.maximum(z + b, 0) / (1 + b)
        uniform = distribution.eval(facet) / (2 * (k * facet.cos_i + length))
        return uniform * (1 - tilt + 2 * tilt * height)
