"""Facet distributions D.

A distribution knows its value ``D(facet)``, with ∫ D cosθ_h dω_h = 1 unless it says otherwise, and, for the sampler of
:mod:`.sampling`, the half-vector density q that goes with it. q is elliptical: in the azimuth ψ of the stretched slope
(h_x/h_z, h_y/h_z) = r (αu cosψ, αv sinψ) it is uniform, and on a line of azimuth ψ it has a cumulative distribution in
t = tan²θ_h, which may depend on ``g`` = 1/((αu cosψ)² + (αv sinψ)²).
"""

from __future__ import annotations

import drjit as dr

from ..math import expm1, log1p


class Distribution:
    LOSS: float
    """How much light is lost to multiple reflections: the constant of :meth:`albedo`, fitted."""

    def __init__(self, alpha_u, alpha_v):
        self.alpha_u, self.alpha_v = alpha_u, alpha_v

    def steepness(self, facet):
        """(h_x/αu)² + (h_y/αv)²."""
        return dr.square(facet.h.x / self.alpha_u) + dr.square(facet.h.y / self.alpha_v)

    def albedo(self, cos):
        """An estimate, to some 20 %, of the albedo that facets with F = 1 and a shadowing term that conserves energy
        have in the direction of that cosine."""
        rms2 = 0.5 * (dr.square(self.alpha_u) + dr.square(self.alpha_v))
        return 1 / (1 + self.LOSS * dr.power(rms2, 1.15) * (0.5 + 0.5 * cos))

    def eval(self, facet):
        """D(h)."""
        raise NotImplementedError

    def over_density(self, facet):
        """D(h)/q(h)."""
        raise NotImplementedError

    def cdf(self, tan2, g):
        """``(C, 1 - C)``: the cumulative distribution in t on the line, and its complement with digits of its own."""
        raise NotImplementedError

    def inverse_cdf(self, c, complement, g):
        """The t of a ``cdf`` value."""
        raise NotImplementedError


class Beckmann(Distribution):
    """D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴); q = D cosθ_h."""

    LOSS = 1.7

    def eval(self, facet):
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-14)  # α² cos⁴ must not underflow
        return dr.exp(-self.steepness(facet) / cos2) / (dr.pi * self.alpha_u * self.alpha_v * cos2 * cos2)

    def over_density(self, facet):
        return 1 / facet.cos_h

    def cdf(self, tan2, g):
        return -expm1(-g * tan2), dr.exp(-g * tan2)

    def inverse_cdf(self, c, complement, g):
        in_peak = c < 0.5
        return -dr.select(in_peak, log1p(-dr.select(in_peak, c, 0)), dr.log(dr.select(in_peak, 1, complement))) / g


class GGX(Distribution):
    """D = 1/(π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206)."""

    LOSS = 2.3

    def eval(self, facet):
        return 1 / (dr.pi * self.alpha_u * self.alpha_v * dr.square(self.steepness(facet) + dr.square(facet.cos_h)))
