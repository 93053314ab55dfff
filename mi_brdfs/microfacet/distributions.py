"""Facet distributions D.

A distribution knows its value ``D(facet)``, with ∫ D cosθ_h dω_h = 1 unless it says otherwise, and, for the sampler of
:mod:`.sampling`, the half-vector density q that goes with it. q is elliptical: in the azimuth ψ of the stretched slope
(h_x/h_z, h_y/h_z) = r (αu cosψ, αv sinψ) it is uniform, and on a line of azimuth ψ it has a cumulative distribution in
t = tan²θ_h, which may depend on ``g`` = 1/((αu cosψ)² + (αv sinψ)²).
"""

from __future__ import annotations

import functools
import math

import drjit as dr
import mitsuba as mi

from ..math import clamp, expm1, expm1_ratio, gauss_legendre, log1p, log1p_ratio, log_cos
from .shadowing import Smith, SmithBeckmann, SmithBlinn, SmithGGX
from .term import Term


class Distribution(Term):
    """A distribution of two roughnesses, αu along dp_du and αv across: anisotropic, unless both are the same object."""

    LOSS = 1.7
    """How much light is lost to multiple reflections: the constant of :meth:`estimated_albedo`, fitted."""
    long_tailed = False
    """Whether there are many more steep facets than a Gaussian distribution of slopes has."""

    def __init__(self, alpha_u, alpha_v):
        self.alpha_u, self.alpha_v = alpha_u, alpha_v
        self.anisotropic = alpha_u is not alpha_v

    def steepness(self, facet):
        """(h_x/αu)² + (h_y/αv)²."""
        return dr.square(facet.h.x / self.alpha_u) + dr.square(facet.h.y / self.alpha_v)

    def mean_square_slope(self):
        """About the mean square slope, over both axes."""
        return 0.5 * (dr.square(self.alpha_u) + dr.square(self.alpha_v))

    def mean_square_slope_along(self, v):
        """The same along a direction, times sin²θ of that."""
        return dr.square(self.alpha_u * v.x) + dr.square(self.alpha_v * v.y)

    def estimated_albedo(self, cos):
        """An estimate, to some 20 %, of the albedo that facets with F = 1 and a shadowing term that conserves energy
        have in the direction of that cosine."""
        r2 = self.mean_square_slope()
        return 1 / (1 + self.LOSS * r2 * dr.sqrt(dr.sqrt(dr.sqrt(r2))) * (0.5 + 0.5 * cos))

    def roughness(self):
        """The α that Schlick's stand-in for Smith's shadowing goes by, or None if there is no such."""
        return None

    def smith(self, correlated: bool) -> Smith | None:
        """Smith's shadowing term that belongs to this distribution, or None if that is not known."""
        return None

    def eval(self, facet):
        """D(h)."""
        raise NotImplementedError

    def density(self, facet, g):
        """q(h); by default D cosθ_h."""
        return self.eval(facet) * facet.cos_h

    def cdf(self, tan2, g):
        """``(C, 1 - C)``: the cumulative distribution in t on the line, to 1e-7, and its complement with digits of its
        own."""
        raise NotImplementedError

    def inverse_cdf(self, c, complement, g):
        """The t of a ``cdf`` value."""
        raise NotImplementedError


class Isotropic(Distribution):
    """A distribution whose own parameters replace the roughness."""

    def __init__(self):
        one = mi.Float(1)
        super().__init__(one, one)

    def mean_square_slope_along(self, v):
        return self.mean_square_slope() * (v.x * v.x + v.y * v.y)


class Beckmann(Distribution):
    """D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴); q = D cosθ_h."""

    def eval(self, facet):
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-6)  # no facets are that steep; its powers must not underflow
        return dr.exp(-self.steepness(facet) / cos2) / dr.square(cos2) / (dr.pi * self.alpha_u * self.alpha_v)

    def cdf(self, tan2, g):
        complement = dr.exp(-g * tan2)
        return 1 - complement, complement

    def inverse_cdf(self, c, complement, g):
        return -log_complement(complement) / g

    def roughness(self):
        return dr.sqrt(self.alpha_u * self.alpha_v)

    def smith(self, correlated: bool):
        return SmithBeckmann(self.alpha_u, self.alpha_v, correlated)


