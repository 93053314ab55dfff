"""The exponential power distribution of slopes."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, reciprocal_gamma, safe_sqrt
from ..parameters import Number
from .facet import Facet
from .laws import LARGEST_TAN2, power_32
from .terms import ROUGHNESS, Distribution, Isotropic, widened_roughness


class EPD(Isotropic):
    """D = exp(-(tan²θ_h/α²)ᵞ) / (π α² Γ(1 + 1/γ) cos⁴θ_h), the exponential power distribution of slopes, of which γ = 1
    is Beckmann's (Holzschuch and Pacanowski 2017, doi:10.1145/3072959.3073621).

    q follows D cosθ_h, by ramps over a law that has a peak within tan²θ_h = α², as D has, and falls from where most
    facets are: the lower γ, the further is one from the other.
    """

    word = "epd"
    parameters = {"alpha": ROUGHNESS, "gamma": Number(1, (0.1, 4), "exponent γ: the lower, the longer the tail")}
    long_tailed = True
    # tests/calibration/half_vectors.py fits these.
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

    def widened(self, spread: mi.Float) -> Distribution:
        return EPD(widened_roughness(self.alpha, spread), self.gamma)

    def _limited(self, tan2: mi.Float) -> mi.Float:
        return dr.minimum(tan2, 1e16)  # of which derivatives take the square

    def _power(self, tan2: mi.Float) -> mi.Float:
        """(tan²θ/α²)ᵞ"""
        x = tan2 / self.alpha2
        # At the normal the derivative of a low power has no end; and exp(-exp(5)) is no float32.
        power = dr.exp(dr.minimum(self.gamma * dr.log(dr.maximum(x, 1e-24)), 5))
        return dr.select(x > 1e-24, power, 0)

    def _rest(self, tan2: mi.Float) -> Any:
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
