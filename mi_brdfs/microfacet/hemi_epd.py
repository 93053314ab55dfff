"""The hemispherical exponential power distribution."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import expm1_ratio
from ..parameters import Number
from .facet import Facet
from .laws import cosine_power, cosine_power_cdf, inverse_cosine_power_cdf, power_32, root_32
from .terms import Isotropic


class HemiEPD(Isotropic):
    """D = (γ+2)/(2π J) cosᵞθ_h e(κ cosᵞθ_h), e(x) = (exp(x) - 1)/x: the hemispherical exponential power distribution
    ∝ |exp(κ cosᵞθ_h) - 1| (Nishino and Lombardi 2011, doi:10.1364/JOSAA.28.000008). J = ∫ e(κ s^p) ds over 0 <= s <= 1,
    p = γ/(γ+2).

    With s = cosθ_h^(γ+2), D cosθ_h dω_h is e(κ s^p)/J ds. q takes the place of that by a law that falls as steeply at
    s = 1; their ratio is bounded.
    """

    word = "hepd"
    parameters = {
        "kappa": Number(-5, (-80, 80), "κ: below 0 the lobe has a flat top, above 0 a peak"),
        "gamma": Number(100, (0, 1e5), "exponent γ: the higher, the narrower the lobe"),
    }
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


class BentLaw:
    """A density on [0, 1] that square roots can invert: nearly ∝ exp(κ s) for κ >= 0, and nearly ∝ 1/(1 - κ s) for
    κ < 0. With powers in place of the exponential and the logarithm, it is (1 + k m)^-33 with k = κ/33, of the
    complement m = 1 - s, and (1 + k s)^(-33/32) with k = -κ. Its cumulative distribution begins at s = 1.

    Differences of powers are products (:func:`power_32`), which keep their digits and have their limit at k = 0."""

    def __init__(self, kappa: mi.Float) -> None:
        self.rises = kappa >= 0
        self.k = dr.select(self.rises, kappa / 33, -kappa)
        _, _, power, self.norm = self._at(1)
        self.lowest = 1 / power

    def _at(self, x: Any) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        """``(b, r, b³², mass)`` of an m or s: b = 1 + k x, the base r is b or its root, and the mass from 0 to x is not
        normalised."""
        b = 1 + self.k * x
        base = dr.select(self.rises, b, root_32(b))
        power, quotient = power_32(base)
        return b, base, power, x * dr.select(self.rises, quotient / power, 1 / (base * quotient))

    def eval(self, m: mi.Float, s: mi.Float) -> mi.Float:
        b, base, power, _ = self._at(dr.select(self.rises, m, s))
        return dr.select(self.rises, 32 / power, 1 / (32 * base)) / (b * self.norm)

    def cdf(self, m: mi.Float, s: mi.Float) -> tuple[mi.Float, mi.Float]:
        """``(c, 1 - c)``, where c is the mass above s."""
        mass = dr.minimum(self._at(dr.select(self.rises, m, s))[-1] / self.norm, 1)  # rounded, it may be more
        return dr.select(self.rises, mass, 1 - mass), dr.select(self.rises, 1 - mass, mass)

    def inverse_cdf(self, c: mi.Float, complement: mi.Float) -> mi.Float:
        """The s of a ``cdf`` value."""
        rest = complement * self.k * self.norm
        # Of 1/b where it rises, and of b.
        root = dr.select(self.rises, root_32(self.lowest + rest), 1 / (1 - dr.select(self.rises, 0, rest)))
        _, quotient = power_32(root)
        return dr.select(self.rises, 1 - c * self.norm / (root * quotient), complement * self.norm * root * quotient)
