"""Facet distributions D.

A distribution knows its value ``D(facet)``, with ∫ D cosθ_h dω_h = 1 unless it says otherwise, and, for the sampler of
:mod:`.sampling`, the half-vector density q that goes with it. q is elliptical: in the azimuth ψ of the stretched slope
(h_x/h_z, h_y/h_z) = r (αu cosψ, αv sinψ) it is uniform, and on a line of azimuth ψ it has a cumulative distribution in
t = tan²θ_h, which may depend on ``g`` = 1/((αu cosψ)² + (αv sinψ)²).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import TINY
from .facet import Facet
from .laws import LARGEST_TAN2, cosine_power, cosine_power_cdf, inverse_cosine_power_cdf, log_complement
from .sampling import HalfVectors
from .shadowing import Smith, SmithBeckmann, SmithBlinn, SmithGGX
from .term import Term
from .visible import VisibleNormals


class Distribution(Term):
    """A distribution of two roughnesses, αu along dp_du and αv across: anisotropic, unless both are the same object."""

    LOSS = 1.7
    """How much light is lost to multiple reflections, which tests/calibration/estimated_albedo.py fits."""
    long_tailed = False
    """Whether there are many more steep facets than a Gaussian distribution of slopes has."""

    def __init__(self, alpha_u: mi.Float, alpha_v: mi.Float) -> None:
        self.alpha_u, self.alpha_v = alpha_u, alpha_v
        self.anisotropic = alpha_u is not alpha_v

    def unstretched(self, facet: Facet) -> mi.Vector3f:
        """(h_x/αu, h_y/αv, h_z), with reciprocals that Dr.Jit computes once for all facets."""
        return mi.Vector3f(facet.h.x * dr.rcp(self.alpha_u), facet.h.y * dr.rcp(self.alpha_v), facet.h.z)

    def steepness(self, facet: Facet) -> mi.Float:
        """(h_x/αu)² + (h_y/αv)²."""
        h = self.unstretched(facet)
        return h.x * h.x + h.y * h.y

    def mean_square_slope(self) -> mi.Float:
        """About the mean square slope, over both axes."""
        return 0.5 * (dr.square(self.alpha_u) + dr.square(self.alpha_v))

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        """The same along a direction, times sin²θ of that."""
        return dr.square(self.alpha_u * v.x) + dr.square(self.alpha_v * v.y)

    def estimated_albedo(self, cos: mi.Float) -> mi.Float:
        """An estimate, to some 20 %, of the albedo that facets with F = 1 and a shadowing term that conserves energy
        have in the direction of that cosine."""
        r2 = self.mean_square_slope()
        return 1 / (1 + self.LOSS * r2 * dr.sqrt(dr.sqrt(dr.sqrt(r2))) * (0.5 + 0.5 * cos))

    def roughness(self) -> mi.Float | None:
        """The α that Schlick's stand-in for Smith's shadowing goes by, or None if there is no such."""
        return None

    def smith(self, correlated: bool) -> Smith | None:
        """Smith's shadowing term that belongs to this distribution, or None if that is not known."""
        return None

    def visible_normals(self, wi: mi.Vector3f) -> HalfVectors | None:
        """Return the half vectors that ``wi`` sees under Smith's masking, or None if there is no sampler of them."""
        return None

    def eval(self, facet: Facet) -> mi.Float:
        """D(h)."""
        raise NotImplementedError

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        """q(h); by default D cosθ_h."""
        return self.eval(facet) * facet.cos_h

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        """``(C, 1 - C)``: the cumulative distribution in t on the line, to 1e-7, and its complement with digits of its
        own."""
        raise NotImplementedError

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        """The t of a ``cdf`` value."""
        raise NotImplementedError


class Isotropic(Distribution):
    """A distribution whose own parameters replace the roughness."""

    def __init__(self) -> None:
        one = mi.Float(1)
        super().__init__(one, one)

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        return self.mean_square_slope() * (v.x * v.x + v.y * v.y)


class Beckmann(Distribution):
    """D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴); q = D cosθ_h."""

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
