"""Microfacet lobes."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import normalize_or, safe_sqrt
from ..microfacet.facet import Facet
from .lobe import Lobe


class MicrofacetLobe(Lobe):
    """f = ρ·F(cosθ_d)·D(h)·G / (4 cosθ_i cosθ_o), for any distribution, shadowing and Fresnel term of
    :mod:`mi_brdfs.microfacet`, drawn by one of its samplers. ρ is a ``colour`` times a ``scale``.
    """

    def __init__(self, colour, distribution, shadowing, fresnel, sampler, scale=1):
        self.colour, self.reflectance, self.distribution = colour, colour * scale, distribution
        self.shadowing, self.fresnel, self.sampler = shadowing, fresnel, sampler

    def estimated_albedo(self, wi):
        return self.reflectance * (self.fresnel(facing_cosine(wi.z)) * self.distribution.estimated_albedo(wi.z))

    def eval_pdf(self, wi, wo):
        facet = Facet.between(wi, wo)
        facets = self.distribution.eval(facet) * self.shadowing(facet) / (4 * facet.cos_i)
        return self.reflectance * (self.fresnel(facet.cos_d) * facets), self.sampler.pdf(self, facet)

    def sample(self, wi, u, v):
        return self.sampler.sample(self, wi, u, v)

    def mirror_reflectance(self, wi):
        return self.colour * self.fresnel(wi.z)

    def weight_over_ndf(self, facet):
        """f cosθ_o·4cosθ_d/D for ρ = 1, as the one number that samplers go by: with D/q it makes the weight of a half
        vector of the density q."""
        return self.fresnel.brightness(facet.cos_d) * self.shadowing(facet) * facet.cos_d / facet.cos_i


class DimmedLobe(MicrofacetLobe):
    """A lobe with Smith's shadowing term. At grazing it is dimmer than F(cosθ_i) says: the facets seen there are tilted
    towards the viewer, and reflect less."""

    def estimated_albedo(self, wi):
        sin2, versine = dr.maximum(wi.x * wi.x + wi.y * wi.y, 1e-12), 1 - wi.z
        alpha2 = self.distribution.mean_square_slope_along(wi) / sin2
        cos = dr.sqrt(wi.z * wi.z + 0.45 * versine * safe_sqrt(versine * alpha2))  # fitted to GGX
        return self.reflectance * (self.fresnel(facing_cosine(cos)) * self.distribution.estimated_albedo(wi.z))


class TypicalFacetLobe(MicrofacetLobe):
    """A lobe with any shadowing term. Its albedo is estimated from a typical facet in the plane of incidence that leans
    towards ``wi``, and its image: their cosθ_d add up to 2 cosθ_h cosθ_i, until at grazing only the first one is
    seen."""

    def estimated_albedo(self, wi):
        x, y = normalize_or(wi.x, wi.y, (1, 0))
        z, versine = dr.maximum(wi.z, 1e-4), 1 - wi.z  # the terms must not vanish
        slope2 = self.distribution.mean_square_slope_along(mi.Vector3f(x, y, 0))
        # The constants are fitted to Beckmann and GGX.
        typical2 = 0.72 * slope2 / (1 + 0.3 * slope2)
        slope = typical2 * dr.rsqrt(typical2 + z * z)  # the mirror is typical of what is narrow
        facet = Facet.at(mi.Vector3f(wi.x, wi.y, z), slope * x, slope * y)
        seen = self.shadowing(facet) * dr.maximum(0.5 * facet.cos_d / z, facet.cos_h)
        cos = dr.sqrt(z * z + 0.28 * versine * safe_sqrt(versine * slope2))
        return self.reflectance * (self.fresnel(facing_cosine(cos)) * seen)


def facing_cosine(cos):
    """A cosine that facets see, of one to the normal. None is 1: Schlick's reflectance with f0 = 0 must not vanish."""
    return dr.minimum(cos, 0.9)
