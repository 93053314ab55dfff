"""Diffuse lobes."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from .lobe import Lobe


class LambertLobe(Lobe):
    """f = ρ/π, cosine-sampled: the weight is ρ."""

    glossy = False

    def __init__(self, reflectance):
        self.reflectance = reflectance

    def albedo(self, wi):
        return self.reflectance

    def eval_pdf(self, wi, wo):
        pdf = wo.z * dr.inv_pi
        return self.reflectance * pdf, pdf

    def sample(self, wi, u, v):
        return mi.warp.square_to_cosine_hemisphere(v)