class GGX(Distribution):
    """D = 1/(π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206)."""

    LOSS = 2.3
    long_tailed = True

    def eval(self, facet):
        return 1 / (dr.pi * self.alpha_u * self.alpha_v * dr.square(self.steepness(facet) + dr.square(facet.cos_h)))

    def cdf(self, tan2, g):
        x = dr.minimum(g * tan2, 1e30)
        return x / (1 + x), 1 / (1 + x)

    def inverse_cdf(self, c, complement, g):
        return c / (dr.maximum(complement, 1e-30) * g)

    def roughness(self):
        return dr.sqrt(self.alpha_u * self.alpha_v)

    def smith(self, correlated: bool):
        return SmithGGX(self.alpha_u, self.alpha_v, correlated)


class Blinn(Isotropic):
    """D = (n+2)/(2π) cosⁿθ_h (Blinn 1977, doi:10.1145/563858.563893, with the normalisation of a distribution)."""

    def __init__(self, exponent):
        super().__init__()
        self.exponent = exponent

    def mean_square_slope(self):
        return 2 / (self.exponent + 2)

    def eval(self, facet):
        n = self.exponent
        return (n + 2) * dr.inv_two_pi * dr.exp(n * log_cos(facet.cos_h, facet.sin2_h))

    def cdf(self, tan2, g):
        return cosine_power_cdf(tan2, self.exponent + 2)

    def inverse_cdf(self, c, complement, g):
        return inverse_cosine_power_cdf(complement, self.exponent + 2)

    def roughness(self):
        return dr.rsqrt(0.5 * self.exponent + 1)

    def smith(self, correlated: bool):
        return SmithBlinn(self.exponent, correlated)


class AshikhminShirleyNormals(Distribution):
    """D = √((nu+1)(nv+1))/(2π) cosθ_h^e, e = (nu h_x² + nv h_y²)/sin²θ_h (Ashikhmin and Shirley 2000,
    doi:10.1080/10867651.2000.10487522). Here ∫ D dω_h = 1, without a cosine, and q = D."""

    def __init__(self, exponent_u, exponent_v):
        # An ellipse: the exponent plus one at azimuth φ is (cosφ/αu)² + (sinφ/αv)².
        alpha = dr.rsqrt(exponent_u + 1)
        super().__init__(alpha, alpha if exponent_u is exponent_v else dr.rsqrt(exponent_v + 1))

    def mean_square_slope(self):
        return 2 * super().mean_square_slope()

    def mean_square_slope_along(self, v):
        return 2 * super().mean_square_slope_along(v)

    def eval(self, facet):
        # e log(cosθ), where steepness is (e + 1) sin²θ
        sin2 = facet.sin2_h
        near = -0.5 * log1p_ratio(-dr.minimum(sin2, 0.5))
        far = log_cos(facet.cos_h, sin2) / dr.maximum(sin2, 0.5)
        exponent = (self.steepness(facet) - sin2) * dr.select(sin2 < 0.5, near, far)
        return dr.inv_two_pi / (self.alpha_u * self.alpha_v) * dr.exp(exponent)

    def density(self, facet, g):
        return self.eval(facet)

    def cdf(self, tan2, g):
        return cosine_power_cdf(tan2, g)

    def inverse_cdf(self, c, complement, g):
        return inverse_cosine_power_cdf(complement, g)


class PowerLaw:
    """The density ∝ (1 + k s)^-γ for s >= 0 (to 1, where k < 0): with x = 1-γ and L = log(1 + k s), its integral is
    (exp(x L) - 1)/(x k), where every ratio has its limit at x = 0 and k = 0. ``norm`` is the integral to 1."""

    def __init__(self, k, gamma):
        self.k, self.gamma, self.x = k, gamma, 1 - gamma
        self.norm = self.mass(1)

    def eval(self, s):
        return dr.exp(-self.gamma * log1p(self.k * s))

    def mass(self, s):
        """∫ (1 + k s)^-γ from 0 to s."""
        logarithm = s * log1p_ratio(self.k * s)
        return logarithm * expm1_ratio(self.x * self.k * logarithm)

    def inverse(self, mass):
        """The s of a ``mass``."""
        z = self.x * self.k * mass
        logarithm = mass * log1p_ratio(dr.maximum(z, -1 + 1e-7))
        return logarithm * expm1_ratio(self.k * logarithm)


