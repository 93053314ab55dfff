"""Shadowing and masking terms G: each is called with a :class:`~.facet.Facet`."""

from __future__ import annotations

import drjit as dr


class SmithGGX:
    """Smith's term for GGX facets of roughness (αu, αv), Λ(v) = ½(√(1 + ((αu v_x)² + (αv v_y)²)/v_z²) - 1):

    * separable, 1/((1 + Λ(wi))(1 + Λ(wo))) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206);
    * height-correlated, 1/(1 + Λ(wi) + Λ(wo)) (Heitz 2014, https://jcgt.org/published/0003/02/03/).
    """

    def __init__(self, alpha_u, alpha_v, correlated: bool):
        self.alpha_u, self.alpha_v, self.correlated = alpha_u, alpha_v, correlated

    def stretched(self, v):
        """v_z (1 + 2Λ(v)): the length of v, stretched by the roughness."""
        return dr.sqrt(dr.square(self.alpha_u * v.x) + dr.square(self.alpha_v * v.y) + v.z * v.z)

    def __call__(self, facet):
        cos_i, cos_o = facet.cos_i, facet.cos_o
        length_i, length_o = self.stretched(facet.wi), self.stretched(facet.wo)
        if self.correlated:
            return 2 * cos_i * cos_o / (cos_i * length_o + cos_o * length_i)
        return (2 * cos_i / (cos_i + length_i)) * (2 * cos_o / (cos_o + length_o))


def kelemen(facet):
    """cosθ_i cosθ_o / cos²θ_d (Kelemen and Szirmay-Kalos, A microfacet based coupled specular-matte BRDF model with
    importance sampling, Eurographics short presentations, 2001)."""
    return facet.cos_i * facet.cos_o / dr.square(facet.cos_d)
