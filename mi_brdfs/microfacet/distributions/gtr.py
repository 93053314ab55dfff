"""Generalised Trowbridge-Reitz."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ...math import ONE_MINUS_EPSILON, clamp
from ...parameters import Number
from ..facet import Facet
from ..laws import LARGEST_TAN2, PowerLaw
from ..terms import Isotropic

ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets")


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

    def roughness(self) -> mi.Float | None:
        return self.alpha

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
