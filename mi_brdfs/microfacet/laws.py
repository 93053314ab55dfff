"""Laws of one variable that can be inverted, of which the densities of half vectors are made."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, ONE_MINUS_EPSILON, SMALL, clamp, expm1, expm1_ratio, log1p, log1p_ratio, safe_sqrt

LARGEST_TAN2 = 1e30
"""tan²θ at the horizon: infinity would leave NaN."""


class PowerLaw:
    """The density ∝ (1 + k s)^-γ for s >= 0 (to 1, where k < 0): with x = 1-γ and L = log(1 + k s), its integral is
    (exp(x L) - 1)/(x k), where every ratio has its limit at x = 0 and k = 0. ``norm`` is the integral to 1."""

    def __init__(self, k: mi.Float, gamma: mi.Float) -> None:
        self.k, self.gamma, self.x = k, gamma, 1 - gamma
        self.norm = self.mass(1)

    def eval(self, s: mi.Float) -> mi.Float:
        return dr.exp(-self.gamma * log1p(self.k * s))

    def mass(self, s: mi.Float) -> mi.Float:
        """∫ (1 + k s)^-γ from 0 to s."""
        logarithm = s * log1p_ratio(self.k * s)
        return logarithm * expm1_ratio(self.x * self.k * logarithm)

    def inverse(self, mass: mi.Float) -> mi.Float:
        """The s of a ``mass``."""
        z = self.x * self.k * mass
        logarithm = mass * log1p_ratio(dr.maximum(z, -ONE_MINUS_EPSILON))
        return logarithm * expm1_ratio(self.k * logarithm)


class BentLaw:
    """A density on [0, 1] that can be inverted: ∝ exp(κ s) for κ >= 0, and ∝ 1/(1 - κ s) for κ < 0. Its cumulative
    distribution begins at s = 1, and s comes with its complement m = 1 - s. Of a number and its complement the smaller
    one is computed, by the formula that keeps its digits."""

    def __init__(self, kappa: mi.Float) -> None:
        self.rises = kappa >= 0
        self.kappa, self.k = dr.select(self.rises, kappa, 0), dr.select(self.rises, 0, -kappa)
        # Of exp(-κ m): exp(κ s) leaves the range of float32, or its derivative does.
        self.norm = dr.select(self.rises, expm1_ratio(-self.kappa), log1p_ratio(self.k))

    def eval(self, m: mi.Float, s: mi.Float) -> mi.Float:
        return dr.select(self.rises, dr.exp(-self.kappa * m), 1 / (1 + self.k * s)) / self.norm

    def cdf(self, m: mi.Float, s: mi.Float) -> tuple[mi.Float, mi.Float]:
        """``(c, 1 - c)``, where c is the mass above s."""
        above = (m < 0.5) & (self.kappa * m < 0.7)
        up, down = m / (1 + self.k), s
        weight = dr.select(above, m, s * dr.exp(-self.kappa * m))
        exponential = expm1_ratio(-self.kappa * dr.select(above, m, s)) * weight
        rational = log1p_ratio(dr.select(above, -up, down) * self.k) * dr.select(above, up, down)
        mass = dr.select(self.rises, exponential, rational) / self.norm
        return dr.select(above, mass, 1 - mass), dr.select(above, 1 - mass, mass)

    def inverse_cdf(self, c: mi.Float, complement: mi.Float) -> mi.Float:
        """The s of a ``cdf`` value."""
        above = c < 0.5
        mass = dr.select(above, c, complement)
        y = mass * self.norm * dr.select(above, 1, dr.exp(self.kappa))
        sign = dr.select(above, -1, 1)
        # log(1 + κ y)/κ, but a large exp(κ) out of the logarithm: a derivative divides by its square.
        large = (c >= 0.5) & (self.kappa * y > 1e8)
        exponential = log1p_ratio(dr.select(large, 0, sign * self.kappa * y))
        rational = expm1_ratio(sign * self.k * y) * dr.select(above, 1 + self.k, 1)
        value = y * dr.select(self.rises, exponential, rational)
        kappa = dr.select(large, self.kappa, 1)
        value = dr.select(large, 1 + dr.log(dr.select(large, kappa * mass * self.norm, 1)) / kappa, value)
        return dr.select(above, 1 - value, value)


class Ramps:
    """A density on [0, 1], linear between equally spaced points, at which the ``heights`` are given up to a factor."""

    def __init__(self, heights: list[Any]) -> None:
        highest = functools.reduce(dr.maximum, heights)
        heights = [dr.maximum(height, SMALL * highest) for height in heights]  # it must not vanish
        self.ramps = list(itertools.pairwise(heights))
        self.masses = [0.5 * (left + right) for left, right in self.ramps]
        self.sum = sum(self.masses)
        self.total = self.sum / len(self.ramps)

    def eval(self, c: mi.Float) -> mi.Float:
        c = c * len(self.ramps)
        left, right = self.ramps[0]
        for k, (next_left, next_right) in enumerate(self.ramps[1:], start=1):
            left, right = dr.select(c < k, left, next_left), dr.select(c < k, right, next_right)
        share = c - dr.clip(dr.floor(c), 0, len(self.ramps) - 1)
        return dr.lerp(left, right, share) / self.total

    def cdf(self, c: mi.Float) -> mi.Float:
        shares = (dr.clip(c * len(self.ramps) - k, 0, 1) for k in range(len(self.ramps)))
        ramps = zip(self.ramps, self.masses, shares, strict=True)
        return sum(share * dr.lerp(left, mass, share) for (left, _), mass, share in ramps) / self.sum

    def inverse_cdf(self, mass: mi.Float) -> mi.Float:
        remaining, c = mass * self.sum, 0
        for (left, right), mass in zip(self.ramps, self.masses, strict=True):
            here = dr.clip(remaining, 0, mass)
            # Rounded, the square of the height there may be less than 0.
            c += 2 * here / (left + safe_sqrt(left * left + 2 * (right - left) * here))
            remaining -= mass
        return c / len(self.ramps)


class RootLaw:
    """The cumulative distribution ∝ √r - √(near/far), r = (t + near)/(t + far), of t >= 0. The density falls like 1/√t
    from ``near`` to ``far``, and beyond like 1/t². A t up to infinity is given as a ratio x/y."""

    def __init__(self, near: mi.Float, far: mi.Float) -> None:
        self.near, self.far = near, far
        self.lowest = dr.sqrt(near / far)

    def eval(self, x: mi.Float, y: mi.Float = 1) -> mi.Float:
        """The density over y²."""
        outer = x + self.far * y
        return 0.5 * (1 + self.lowest) * self.far / (dr.square(outer) * dr.sqrt((x + self.near * y) / outer))

    def cdf(self, x: mi.Float, y: mi.Float = 1) -> mi.Float:
        return (dr.sqrt((x + self.near * y) / (x + self.far * y)) - self.lowest) / (1 - self.lowest)

    def inverse_cdf(self, c: mi.Float) -> mi.Float:
        """The t."""
        root = self.lowest + c * (1 - self.lowest)
        return dr.minimum(
            self.far * (c * (root + self.lowest) / dr.maximum((1 - c) * (1 + root), EPSILON)), LARGEST_TAN2
        )


def versine(cos: mi.Float, sin2: mi.Float) -> mi.Float:
    """1 - cosθ."""
    return sin2 / (1 + cos)


def versine_of_tan2(tan2: mi.Float) -> mi.Float:
    """1 - cosθ of tan²θ, for tan²θ up to infinity."""
    cos = dr.rsqrt(1 + tan2)
    return dr.select(tan2 < 1, dr.minimum(tan2, 1) * cos * cos / (1 + cos), 1 - cos)


def tan2_of_versine(v: mi.Float) -> mi.Float:
    """tan²θ of 1 - cosθ, limited at the horizon."""
    v = clamp(v, 0, ONE_MINUS_EPSILON)
    return v * (2 - v) / dr.square(1 - v)


def cosine_power(tan2: mi.Float, power: mi.Float) -> mi.Float:
    """cosθ^power."""
    return dr.exp(-0.5 * power * log1p(dr.minimum(tan2, LARGEST_TAN2)))


def cosine_power_cdf(tan2: mi.Float, power: mi.Float) -> tuple[mi.Float, mi.Float]:
    """``(C, 1 - C)`` for 1 - C = cosθ^power·cos²θ; Dr.Jit computes a power that D has, too, once."""
    complement = cosine_power(tan2, power) / (1 + dr.minimum(tan2, LARGEST_TAN2))
    return 1 - complement, complement


def inverse_cosine_power_cdf(complement: mi.Float, power: mi.Float) -> mi.Float:
    """The tan²θ of the complement of a ``cosine_power_cdf`` value."""
    return dr.minimum(expm1(log_complement(complement) * (-2 / power)), LARGEST_TAN2)


def log_complement(complement: mi.Float) -> mi.Float:
    """log(1 - c) of the complement 1 - c. Where c has more digits it is 1e-7 off: so little that no sample shows it."""
    return dr.log(dr.maximum(complement, 1e-37))  # about the least float32
