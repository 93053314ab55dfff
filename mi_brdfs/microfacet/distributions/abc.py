"""The ABC distribution."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ...math import clamp, expm1_series, gauss_legendre, log1p_series
from ...parameters import Number
from ..facet import Facet
from ..laws import PowerLaw, tan2_of_versine, versine_of_tan2
from ..terms import Isotropic


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
