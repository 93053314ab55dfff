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
    """A density on [0, 1] that square roots can invert: nearly ∝ exp(κ s) for κ >= 0, and nearly ∝ 1/(1 - κ s) for
    κ < 0. With powers in place of the exponential and the logarithm, it is (1 + k m)^-33 with k = κ/33, of the
    complement m = 1 - s, and (1 + k s)^(-33/32) with k = -κ. Its cumulative distribution begins at s = 1.

    Differences of powers are products (:func:`power_32`), which keep their digits and have their limit at k = 0."""

    def __init__(self, kappa: mi.Float) -> None:
        self.rises = kappa >= 0
        self.k = dr.select(self.rises, kappa / 33, -kappa)
        _, _, power, self.norm = self._at(1)
        self.lowest = 1 / power

    def _at(self, x: mi.Float) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
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


class Ramps:
    """A density on [0, 1], linear between its ends and some ``points``, at all of which the ``heights`` are given up to
    a factor."""

    def __init__(self, points: list[Any], heights: list[Any]) -> None:
        highest = functools.reduce(dr.maximum, heights)
        self.least = SMALL * highest
        """It must not vanish, also where an end of a ramp is rounded."""
        heights = [dr.maximum(height, self.least) for height in heights]
        self.ramps: list[tuple[Any, ...]] = []
        """Of each ramp its left end, the mass up to there, and its height there and slope."""
        self.total = 0
        for (start, end), (left, right) in zip(
            itertools.pairwise([0, *points, 1]), itertools.pairwise(heights), strict=True
        ):
            self.ramps.append((start, self.total, left, (right - left) / (end - start)))
            self.total = self.total + 0.5 * (left + right) * (end - start)  # anew, as the last one is kept

    def _ramp(self, x: mi.Float, coordinate: int) -> tuple[Any, ...]:
        """The ramp of an x, which is compared with its left end, 0, or the mass up to there, 1."""
        found, *others = self.ramps
        for ramp in others:
            here = x >= ramp[coordinate]
            found = tuple(dr.select(here, *it) for it in zip(ramp, found, strict=True))
        return found

    def eval(self, c: mi.Float) -> mi.Float:
        start, _, height, slope = self._ramp(c, 0)
        return dr.maximum(height + (c - start) * slope, self.least) / self.total

    def cdf(self, c: mi.Float) -> mi.Float:
        start, mass, height, slope = self._ramp(c, 0)
        return (mass + (c - start) * (height + 0.5 * (c - start) * slope)) / self.total

    def inverse_cdf(self, mass: mi.Float) -> mi.Float:
        start, before, height, slope = self._ramp(mass * self.total, 1)
        rest = mass * self.total - before
        # Rounded, the square of the height there may be less than 0.
        return start + 2 * rest / (height + safe_sqrt(height * height + 2 * slope * rest))


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


def root_32(x: mi.Float) -> mi.Float:
    """The 32nd root."""
    for _ in range(5):
        x = dr.sqrt(x)
    return x


def power_32(x: mi.Float) -> tuple[mi.Float, mi.Float]:
    """``(x³², (x³² - 1)/(x - 1))``."""
    power, quotient = x, 1.0
    for _ in range(5):
        quotient, power = quotient * (1 + power), power * power
    return power, quotient


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
