"""Laws of one variable that can be inverted, of which the densities of half vectors are made."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import ONE_MINUS_EPSILON, clamp, expm1, expm1_ratio, log1p, log1p_ratio

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