class GTR(Isotropic):
    """D ∝ (1 + (α²-1) cos²θ_h)^-γ, generalised Trowbridge-Reitz (Burley 2012, Physically based shading at Disney).
    GGX is γ = 2; γ = 1 has the tail of a clear coat."""

    long_tailed = True

    def __init__(self, alpha, gamma):
        super().__init__()
        self.alpha, self.alpha2 = alpha, dr.square(alpha)
        # In s = sin²θ: 1 + (α²-1) cos²θ = α² (1 + k s)
        self.law = PowerLaw((1 - self.alpha2) / self.alpha2, gamma)

    def mean_square_slope(self):
        return self.alpha2

    def roughness(self):
        return self.alpha

    def eval(self, facet):
        return self.law.eval(facet.sin2_h) * dr.inv_pi / self.law.norm

    def cdf(self, tan2, g):
        tan2 = dr.minimum(tan2, 1e30)
        c = clamp(self.law.mass(tan2 / (1 + tan2)) / self.law.norm, 0, 1)
        return c, 1 - c

    def inverse_cdf(self, c, complement, g):
        s = clamp(self.law.inverse(c * self.law.norm), 0, 1 - 1e-7)
        return s / (1 - s)


class Berry(Isotropic):
    """D = k/(π log(1+k) (1 + k sin²θ_h)), k = 1/α² - 1 (Berry 1923): GTR of γ = 1."""

    def __init__(self, alpha):
        super().__init__()
        self.alpha2 = dr.square(alpha)
        self.k = (1 - self.alpha2) / self.alpha2
        self.range = dr.log(1 + self.k)

    def mean_square_slope(self):
        return self.alpha2

    def eval(self, facet):
        return self.k / (dr.pi * self.range * (1 + self.k * facet.sin2_h))

    def cdf(self, tan2, g):
        tan2 = dr.minimum(tan2, 1e30)
        c = dr.minimum(dr.log(1 + self.k * (tan2 / (1 + tan2))) / self.range, 1)
        return c, 1 - c

    def inverse_cdf(self, c, complement, g):
        s = clamp((dr.exp(c * self.range) - 1) / self.k, 0, 1 - 1e-7)
        return s / (1 - s)


class ABC(Isotropic):
    """D = scale·(1 + B (1 - cosθ_h))^-C (Church and Takacs 1991; Löw et al. 2012, doi:10.1145/2077341.2077350).
    ``scale`` None stands for the one with ∫ D cosθ_h dω_h = 1. Here q ∝ D, without the cosine."""

    long_tailed = True

    def __init__(self, b, c, scale=None):
        super().__init__()
        self.law = PowerLaw(b, c)
        cosine_mass = self._cosine_mass()
        self.scale = dr.inv_two_pi / cosine_mass if scale is None else scale
        self.total = self.scale * dr.two_pi * cosine_mass

    def _cosine_mass(self):
        """∫ (1 - y)(1 + B y)^-C over 0 <= y <= 1."""
        b = self.law.k
        broad = b < 0.5
        # Gauss-Legendre where the closed form, (∫ (1 + B y)^(1-C) - ∫ (1 + B y)^-C)/B, would cancel.
        quadrature = sum(w * y * self.law.eval(y) for y, w in gauss_legendre(4))
        closed = (PowerLaw(b, self.law.gamma - 1).norm - self.law.norm) / dr.select(broad, 1, b)
        return self.law.norm - dr.select(broad, quadrature, closed)

    def mean_square_slope(self):
        return dr.minimum(2 / (1 + self.law.k * self.law.gamma), 1)

    def estimated_albedo(self, cos):
        return super().estimated_albedo(cos) * self.total

    def eval(self, facet):
        return self.scale * self.law.eval(versine(facet.cos_h, facet.sin2_h))

    def density(self, facet, g):
        return self.law.eval(versine(facet.cos_h, facet.sin2_h)) * dr.inv_two_pi / self.law.norm

    def cdf(self, tan2, g):
        c = clamp(self.law.mass(versine_of_tan2(tan2)) / self.law.norm, 0, 1)
        return c, 1 - c

    def inverse_cdf(self, c, complement, g):
        return tan2_of_versine(self.law.inverse(c * self.law.norm))


