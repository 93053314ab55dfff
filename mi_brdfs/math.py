"""Float32-stable primitives.

Narrow lobes live in the last bits of a cosine: (N·H)^n at n = 1e5, or a GGX peak at alpha = 1e-3, lose all their digits
when computed from N·H itself. The functions below take quantities that keep their digits, such as sin²θ or |i - R|².
They work on every variant's floats and spectra, and their derivatives are finite wherever their values are. To that end
no divisor falls below one of three values, chosen so that a power of it is still a float32.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np

Spectrum: TypeAlias = "mi.UnpolarizedSpectrum | mi.Float"
"""A colour, or what is the same in all of its channels."""

ONE_MINUS_EPSILON = 1 - 2**-24
"""The largest float32 below one: uniform variates are clamped to it."""
TINY = 1e-30
"""The least square, argument of a logarithm or power, or divisor that only sampling uses."""
EPSILON = 1e-15
"""The least divisor, such as a cosine or a density: the derivative of a quotient divides by its square."""
SMALL = 1e-9
"""The least length, or other divisor that derivatives take up to the fourth power."""


def select(mask: Any, a: Any, b: Any) -> Any:
    """Return ``dr.select``, without its cost for vectors if the mask is a bool, as in scalar variants."""
    if isinstance(mask, bool):
        return a if mask else b
    return dr.select(mask, a, b)


def clamp(x: Any, low: float, high: float) -> Any:
    """Return x limited to [low, high]. Unlike that of ``dr.clip``, its derivative keeps an optimised parameter from
    getting stuck: at a limit it is one, and from beyond a limit gradient descent is led back.

    Backward derivatives beyond a limit pass if a step against them leads back, and vanish if it leads further out.
    Forward ones, which do not know where a loss falls, are those at the limit.
    """
    if dr.is_diff_v(x) and dr.grad_enabled(x):
        return dr.custom(_Clamp, dr.maximum(x, -dr.inf), float(low), float(high))
    return _limited(x, low, high)


def in_lanes(x: Any, lanes: Any) -> Any:
    """Return x, and where its derivatives are sought, with as many lanes as the array ``lanes``: what is the same in
    all of them sums its derivatives over them after each operation, in a kernel that computes all before it again."""
    return x + dr.zeros(mi.Float, dr.width(lanes)) if dr.is_diff_v(x) and dr.grad_enabled(x) else x


def _limited(x: Any, low: Any, high: Any) -> Any:
    return dr.minimum(dr.maximum(x, float(low)), float(high))


class _Clamp(dr.CustomOp):
    def eval(self, x: Any, low: Any, high: Any) -> Any:
        self.below, self.above = x < low, x > high
        return _limited(x, low, high)

    def forward(self) -> None:
        self.set_grad_out(self.grad_in("x"))

    def backward(self) -> None:
        grad = self.grad_out()
        outward = (self.below & (grad > 0)) | (self.above & (grad < 0))
        self.set_grad_in("x", dr.select(outward, 0, grad))

    def name(self) -> str:
        return "clamp"


def leaving(limit: Any, inside: Any, function: Callable[..., Any], *parameters: Any) -> Any:
    """Return a function of parameters of at least ``limit``, where its derivatives for them vanish. They are replaced
    there by those at ``inside``: otherwise an optimisation that comes to the limit,
    or goes beyond, would stay there."""
    if not any(dr.is_diff_v(x) and dr.grad_enabled(x) for x in parameters):
        return function(*parameters)
    moved, kept = [], []
    for x in parameters:
        value = dr.detach(x)
        there = value <= limit
        moved.append(dr.select(there, dr.replace_grad(type(x)(inside), x), value))
        kept.append(dr.select(there, value, x))
    with dr.suspend_grad(), dr.resume_grad(*moved):
        slope = function(*moved)
    return function(*kept) + dr.replace_grad(type(slope)(0), slope)


def square(x: Any) -> Any:
    """Return x² of a parameter limited to x >= 0."""
    return leaving(0, 0.3, dr.square, x)


def log1p(x: Any) -> Any:
    """Return log(1 + x), accurate to a few ulp for x > -1, and -inf at x = -1."""
    small = abs(x) < 0.5
    near, far = dr.select(small, x, 0), dr.select(small, 1, x)
    return dr.select(small, near * log1p_series(near), dr.log(1 + far))


def expm1(x: Any) -> Any:
    """Return exp(x) - 1, accurate to a few ulp."""
    small = abs(x) < 0.5
    near = dr.select(small, x, 0)
    return dr.select(small, near * expm1_series(near), dr.exp(dr.select(small, 0, x)) - 1)


def log1p_ratio(x: Any) -> Any:
    """Return log(1 + x)/x, and its limit 1 at x = 0."""
    small = abs(x) < 0.5
    near, far = dr.select(small, x, 0), dr.select(small, 1, x)
    return dr.select(small, log1p_series(near), dr.log(1 + far) / far)


def expm1_ratio(x: Any, shift: Any = 0, scale: Any = 1) -> Any:
    """Return (exp(x) - 1)/x, and its limit 1 at x = 0, times ``scale`` = exp(-``shift``)."""
    small = abs(x) < 0.5
    near, far = dr.select(small, x, 0), dr.select(small, 1, x)
    return dr.select(small, expm1_series(near) * scale, (dr.exp(far - shift) - scale) / far)


def log1p_series(x: Any) -> Any:
    """Return log(1 + x)/x for |x| <= 0.5: log(1 + x) = 2 atanh(y) with |y| <= 1/3, so the next term is below 1e-8."""
    half = 1 / (2 + x)
    y2 = dr.square(x * half)
    return 2 * half * (1 + y2 * (1 / 3 + y2 * (1 / 5 + y2 * (1 / 7 + y2 * (1 / 9 + y2 * (1 / 11 + y2 / 13))))))


def expm1_series(x: Any) -> Any:
    """Return (exp(x) - 1)/x for |x| <= 0.5; the next term is below 1e-8."""
    return 1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6 * (1 + x / 7 * (1 + x / 8))))))


def reciprocal_gamma(x: Any) -> Any:
    """Return 1/Γ(x) for x >= 1, accurate to a few ulp of log Γ(x): Γ(x + 3)/(x (x + 1)(x + 2)), and of that Stirling's
    series, whose next term is below 1e-7."""
    y = x + 3
    inverse = 1 / y
    inverse2 = dr.square(inverse)
    series = inverse * (1 / 12 - inverse2 * (1 / 360 - inverse2 / 1260))
    log_gamma = (y - 0.5) * dr.log(y) - y + 0.5 * math.log(2 * math.pi) + series
    return x * (x + 1) * (x + 2) * dr.exp(-log_gamma)


def safe_sqrt(x: Any) -> Any:
    """Return sqrt(x), and 0 for x <= 0, with derivative 0 there."""
    positive = x > 0
    return dr.select(positive, dr.sqrt(dr.select(positive, x, 1)), 0)


def sin_theta(w: mi.Vector3f) -> Any:
    """Return sinθ with the digits that 1 - cos²θ loses near the normal; at least EPSILON, with derivative 0 there."""
    return dr.sqrt(dr.maximum(w.x * w.x + w.y * w.y, TINY))


def unit(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the 2-vector (x, y) scaled to length one, or (1, 0) where its length is below 1e-12."""
    length2 = x * x + y * y
    valid = length2 > 1e-24  # the derivative takes its power -3/2
    scale = dr.rsqrt(dr.select(valid, length2, 1))
    return dr.select(valid, x * scale, 1), dr.select(valid, y * scale, 0)


