"""Where light goes on a rough surface: how much of it escapes at the first reflection, at the second and later, and
what it meets before. Polynomials for walks on Smith's surfaces, which tests/calibration/escape.py fits and tabulates.

A walk is that of E. Heitz, J. Hanika, E. d'Eon and C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith
model, ACM Transactions on Graphics 35(4), 2016, doi:10.1145/2897824.2925943. On given facets, what it does depends on a
direction v: the polynomials for what is lost are in

    x = 2 v_z/(v_z + k (l - v_z)) - 1,     l² = v_z² + (αu v_x)² + (αv v_y)²,
    y = (α² - αu αv)/(α² + SKEW αu αv),    α² = ((αu v_x)² + (αv v_y)²)/(v_x² + v_y²).

v_z/l is the cosine in the space stretched by α, in which grazing angles of smooth surfaces take as much of the axis as
those of rough ones, and α the roughness along the direction: on isotropic facets there is x alone. The coefficients are
tabulated by the larger one of αu and αv and the ratio of the other one to it.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import aligned
from .shadowing import Smith

FILE = Path(__file__).with_name("escape.npz")
ROUGHEST = 3.2
"""The largest tabulated α: that of Burley's most anisotropic facets."""
UPRIGHT = 1e-3
"""The sin²θ below which the azimuth counts less and less: what is tabulated changes little with it there."""
SKEW = 0.2
"""The smaller it is, the more of y is for the smooth axis of facets of extreme anisotropy."""
BENDS = {"ggx": ((5, 4), (3, 8)), "beckmann": ((6, 4), (6, 4)), "blinn": ((3, 8), (3, 8))}
"""Numbers c and d of k = c/(1 + d (αu² + αv²)/2), for the separable and the correlated term, by which polynomials of
low degree do."""
COUNTS = {
    "lost": (7, 5, 3), "root": (1,), "second": (3, 2), "schlick": (4, 2), "means": (3,), "dip": (4, 2),
    "mean dips": (2,),
}  # fmt: skip
"""How many entries the table has: for each polynomial, the coefficients of those by which 1, y, y² … are multiplied, in
x for what is lost, and in 1 - cosθ for the others, where :func:`evened` y takes the place of y, with a factor 1 - cosθ;
and for the means, the root of what is lost first. Eight in a row are looked up together, if one of them is needed."""
ISOTROPIC = np.concatenate([np.arange(sum(counts)) < counts[0] for counts in COUNTS.values()])
"""Which of them isotropic facets have."""


class Escape(NamedTuple):
    """What becomes of light that comes from a direction, if facets reflect all of it."""

    lost: mi.Float
    """1 - E: what does not escape at the first reflection."""
    second: mi.Float
    """The part of that which escapes at the second, less half of its mean."""
    schlick: mi.Float
    """The mean of (1 - cosθ_d)⁵ at the first reflection of what does not escape at it, and what those at later ones
    differ by from their own mean,"""
    dip: mi.Float
    """and of cosθ_d (1 - cosθ_d)⁶; see :meth:`.terms.Fresnel.mean`."""


class MeanEscape(NamedTuple):
    """The means over the hemisphere of directions, weighed by the light that reaches a reflection."""

    lost: mi.Float
    third: mi.Float
    """The part that escapes at the third and, about, at each later reflection of what reaches it."""
    schlick: mi.Float
    dip: mi.Float
    """Those of :class:`Escape`."""
    between: tuple[mi.Float, mi.Float]
    """The means of both at reflections between the first and the last."""


class Walks:
    """What the :func:`table` says of walks on a surface with Smith's term."""

    def __init__(self, smith: Smith, table: Any, uniform: Callable[[str, Any], Any]) -> None:
        u, v = smith.alpha_u, smith.alpha_v
        self.smith, self.isotropic = smith, u is v
        # Where both are the same, derivatives are those for a larger u, as of facets that are stretched along dp_du …
        largest, smallest = dr.select(u < v, v, u), dr.select(u < v, u, v)
        at = [dr.sqrt((1 + 1 / ROUGHEST) * largest / (1 + largest))]
        if not self.isotropic:
            at.append((1 - 1e-6) * dr.sqrt(dr.sqrt(smallest / largest)))  # … and not 0, as beyond the last texel
        most, falling = BENDS[smith.facets][smith.correlated]
        bend = most * dr.rcp(1 + 0.5 * falling * (u * u + v * v))
        (self.bend,) = uniform("bend", (bend,))
        # Outer texels have their centres at 0 and 1.
        texels = [(x * (count - 1) + 0.5) / count for x, count in zip(at, table.shape[-2::-1], strict=True)]
        self.rows, left = {}, iter(uniform("walks", table.eval(texels)))
        for name, counts in COUNTS.items():
            self.rows[name] = [list(itertools.islice(left, n)) for n in counts[: 1 if self.isotropic else None]]
        (root,), (third, schlick, end), dips = (self.rows[name][0] for name in ("root", "means", "mean dips"))
        self.mean = MeanEscape(dr.square(root), third, end, dips[1], (schlick, dips[0]))

    def of(self, v: mi.Vector3f) -> Escape:
        """Return what becomes of light from a direction."""
        bent = v.z + self.bend * (self.smith.length(v) - v.z)
        if self.isotropic:
            x, y = 2 * v.z * dr.rcp(bent) - 1, 0
        else:
            # Towards the normal, which has no azimuth, y goes to 0. Both variables take one division.
            along2, sin2, mean2 = self.smith.slope2(v), v.x * v.x + v.y * v.y, self.smith.alpha_u * self.smith.alpha_v
            divisor = (along2 + mean2 * (SKEW * sin2 + UPRIGHT)) * (sin2 + UPRIGHT)
            inverse = dr.rcp(bent * divisor)
            x, y = 2 * v.z * (divisor * inverse) - 1, (along2 - mean2 * sin2) * sin2 * (bent * inverse)
        lost = horner([horner(row, x) for row in self.rows["lost"]], y)
        # The others change with the angle itself, and at the normal not with the azimuth.
        versine, others = 1 - v.z, []
        skewed = versine * evened(y)
        for name in Escape._fields[1:]:
            first, *rest = (horner(row, versine) for row in self.rows[name])
            others.append(dr.fma(skewed, rest[0], first) if rest else first)
        return Escape(dr.maximum(lost, 0), *others)


def evened(y: Any) -> Any:
    """Return (α² - αu αv)/(α² + αu αv), y for a SKEW of 1, in which the light that is left changes evenly."""
    return (1 + SKEW) * y / (2 - (1 - SKEW) * y)


def horner(coefficients: Sequence[Any], x: Any) -> Any:
    """Return Σ coefficients[k] xᵏ."""
    return functools.reduce(lambda total, k: dr.fma(total, x, k), reversed(coefficients))


def table(smith: Smith) -> Any:
    """Return the table for one of Smith's terms, as a texture of the active variant: of the largest α, and if the
    facets are anisotropic, of the ratio."""
    with np.load(FILE) as data:
        entries = data[f"{smith.facets}-{'correlated' if smith.correlated else 'separable'}"]
    kind = mi.Texture2f
    if smith.alpha_u is smith.alpha_v:
        kind, entries = mi.Texture1f, entries[-1][:, ISOTROPIC]
    values = np.pad(entries, [(0, 0)] * (entries.ndim - 1) + [(0, -entries.shape[-1] % 8)])
    # Accelerated look-ups of CUDA would interpolate with eight bits.
    return kind(aligned(mi.TensorXf(np.float32(values))), use_accel=False, wrap_mode=dr.WrapMode.Clamp)