class BentLaw:
    """A density on [0, 1] that can be inverted: ∝ exp(κ s) for κ >= 0, and ∝ 1/(1 - κ s) for κ < 0. Its cumulative
    distribution begins at s = 1, and s comes with its complement m = 1 - s. Of a number and its complement the smaller
    one is computed, by the formula that keeps its digits."""

    def __init__(self, kappa):
        self.rises = kappa >= 0
        self.kappa, self.k = dr.select(self.rises, kappa, 0), dr.select(self.rises, 0, -kappa)
        # Of exp(-κ m): exp(κ s) leaves the range of float32, or its derivative does.
        self.norm = dr.select(self.rises, expm1_ratio(-self.kappa), log1p_ratio(self.k))

    def eval(self, m, s):
        return dr.select(self.rises, dr.exp(-self.kappa * m), 1 / (1 + self.k * s)) / self.norm

    def cdf(self, m, s):
        """``(c, 1 - c)``, where c is the mass above s."""
        above = (m < 0.5) & (self.kappa * m < 0.7)
        up, down = m / (1 + self.k), s
        weight = dr.select(above, m, s * dr.exp(-self.kappa * m))
        exponential = expm1_ratio(-self.kappa * dr.select(above, m, s)) * weight
        rational = log1p_ratio(dr.select(above, -up, down) * self.k) * dr.select(above, up, down)
        mass = dr.select(self.rises, exponential, rational) / self.norm
        return dr.select(above, mass, 1 - mass), dr.select(above, 1 - mass, mass)

    def inverse_cdf(self, c, complement):
        """The s of a ``cdf`` value."""
        above = c < 0.5
        mass = dr.select(above, c, complement)
        y = mass * self.norm * dr.select(above, 1, dr.exp(self.kappa))
        sign = dr.select(above, -1, 1)
        exponential = log1p_ratio(sign * self.kappa * y)
        rational = expm1_ratio(sign * self.k * y) * dr.select(above, 1 + self.k, 1)
        value = y * dr.select(self.rises, exponential, rational)
        return dr.select(above, 1 - value, value)


