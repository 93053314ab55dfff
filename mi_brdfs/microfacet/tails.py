"""Distributions of facets with a parameter for their tails."""

from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from ..math import (
    ONE_MINUS_EPSILON,
    clamp,
    expm1_ratio,
    expm1_series,
    gauss_legendre,
    log1p_series,
    reciprocal_gamma,
)
from .distributions import Isotropic
from .facet import Facet
from .laws import (
    LARGEST_TAN2,
    BentLaw,
    PowerLaw,
    Ramps,
    RootLaw,
    cosine_power,
    cosine_power_cdf,
    inverse_cosine_power_cdf,
    power_32,
    tan2_of_versine,
    versine_of_tan2,
)


class GTR(Isotropic):
    """D ∝ (1 + (α²-1) cos²θ_h)^-γ, generalised Trowbridge-Reitz (Burley 2012, Physically based shading at Disney).
    GGX is γ = 2; γ = 1 has the tail of a clear coat."""

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


class ABC(Isotropic):
    """D = scale·(1 + B (1 - cosθ_h))^-C (Church and Takacs 1991; Löw et al. 2012, doi:10.1145/2077341.2077350).
    ``scale`` None stands for the one with ∫ D cosθ_h dω_h = 1. Here q ∝ D, without the cosine."""

    long_tailed = True

    def __init__(self, b: mi.Float, c: mi.Float, scale: mi.Float | None = None) -> None:
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

    def estimated_albedo(self, cos: mi.Float) -> mi.Float:
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


class HemiEPD(Isotropic):
    """D = (γ+2)/(2π J) cosᵞθ_h e(κ cosᵞθ_h), e(x) = (exp(x) - 1)/x: the hemispherical exponential power distribution
    ∝ |exp(κ cosᵞθ_h) - 1| (Nishino and Lombardi 2011, doi:10.1364/JOSAA.28.000008). J = ∫ e(κ s^p) ds over 0 <= s <= 1,
    p = γ/(γ+2).

    With s = cosθ_h^(γ+2), D cosθ_h dω_h is e(κ s^p)/J ds. q takes the place of that by a law that falls as steeply at
    s = 1; their ratio is bounded.
    """

    # tests/calibration/hemi_epd.py fits these.
    STEP, CLOSER = 0.18, 0.2
    """Of the quadrature's nodes, and how much closer to s = 1 they are for κ > 0."""
    WEIGHTS = (0.0524025778, 0.282906942, 0.440408535, 0.637478053, 0.804718443, 0.993748450, 1.16546420, 1.36386522,
               1.46351416, 2.03185765, 0.634488608, 5.13207934)  # fmt: skip
    """Of the nodes; for κ = 0 they leave no error."""
    NARROWER, BROADER = 6.5, (0.6, 0.28)
    """Of the exponent that Blinn's distribution would have, for κ > 0 and for κ < 0."""

    def __init__(self, kappa: mi.Float, gamma: mi.Float) -> None:
        super().__init__()
        self.kappa, self.gamma, self.power = kappa, gamma, gamma / (gamma + 2)
        self.law = BentLaw(kappa * self.power)
        # Take exp(shift) out of J and e: the derivatives of exp(κ), and of 1/J, are no float32.
        large = kappa > 40
        self.scaled = dr.select(large, 46, 0), dr.select(large, math.exp(-46), 1)
        self.integral = self._integral()

    def _integral(self) -> mi.Float:
        """J, good to 2e-5: a sum over s = exp(-n STEP/(1 + CLOSER κ⁺ p)) with the triangular numbers n = 0, 1, 3, 6, …,
        so that s and s^p are products of those before; or the series in κ where e(κ s^p) would cancel."""
        kappa, p = dr.select(abs(self.kappa) < 0.5, 0.5, self.kappa), self.power
        step = -self.STEP / (1 + self.CLOSER * p * dr.maximum(kappa, 0))
        t, ratio, integral = 1, 1, 0  # s^p and s^(1-p)
        factor_t = step_t = dr.exp(step * p)
        factor_ratio = step_ratio = dr.exp(step * (1 - p))
        shift, scale = self.scaled
        for weight in self.WEIGHTS:
            integral += weight * ratio * (dr.exp(kappa * t - shift) - scale)
            t, factor_t = t * factor_t, factor_t * step_t
            ratio, factor_ratio = ratio * factor_ratio, factor_ratio * step_ratio
        integral *= -step / (self.STEP * kappa)
        near = dr.select(abs(self.kappa) < 0.5, self.kappa, 0)
        series = sum(near**n / (math.factorial(n + 1) * (1 + n * p)) for n in range(7))
        return dr.select(abs(self.kappa) < 0.5, series, integral)

    def mean_square_slope(self) -> mi.Float:
        # That of Blinn's distribution with about the same mean of log(cosθ).
        a, (b, c) = self.NARROWER, self.BROADER
        up, down = dr.maximum(self.kappa, 0), dr.maximum(-self.kappa, 0)
        narrower = dr.select(self.kappa > 0, 1 + up * up / (up + a), 1 / (1 + b * dr.log(1 + c * down)))
        return 2 / (2 + self.gamma * narrower)

    def eval(self, facet: Facet) -> mi.Float:
        power = cosine_power(facet.tan2_h, self.gamma)
        bent = expm1_ratio(self.kappa * power, *self.scaled) / self.integral
        return (self.gamma + 2) * dr.inv_two_pi * power * bent

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        m, s = cosine_power_cdf(facet.tan2_h, self.gamma)
        return (self.gamma + 2) * dr.inv_two_pi * s / facet.cos_h * self.law.eval(m, s)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        return self.law.cdf(*cosine_power_cdf(tan2, self.gamma))

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return inverse_cosine_power_cdf(self.law.inverse_cdf(c, complement), self.gamma + 2)


