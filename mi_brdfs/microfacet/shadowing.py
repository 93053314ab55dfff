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


class SchlickGGX:
    """Schlick's rational stand-in for Smith's term, Π cosθ/(cosθ (1-k) + k) over both directions (Schlick 1994,
    doi:10.1111/1467-8659.1330233). For GGX facets k = α/2 comes near it (Karis 2013)."""

    def __init__(self, k):
        self.k = k

    def __call__(self, facet):
        i, o = (cos / (cos + self.k * (1 - cos)) for cos in (facet.cos_i, facet.cos_o))
        return i * o


def kelemen(facet):
    """cosθ_i cosθ_o / cos²θ_d (Kelemen and Szirmay-Kalos, A microfacet based coupled specular-matte BRDF model with
    importance sampling, Eurographics short presentations, 2001)."""
    return facet.cos_i * facet.cos_o / dr.square(facet.cos_d)


def vcavity(facet):
    """min(1, 2 cosθ_h cosθ_i / cosθ_d, 2 cosθ_h cosθ_o / cosθ_d) (Torrance and Sparrow 1967; Cook and Torrance 1982,
    doi:10.1145/357290.357293)."""
    return dr.minimum(1, 2 * facet.cos_h * dr.minimum(facet.cos_i, facet.cos_o) / facet.cos_d)


def implicit(facet):
    """cosθ_i cosθ_o, which cancels the denominator."""
    return facet.cos_i * facet.cos_o


def ashikhmin_shirley(facet):
    """cosθ_i cosθ_o / (cosθ_d max(cosθ_i, cosθ_o)) (Ashikhmin and Shirley 2000,
    doi:10.1080/10867651.2000.10487522)."""
    return dr.minimum(facet.cos_i, facet.cos_o) / facet.cos_d


class Kurt:
    """(cosθ_i cosθ_o)^(1-κ) / cosθ_d (Kurt, Szirmay-Kalos and Křivánek 2010, doi:10.1145/1722991.1722996)."""

    def __init__(self, exponent):
        self.exponent = exponent

    def __call__(self, facet):
        return dr.power(facet.cos_i * facet.cos_o, 1 - self.exponent) / facet.cos_d
