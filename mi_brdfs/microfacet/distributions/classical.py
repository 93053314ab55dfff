"""Beckmann's distribution, GGX, and powers of cosines."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ...math import TINY
from ...parameters import Number
from ..facet import Facet
from ..laws import LARGEST_TAN2, cosine_power, cosine_power_cdf, inverse_cosine_power_cdf, log_complement
from ..shadowing import Smith, SmithBeckmann, SmithBlinn, SmithGGX
from ..terms import Distribution, HalfVectors, Isotropic
from ..visible import VisibleNormals

ANISOTROPIC_ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets", anisotropic=True)


class Beckmann(Distribution):
    """D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴); q = D cosθ_h."""

    word = "beckmann"
    parameters = {"alpha": ANISOTROPIC_ROUGHNESS}

    def eval(self, facet: Facet) -> mi.Float:
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-6)  # no facets are that steep; its powers must not underflow
        return dr.exp(-self.steepness(facet) / cos2) / dr.square(cos2) / (dr.pi * self.alpha_u * self.alpha_v)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        complement = dr.exp(-g * tan2)
        return 1 - complement, complement

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return -log_complement(complement) / g

    def roughness(self) -> mi.Float | None:
        return dr.sqrt(self.alpha_u * self.alpha_v)

    def smith(self, correlated: bool) -> Smith:
        return SmithBeckmann(self.alpha_u, self.alpha_v, correlated)


class GGX(Distribution):
    """D = 1/(π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206)."""

    word = "ggx"
    parameters = {"alpha": ANISOTROPIC_ROUGHNESS}
    LOSS = 2.3
    long_tailed = True

    def eval(self, facet: Facet) -> mi.Float:
        h = self.unstretched(facet)
        return dr.square(dr.rcp(dr.dot(h, h))) * dr.rcp(dr.pi * self.alpha_u * self.alpha_v)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        x = dr.minimum(g * tan2, LARGEST_TAN2)
        return x / (1 + x), 1 / (1 + x)

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return c / (dr.maximum(complement, TINY) * g)

    def roughness(self) -> mi.Float | None:
        return dr.sqrt(self.alpha_u * self.alpha_v)

    def smith(self, correlated: bool) -> Smith:
        return SmithGGX(self.alpha_u, self.alpha_v, correlated)

    def visible_normals(self, wi: mi.Vector3f) -> HalfVectors:
        return VisibleNormals(self, wi)


class Blinn(Isotropic):
    """D = (n+2)/(2π) cosⁿθ_h (Blinn 1977, doi:10.1145/563858.563893, with the normalisation of a distribution)."""

    word = "blinn"
    parameters = {"exponent": Number(100, (0, 1e6), "exponent n")}

    def __init__(self, exponent: mi.Float) -> None:
        super().__init__()
        self.exponent = exponent

    def mean_square_slope(self) -> mi.Float:
        return 2 / (self.exponent + 2)

    def eval(self, facet: Facet) -> mi.Float:
        n = self.exponent
        return (n + 2) * dr.inv_two_pi * cosine_power(facet.tan2_h, n)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        return cosine_power_cdf(tan2, self.exponent)

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return inverse_cosine_power_cdf(complement, self.exponent + 2)

    def roughness(self) -> mi.Float | None:
        return dr.rsqrt(0.5 * self.exponent + 1)

    def smith(self, correlated: bool) -> Smith:
        return SmithBlinn(self.exponent, correlated)


class AshikhminShirleyNormals(Distribution):
    """D = √((nu+1)(nv+1))/(2π) cosθ_h^e, e = (nu h_x² + nv h_y²)/sin²θ_h (Ashikhmin and Shirley 2000,
    doi:10.1080/10867651.2000.10487522). Here ∫ D dω_h = 1, without a cosine, and q = D."""

    def __init__(self, exponent_u: mi.Float, exponent_v: mi.Float) -> None:
        # An ellipse: the exponent plus one at azimuth φ is (cosφ/αu)² + (sinφ/αv)².
        alpha = dr.rsqrt(exponent_u + 1)
        super().__init__(alpha, alpha if exponent_u is exponent_v else dr.rsqrt(exponent_v + 1))

    def mean_square_slope(self) -> mi.Float:
        return 2 * super().mean_square_slope()

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        return 2 * super().mean_square_slope_along(v)

    def eval(self, facet: Facet) -> mi.Float:
        x, y = facet.azimuth
        g = dr.square(x / self.alpha_u) + dr.square(y / self.alpha_v)  # e + 1, as for the lines of the sampler
        return dr.inv_two_pi / (self.alpha_u * self.alpha_v) * cosine_power(facet.tan2_h, g - 1)

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        return self.eval(facet)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        # Dr.Jit computes the power that D has, too, once.
        complement = cosine_power(tan2, g - 1) * dr.rsqrt(1 + dr.minimum(tan2, LARGEST_TAN2))
        return 1 - complement, complement

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return inverse_cosine_power_cdf(complement, g)
