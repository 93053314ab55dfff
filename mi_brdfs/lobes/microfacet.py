"""Microfacet lobes."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import safe_sqrt
from ..microfacet.facet import Facet
from ..microfacet.shadowing import SmithGGX
from .lobe import Lobe


class MicrofacetLobe(Lobe):
    """f = ρ·F(cosθ_d)·D(h)·G / (4 cosθ_i cosθ_o), for any distribution, shadowing and Fresnel term of
    :mod:`mi_brdfs.microfacet`, drawn by one of its samplers. ρ is a ``colour`` times a ``scale``.
    """

    def __init__(self, colour, distribution, shadowing, fresnel, sampler, scale=1):
        self.colour, self.reflectance, self.distribution = colour, colour * scale, distribution
        self.shadowing, self.fresnel, self.sampler = shadowing, fresnel, sampler

    def albedo(self, wi):
        return self.reflectance * (self.fresnel(tilted(wi.z)) * self.distribution.albedo(wi.z))

    def eval_pdf(self, wi, wo):
        facet = Facet.between(wi, wo)
        facets = self.distribution.eval(facet) * self.shadowing(facet) / (4 * facet.cos_i)
        return self.reflectance * (self.fresnel(facet.cos_d) * facets), self.sampler.pdf(self, facet)

    def sample(self, wi, u, v):
        return self.sampler.sample(self, wi, u, v)

    def mirror_reflectance(self, wi):
        return self.colour * self.fresnel(wi.z)

    def over_facets(self, facet):
        """f cosθ_o·4cosθ_d/D for ρ = 1, as the one number that samplers go by: with D/q it makes the weight of a half
        vector of the density q."""
        return self.fresnel.brightness(facet.cos_d) * self.shadowing(facet) * facet.cos_d / facet.cos_i


class DimmedLobe(MicrofacetLobe):
    """A microfacet lobe which at grazing is dimmer than F(cosθ_i) and its distribution say: the facets seen there are
    tilted towards the viewer, and reflect less; and a shadowing term other than Smith's may take more."""

    def albedo(self, wi):
        alpha, tilt = dr.sqrt(self.distribution.roughness2()), 1 - wi.z
        cos = dr.sqrt(wi.z * wi.z + 0.45 * alpha * tilt * safe_sqrt(tilt))  # fitted to GGX
        z = dr.maximum(wi.z, 1e-4)  # the terms must not vanish
        seen = mi.Vector3f(wi.x, wi.y, z)
        mirror = Facet(seen, seen, mi.Vector3f(0, 0, 1), z)  # they do not tell wo from its opposite side
        shadowing = self.shadowing(mirror) / SmithGGX(alpha, alpha, correlated=False)(mirror)
        return self.reflectance * (self.fresnel(tilted(cos)) * (self.distribution.albedo(wi.z) * shadowing))


def tilted(cos):
    """A cosine that facets see, of one to the normal. None is 1: Schlick's reflectance with f0 = 0 must not vanish."""
    return dr.minimum(cos, 0.9)