class EPD(Isotropic):
    """D = exp(-(tan²θ_h/α²)ᵞ) / (π α² Γ(1 + 1/γ) cos⁴θ_h), the exponential power distribution of slopes, of which γ = 1
    is Beckmann's (Holzschuch and Pacanowski 2017, doi:10.1145/3072959.3073621).

    q follows D cosθ_h, by ramps over a law that has a peak within tan²θ_h = α², as D has, and falls from where most
    facets are: the lower γ, the further is one from the other.
    """

    long_tailed = True
    # tests/calibration/epd.py fits these.
    FAR, GROWTH = 1.7, 1.44
    """How far the law reaches, in medians, and by which ratio, to the power of each of"""
    STEPS = (-28, -12, 0, 2, 4, 6, 12)
    """these, the slopes at which D is evaluated differ from that. The last is for the end of the last ramp: D is
    nothing at infinity."""

    def __init__(self, alpha: mi.Float, gamma: mi.Float) -> None:
        super().__init__()
        self.alpha, self.alpha2, self.gamma = alpha, dr.square(alpha), gamma
        # tan²θ_h is distributed as α² Γ^(1/γ), where Γ is Gamma-distributed with parameter 1/γ and median 1/γ - 1/3
        # (Chen and Rubin 1986, doi:10.1016/0167-7152(86)90044-1), nearly.
        median = self.alpha2 * dr.exp(dr.log(dr.maximum(1 / gamma - 1 / 3, 0.1)) / gamma)
        self.median, far = self._limited(median), self._limited(self.FAR * median)
        self.scale = dr.inv_pi / self.alpha2 * reciprocal_gamma(1 + 1 / gamma)

        self.law = law = RootLaw(dr.minimum(self.alpha2, 0.5 * far), far)
        # (tan²θ/α²)ᵞ at slopes in a geometric series is in another one.
        first, growth = dr.exp(gamma * dr.log(far / self.alpha2)), dr.exp(dr.log(self.GROWTH) * gamma)
        powers = [first * growth**step for step in self.STEPS]
        slopes = [far * self.GROWTH**step for step in self.STEPS]
        heights = [fall(x) * self._rest(t) / law.eval(t) for x, t in zip([0, *powers], [0, *slopes], strict=True)]
        self.ramps = Ramps([law.cdf(t) for t in slopes[:-1]], heights)

    def _limited(self, tan2: mi.Float) -> mi.Float:
        return dr.minimum(tan2, 1e16)  # of which derivatives take the square

    def _power(self, tan2: mi.Float) -> mi.Float:
        """(tan²θ/α²)ᵞ"""
        x = tan2 / self.alpha2
        # At the normal the derivative of a low power has no end; and exp(-exp(5)) is no float32.
        power = dr.exp(dr.minimum(self.gamma * dr.log(dr.maximum(x, 1e-24)), 5))
        return dr.select(x > 1e-24, power, 0)

    def _rest(self, tan2: mi.Float) -> mi.Float:
        """What D cosθ dω is proportional to, per tan²θ, but for that power."""
        return 1

    def mean_square_slope(self) -> mi.Float:
        return dr.minimum(self.median, 1)

    def roughness(self) -> mi.Float | None:
        return self.alpha

    def eval(self, facet: Facet) -> mi.Float:
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-12)  # the square of 1/cos², times 1/α², is a float32
        # 1/cos⁴ as a part of the exponent: its adjoint would overflow where the power makes up for it.
        return self.scale * dr.exp(-2 * dr.log(cos2) - self._power(facet.sin2_h / cos2))

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        slope = facet.sin2_h, dr.square(facet.cos_h)
        return dr.inv_pi * facet.cos_h * self.law.eval(*slope) * self.ramps.eval(self.law.cdf(*slope))

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        c = dr.minimum(self.ramps.cdf(self.law.cdf(dr.minimum(tan2, LARGEST_TAN2))), 1)
        return c, 1 - c

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return self.law.inverse_cdf(self.ramps.inverse_cdf(c))


def fall(x: mi.Float) -> mi.Float:
    """About exp(-x): to a few percent up to x = 10, as far as the median of low powers."""
    y = dr.minimum(x, 60) / 32
    return 1 / power_32(1 + y * (1 + 0.5 * y))[0]