class HemiEPD(Isotropic):
    """D = (γ+2)/(2π J) cosᵞθ_h e(κ cosᵞθ_h), e(x) = (exp(x) - 1)/x: the hemispherical exponential power distribution
    ∝ |exp(κ cosᵞθ_h) - 1| (Nishino and Lombardi 2011, doi:10.1364/JOSAA.28.000008). J = ∫ e(κ s^p) ds over 0 <= s <= 1,
    p = γ/(γ+2).

    With s = cosθ_h^(γ+2), D cosθ_h dω_h is e(κ s^p)/J ds. q takes the place of that by a law that falls as steeply at
    s = 1; their ratio is bounded.
    """

    def __init__(self, kappa, gamma):
        super().__init__()
        self.kappa, self.gamma, self.power = kappa, gamma, gamma / (gamma + 2)
        self.law = BentLaw(kappa * self.power)
        # Take exp(shift) out of J and e: the derivatives of exp(κ), and of 1/J, are no float32.
        large = kappa > 40
        self.scaled = dr.select(large, 46, 0), dr.select(large, math.exp(-46), 1)
        self.integral = self._integral()

    def _integral(self):
        """J, good to 5e-6: by quadrature in a variable that spreads what happens at the end of [0, 1] at which the
        integrand is largest, for κ < 0 that at 0, and squeezes the other one."""
        falls = self.kappa < 0
        k = dr.maximum(0.2 * abs(self.kappa) * self.power, 0.05)
        log_k, integral = dr.log(1 + k), 0
        for x, weight in gauss_legendre(12):
            growth = dr.exp(log_k * dr.select(falls, x**3, x * (2 - x)))
            t = dr.maximum((growth - 1) / k, 1e-6)
            value = expm1_ratio(self.kappa * dr.power(dr.select(falls, t, 1 - t), self.power), *self.scaled)
            integral += dr.select(falls, 3 * x * x, 2 - 2 * x) * weight * growth * value
        return integral * log_k / k

    def mean_square_slope(self):
        # That of Blinn's distribution with about the same mean of log(cosθ).
        up, down = dr.maximum(self.kappa, 0), dr.maximum(-self.kappa, 0)
        narrower = dr.select(self.kappa > 0, 1 + up * up / (up + 7), 1 / (1 + 0.35 * dr.log(1 + 0.5 * down)))
        return 2 / (2 + self.gamma * narrower)

    def eval(self, facet):
        power = dr.exp(self.gamma * log_cos(facet.cos_h, facet.sin2_h))
        bent = expm1_ratio(self.kappa * power, *self.scaled) / self.integral
        return (self.gamma + 2) * dr.inv_two_pi * power * bent

    def density(self, facet, g):
        m, s = cosine_power_cdf(facet.tan2_h, self.gamma + 2)
        return (self.gamma + 2) * dr.inv_two_pi * s / facet.cos_h * self.law.eval(m, s)

    def cdf(self, tan2, g):
        return self.law.cdf(*cosine_power_cdf(tan2, self.gamma + 2))

    def inverse_cdf(self, c, complement, g):
        return inverse_cosine_power_cdf(self.law.inverse_cdf(c, complement), self.gamma + 2)


class Steps:
    """A density on [0, 1], constant on each of equal steps, of which the ``heights`` are given up to a factor."""

    def __init__(self, heights):
        highest = functools.reduce(dr.maximum, heights)
        self.heights = [dr.maximum(height, 1e-9 * highest) for height in heights]  # it must not vanish
        self.total = sum(self.heights)

    def eval(self, c):
        value = self.heights[0]
        for k, height in enumerate(self.heights[1:], start=1):
            value = dr.select(c * len(self.heights) < k, value, height)
        return value * len(self.heights) / self.total

    def cdf(self, c):
        c = c * len(self.heights)
        return sum(height * dr.clip(c - k, 0, 1) for k, height in enumerate(self.heights)) / self.total

    def inverse_cdf(self, mass):
        left, c = mass * self.total, 0
        for height in self.heights:
            c += dr.clip(left / height, 0, 1)
            left -= height
        return c / len(self.heights)


class RootLaw:
    """The cumulative distribution ∝ √r - √(near/far), r = (t + near)/(t + far), of t >= 0. The density falls like 1/√t
    from ``near`` to ``far``, and beyond like 1/t². A t up to infinity is given as a ratio x/y."""

    def __init__(self, near, far):
        self.near, self.far = near, far
        self.lowest = dr.sqrt(near / far)

    def eval(self, x, y=1):
        """The density over y²."""
        outer = x + self.far * y
        return 0.5 * (1 + self.lowest) * self.far / (dr.square(outer) * dr.sqrt((x + self.near * y) / outer))

    def cdf(self, x, y=1):
        return (dr.sqrt((x + self.near * y) / (x + self.far * y)) - self.lowest) / (1 - self.lowest)

    def inverse_cdf(self, c):
        """The t, up to 1e30."""
        root = self.lowest + c * (1 - self.lowest)
        return dr.minimum(self.far * (c * (root + self.lowest) / dr.maximum((1 - c) * (1 + root), 1e-18)), 1e30)


