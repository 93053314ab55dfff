"""Where light goes on a rough surface: how much of it escapes at the first reflection, at the second and later, and
what it meets before. Polynomials fitted to walks on Smith's surfaces, which tests/calibration/escape.py makes.

A walk is that of E. Heitz, J. Hanika, E. d'Eon and C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith
model, ACM Transactions on Graphics 35(4), 2016, doi:10.1145/2897824.2925943. What it does depends on a direction by its
cosine c in the space stretched by α, in which grazing angles of smooth surfaces take as much of the axis as those of
rough ones, and by the roughness along it, α∥² = (αu cosφ)² + (αv sinφ)². The polynomials are in

    1 - c,  x(α∥),  (x(αu) + x(αv))/2,  (x(αu) - x(αv))²,  where x(α) = α/√(1 + α²);

the last two are the same for all directions, and facets are the same after both axes are exchanged.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import EPSILON
from .shadowing import Smith

FILE = Path(__file__).with_name("escape.npz")


class Escape(NamedTuple):
    """What becomes of light that comes from a direction, if facets reflect all of it."""

    lost: mi.Float
    """1 - E: what does not escape at the first reflection."""
    second: mi.Float
    """The part of that which escapes at the second."""
    schlick: mi.Float
    """The mean of (1 - cosθ_d)⁵ at the first reflection of what does not escape at it, and"""
    dip: mi.Float
    """of cosθ_d (1 - cosθ_d)⁶; see :meth:`.terms.Fresnel.mean`."""


class MeanEscape(NamedTuple):
    """The means over the hemisphere of directions, weighed by the light that reaches a reflection."""

    lost: mi.Float
    second: mi.Float
    third: mi.Float
    """The part that escapes at the third and, about, at each later reflection of what reaches it."""
    schlick: mi.Float
    """The mean of (1 - cosθ_d)⁵ at reflections between the first and the last, and"""
    dip: mi.Float
    """of cosθ_d (1 - cosθ_d)⁶."""


class Walks:
    """What becomes of light on a surface with Smith's term."""

    def __init__(self, smith: Smith) -> None:
        self.smith = smith
        u, v = _compressed(smith.alpha_u), _compressed(smith.alpha_v)
        # Without the difference where there is none, polynomials have half the terms, or fewer.
        isotropic = smith.alpha_u is smith.alpha_v
        mean, difference2 = (u, 0) if isotropic else (0.5 * (u + v), dr.square(u - v))
        fitted = coefficients(f"{smith.facets}-{'correlated' if smith.correlated else 'separable'}", isotropic)
        at = (mean, difference2)[: 1 if isotropic else 2]
        self.towards = [[[polynomial(k, *at) for k in row] for row in fitted[name]] for name in Escape._fields]
        at = (dr.sqrt(mean), difference2 / dr.maximum(dr.square(mean), EPSILON))[: len(at)]
        lost, *others = (polynomial(fitted[f"mean-{name}"], *at) for name in MeanEscape._fields)
        self.mean = MeanEscape(0.5 * (u * u + v * v) * lost, *others)

    def of(self, v: mi.Vector3f) -> Escape:
        """Return what becomes of light from a direction."""
        slope2, sin2 = self.smith.slope2(v), dr.maximum(v.x * v.x + v.y * v.y, EPSILON)
        at = (
            1 - v.z * dr.rsqrt(dr.maximum(v.z * v.z + slope2, EPSILON)),
            dr.sqrt(dr.maximum(slope2, EPSILON) / (sin2 + slope2)),
        )
        lost, second, schlick, dip = (polynomial(k, *at) for k in self.towards)
        # Fits err where next to nothing is lost: there the lobe must not vanish.
        return Escape(dr.clip(lost, 0.01 * self.mean.lost, 1), dr.clip(second, 0, 1), schlick, dip)


def polynomial(k: Any, *at: Any) -> Any:
    """Return Σ k[i][j]… xⁱ yʲ … at x, y, …, without terms that only vanish."""
    if not at:
        return k if dr.is_array_v(k) else float(k)
    total: Any = 0.0
    for row in reversed(k):
        value = polynomial(row, *at[1:])
        total = value if isinstance(total, float) and not total else dr.fma(total, at[0], value)
    return total


@functools.cache
def coefficients(name: str, isotropic: bool) -> dict[str, np.ndarray]:
    """Return the polynomials of a Smith term by what they say. The axes are those of the variables, without the last,
    and with one for the third and the second, which are then the same, if ``isotropic``."""
    with np.load(FILE) as data:
        fitted = {key.partition(":")[2]: data[key] for key in data if key.partition(":")[0] == name}
    if not isotropic:
        return fitted
    merged = {}
    for key, k in fitted.items():
        k = k[..., 0]
        if k.ndim == 3:
            sums = np.zeros((len(k), 1, k.shape[1] + k.shape[2] - 1))
            for j in range(k.shape[1]):
                sums[:, 0, j : j + k.shape[2]] += k[:, j]
            k = sums
        merged[key] = k
    return merged


def _compressed(alpha: Any) -> Any:
    return alpha * dr.rsqrt(1 + alpha * alpha)
