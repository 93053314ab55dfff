"""Facet distributions D.

A distribution knows its value ``D(facet)``, with ∫ D cosθ_h dω_h = 1 unless it says otherwise, and, for the sampler of
:mod:`mi_brdfs.microfacet.sampling`, the half-vector density q that goes with it. q is elliptical: in the azimuth ψ of
the stretched slope (h_x/h_z, h_y/h_z) = r (αu cosψ, αv sinψ) it is uniform, and on a line of azimuth ψ it has a
cumulative distribution in t = tan²θ_h, which may depend on ``g`` = 1/((αu cosψ)² + (αv sinψ)²).
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import ONE_MINUS_EPSILON, TINY, clamp, expm1_series, gauss_legendre, log1p_series
from ..parameters import Number
from .epd import EPD
from .facet import Facet
from .hemi_epd import HemiEPD
from .laws import (
    LARGEST_TAN2,
    PowerLaw,
    cosine_power,
    cosine_power_cdf,
    inverse_cosine_power_cdf,
    log_complement,
    tan2_of_versine,
    versine_of_tan2,
)
from .shadowing import Smith, SmithBeckmann, SmithGGX, SmithRational
from .terms import ROUGHNESS, Distribution, HalfVectors, Isotropic, widened_roughness
from .visible import VisibleNormals

__all__ = [
    "ABC", "EPD", "GGX", "GTR", "AshikhminShirleyNormals", "Beckmann", "Berry", "Blinn", "Distribution", "HemiEPD",
    "Isotropic",
]  # fmt: skip

ANISOTROPIC_ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets", anisotropic=True)


class Elliptical(Distribution):
    """A distribution that is the same for all roughnesses but for the stretch of its slopes."""

    parameters = {"alpha": ANISOTROPIC_ROUGHNESS}

    def roughness(self) -> mi.Float:
        return dr.sqrt(self.alpha_u * self.alpha_v)

    def widened(self, spread: mi.Float) -> Distribution:
        u = widened_roughness(self.alpha_u, spread)
        v = u if self.alpha_v is self.alpha_u else widened_roughness(self.alpha_v, spread)
        wide = type(self)(u, v)
        wide.anisotropic = self.anisotropic
        return wide


class Beckmann(Elliptical):
    """D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴); q = D cosθ_h."""

    word = "beckmann"

    def eval(self, facet: Facet) -> mi.Float:
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-6)  # no facets are that steep; its powers must not underflow
        return dr.exp(-self.steepness(facet) / cos2) / dr.square(cos2) / (dr.pi * self.alpha_u * self.alpha_v)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        complement = dr.exp(-g * tan2)
        return 1 - complement, complement

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return -log_complement(complement) / g

    def smith(self, correlated: bool) -> Smith:
        return SmithBeckmann(self.alpha_u, self.alpha_v, correlated)


class GGX(Elliptical):
    """D = 1/(π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206)."""

    word = "ggx"
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

    def roughness(self) -> mi.Float:
        return dr.rsqrt(0.5 * self.exponent + 1)

    def widened(self, spread: mi.Float) -> Distribution:
        return Blinn(2 * dr.square(dr.rcp(widened_roughness(self.roughness(), spread))) - 2)

    def smith(self, correlated: bool) -> Smith:
        alpha = self.roughness()
        return SmithRational(alpha, alpha, correlated)


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


class GTR(Isotropic):
    """D ∝ (1 + (α²-1) cos²θ_h)^-γ, generalised Trowbridge-Reitz (Burley 2012, Physically based shading at Disney).
    GGX is γ = 2; γ = 1 has the tail of a clear coat."""

    word = "gtr"
    parameters = {"alpha": ROUGHNESS, "gamma": Number(2, (0, 10), "exponent γ: the lower, the longer the tail")}
    long_tailed = True

    def __init__(self, alpha: mi.Float, gamma: mi.Float) -> None:
        super().__init__()
        self.alpha, self.alpha2 = alpha, dr.square(alpha)
        # In s = sin²θ: 1 + (α²-1) cos²θ = α² (1 + k s)
        self.law = PowerLaw((1 - self.alpha2) / self.alpha2, gamma)

    def mean_square_slope(self) -> mi.Float:
        return self.alpha2

    def roughness(self) -> mi.Float:
        return self.alpha

    def widened(self, spread: mi.Float) -> Distribution:
        return GTR(widened_roughness(self.alpha, spread), self.law.gamma)

    def eval(self, facet: Facet) -> mi.Float:
        return self.law.eval(facet.sin2_h) * dr.inv_pi / self.law.norm

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        tan2 = dr.minimum(tan2, LARGEST_TAN2)
        c = clamp(self.law.mass(tan2 / (1 + tan2)) / self.law.norm, 0, 1)
        return c, 1 - c

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        s = clamp(self.law.inverse(c * self.law.norm), 0, ONE_MINUS_EPSILON)
        return s / (1 - s)


class Berry(Isotropic):
    """D = k/(π log(1+k) (1 + k sin²θ_h)), k = 1/α² - 1 (Berry 1923): GTR of γ = 1."""

    def __init__(self, alpha: mi.Float) -> None:
        super().__init__()
        self.alpha2 = dr.square(alpha)
        self.k = (1 - self.alpha2) / self.alpha2
        self.range = dr.log(1 + self.k)

    def mean_square_slope(self) -> mi.Float:
        return self.alpha2

    def eval(self, facet: Facet) -> mi.Float:
        return self.k / (dr.pi * self.range * (1 + self.k * facet.sin2_h))

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        tan2 = dr.minimum(tan2, LARGEST_TAN2)
        c = dr.minimum(dr.log(1 + self.k * (tan2 / (1 + tan2))) / self.range, 1)
        return c, 1 - c

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        s = clamp((dr.exp(c * self.range) - 1) / self.k, 0, ONE_MINUS_EPSILON)
        return s / (1 - s)


class ABC(Isotropic):
    """D = scale·(1 + B (1 - cosθ_h))^-C (Church and Takacs 1991; Löw et al. 2012, doi:10.1145/2077341.2077350).
    ``scale`` None stands for the one with ∫ D cosθ_h dω_h = 1. Here q ∝ D, without the cosine."""

    word = "abc"
    parameters = {
        "b": Number(100, (0, 1e8), "width: the higher, the narrower the highlight"),
        "c": Number(1.5, (0, 10), "exponent of the tail: the higher, the steeper"),
    }
    long_tailed = True

    def __init__(self, b: mi.Float, c: mi.Float, scale: Any = None) -> None:
        super().__init__()
        self.law = PowerLaw(b, c)
        cosine_mass = self._cosine_mass()
        self.scale = dr.inv_two_pi / cosine_mass if scale is None else scale
        self.total = self.scale * dr.two_pi * cosine_mass

    def _cosine_mass(self) -> mi.Float:
        """∫ (1 - y)(1 + B y)^-C over 0 <= y <= 1."""
        b, c = self.law.k, self.law.gamma
        broad = b * dr.maximum(c, 1) < 0.5
        # Gauss-Legendre where the closed form, (∫ (1 + B y)^(1-C) - ∫ (1 + B y)^-C)/B, would cancel.
        near = dr.select(broad, b, 0)
        quadrature = 0
        for y, w in gauss_legendre(3):
            log = -c * (near * y) * log1p_series(near * y)
            quadrature += w * y * (1 + log * expm1_series(log))
        closed = (PowerLaw(b, c - 1).norm - self.law.norm) / dr.select(broad, 1, b)
        return self.law.norm - dr.select(broad, quadrature, closed)

    def mean_square_slope(self) -> mi.Float:
        return dr.minimum(2 / (1 + self.law.k * self.law.gamma), 1)

    def estimated_albedo(self, cos: mi.Float) -> Any:
        return super().estimated_albedo(cos) * self.total

    def eval(self, facet: Facet) -> mi.Float:
        return self.scale * self.law.eval(versine_of_tan2(facet.tan2_h))

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        return self.law.eval(versine_of_tan2(facet.tan2_h)) * dr.inv_two_pi / self.law.norm

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        c = clamp(self.law.mass(versine_of_tan2(tan2)) / self.law.norm, 0, 1)
        return c, 1 - c

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return tan2_of_versine(self.law.inverse(c * self.law.norm))