class EPD(Isotropic):
    """D = exp(-(tan²θ_h/α²)ᵞ) / (π α² Γ(1 + 1/γ) cos⁴θ_h), the exponential power distribution of slopes, of which γ = 1
    is Beckmann's (Holzschuch and Pacanowski 2017, doi:10.1145/3072959.3073621).

    q follows D cosθ_h, by steps over a law that has a peak within tan²θ_h = α², as D has, and falls from where most
    facets are: the lower γ, the further is one from the other.
    """

    long_tailed = True
    STEPS = 18

    def __init__(self, alpha, gamma):
        super().__init__()
        self.alpha, self.alpha2, self.gamma = alpha, dr.square(alpha), gamma
        # tan²θ_h is distributed as α² Γ^(1/γ), where Γ is Gamma-distributed with parameter 1/γ and median 1/γ - 1/3.
        self.median = self._limited(self.alpha2 * dr.exp(dr.log(dr.maximum(1 / gamma - 1 / 3, 0.1)) / gamma))
        self.scale = dr.inv_pi / self.alpha2 * dr.exp(-dr.lgamma(1 + 1 / gamma))

        far = self._limited(self.alpha2 * dr.exp(dr.log(1.5 / gamma) / gamma))
        self.law = RootLaw(dr.minimum(self.alpha2, 0.5 * far), far)
        borders = [0, *(self.law.inverse_cdf(k / self.STEPS) for k in range(1, self.STEPS))]
        falls = [1, *(dr.exp(-dr.exp(gamma * dr.log(t / self.alpha2))) for t in borders[1:])]
        at = [fall * self._rest(t) / self.law.eval(t) for fall, t in zip(falls, borders, strict=True)]
        self.steps = Steps([0.5 * (left + right) for left, right in zip(at, [*at[1:], 0], strict=True)])

    def _limited(self, tan2):
        return dr.minimum(tan2, 1e16)

    def _power(self, tan2):
        """(tan²θ/α²)ᵞ"""
        x = tan2 / self.alpha2
        # At the normal the derivative of a low power has no end; and exp(-exp(5)) is no float32.
        power = dr.exp(dr.minimum(self.gamma * dr.log(dr.maximum(x, 1e-24)), 5))
        return dr.select(x > 1e-24, power, 0)

    def _rest(self, tan2):
        """What D cosθ dω is proportional to, per tan²θ, but for that power."""
        return 1

    def mean_square_slope(self):
        return dr.minimum(self.median, 1)

    def roughness(self):
        return self.alpha

    def eval(self, facet):
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-12)
        # 1/cos⁴ as a part of the exponent: its adjoint would overflow where the power makes up for it.
        return self.scale * dr.exp(-2 * dr.log(cos2) - self._power(facet.sin2_h / cos2))

    def density(self, facet, g):
        slope = facet.sin2_h, dr.square(facet.cos_h)
        return dr.inv_pi * facet.cos_h * self.law.eval(*slope) * self.steps.eval(self.law.cdf(*slope))

    def cdf(self, tan2, g):
        c = dr.minimum(self.steps.cdf(self.law.cdf(dr.minimum(tan2, 1e30))), 1)
        return c, 1 - c

    def inverse_cdf(self, c, complement, g):
        return self.law.inverse_cdf(self.steps.inverse_cdf(c))


def versine(cos, sin2):
    """1 - cosθ."""
    return sin2 / (1 + cos)


def versine_of_tan2(tan2):
    """1 - cosθ of tan²θ, for tan²θ up to infinity."""
    cos = dr.rsqrt(1 + tan2)
    return dr.select(tan2 < 1, dr.minimum(tan2, 1) * cos * cos / (1 + cos), 1 - cos)


def tan2_of_versine(v):
    """tan²θ of 1 - cosθ, limited at the horizon."""
    v = clamp(v, 0, 1 - 1e-7)
    return v * (2 - v) / dr.square(1 - v)


def cosine_power_cdf(tan2, power):
    """``(C, 1 - C)`` for 1 - C = cosθ^power."""
    complement = dr.exp(-0.5 * power * log1p(dr.minimum(tan2, 1e30)))
    return 1 - complement, complement


def inverse_cosine_power_cdf(complement, power):
    """The tan²θ of the complement of a ``cosine_power_cdf`` value."""
    return dr.minimum(expm1(log_complement(complement) * (-2 / power)), 1e30)


def log_complement(complement):
    """log(1 - c) of the complement 1 - c. Where c has more digits it is 1e-7 off: so little that no sample shows it."""
    return dr.log(dr.maximum(complement, 1e-37))