def choose(u: Any, probability: mi.Float) -> tuple[Any, Any]:
    """Return ``(chosen, u')``: whether an event of the given probability happens, decided by the uniform variate ``u``,
    and a fresh uniform variate rescaled from it."""
    chosen = u < probability
    left = dr.select(chosen, u, u - probability)
    left = left / dr.maximum(dr.select(chosen, probability, 1 - probability), TINY)
    return chosen, dr.minimum(left, ONE_MINUS_EPSILON)


@functools.cache
def gauss_legendre(count: int) -> list[tuple[float, float]]:
    """Return the nodes and weights of Gauss-Legendre quadrature on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return [(float(0.5 * (1 + x)), float(0.5 * w)) for x, w in zip(nodes, weights, strict=True)]


def luminance(colour: Any) -> Any:
    """Return the brightness of a reflectance as one number: its luminance in rgb variants, its mean over the
    wavelengths in the others (with four wavelengths the CIE weights may all vanish, and a zero here would starve a
    lobe)."""
    colour = mi.UnpolarizedSpectrum(colour)
    # Not dr.mean, which makes the number of lanes a constant of the kernel.
    return mi.luminance(colour) if mi.is_rgb else dr.sum(colour) / len(colour)


def aligned(array: Any) -> Any:
    """Return an array that uses NumPy's memory in Dr.Jit's own, which is aligned: for what is not, by chance, it has
    other kernels, and looks up channels one by one."""
    own = array * dr.opaque(mi.Float, 1)
    dr.eval(own)
    return own
