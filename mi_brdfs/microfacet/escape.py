"""Where light goes on a rough surface: how much of it escapes at the first reflection, at the second and later, and
what it meets before. Polynomials for walks on Smith's surfaces, which tests/calibration/escape.py fits and tabulates.

A walk is that of E. Heitz, J. Hanika, E. d'Eon and C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith
model, ACM Transactions on Graphics 35(4), 2016, doi:10.1145/2897824.2925943. On given facets, what it does depends on a
direction v: the polynomials for what is lost are in

    x = v_z/(v_z + k (l - v_z)),  l² = v_z² + (αu v_x)² + (αv v_y)²,
    y = α²/(α² + αu αv/2),        α² = ((αu v_x)² + (αv v_y)²)/(v_x² + v_y²),

each moved and scaled to [-1, 1]. v_z/l is the cosine in the space stretched by α, in which grazing angles of smooth
surfaces take as much of the axis as those of rough ones, and α the roughness along the direction: on isotropic facets
there is x alone. The coefficients are tabulated by the larger one of αu and αv and the ratio of the other one to it.
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

from .shadowing import Smith

FILE = Path(__file__).with_name("escape.npz")
ROUGHEST = 3.2
"""The largest tabulated α: that of Burley's most anisotropic facets."""
UPRIGHT = 1e-3
"""The sin²θ below which the azimuth counts less and less: what is tabulated changes little with it there."""
COUNTS = {
    "lost": (7, 6, 4, 3), "mean": (5,), "bend": (1,), "second": (4, 2, 1), "schlick": (4, 3, 2), "dip": (4, 2, 1)
}  # fmt: skip
"""How many entries the table has for the means, for k, and for each polynomial: the coefficients of those by which 1,
y, y² … are multiplied, in x for what is lost, and in 1 - cosθ for the others, where 1 - cosθ is a factor of y, too."""


class Escape(NamedTuple):
    """What becomes of light that comes from a direction, if facets reflect all of it."""

    lost: mi.Float
    """1 - E: what does not escape at the first reflection."""
    second: mi.Float
    """The part of that which escapes at the second."""
    schlick: mi.Float
    """The mean of (1 - cosθ_d)⁵ at the first reflection of what does not escape at it, and what those at later ones
    differ by from their own mean,"""
    dip: mi.Float
    """and of cosθ_d (1 - cosθ_d)⁶; see :meth:`.terms.Fresnel.mean`."""


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
    """What the :func:`table` says of walks on a surface with Smith's term."""

    def __init__(self, smith: Smith, table: Any, uniform: Callable[[str, Any], Any]) -> None:
        u, v = smith.alpha_u, smith.alpha_v
        self.smith, self.isotropic = smith, u is v
        largest = dr.maximum(u, v)
        at = [dr.sqrt((1 + 1 / ROUGHEST) * largest / (1 + largest))]
        if not self.isotropic:
            ratio = dr.minimum(u, v) / largest
            at.append(dr.sqrt(dr.sqrt(ratio)))
            low, high = ends(ratio)
            scale = 2 / dr.maximum(high - low, 1e-3)
            self.azimuth = uniform("azimuth", (2 / (u * v), scale, -0.5 * scale * (low + high)))
        # Outer texels have their centres at 0 and 1.
        texels = [(x * (count - 1) + 0.5) / count for x, count in zip(at, table.shape[-2::-1], strict=True)]
        self.rows, left = {}, iter(uniform("walks", table.eval(texels)))
        for name, counts in COUNTS.items():
            self.rows[name] = [list(itertools.islice(left, n)) for n in counts[: 1 if self.isotropic else None]]
        (root, *others), self.bend = self.rows["mean"][0], self.rows["bend"][0][0]
        self.mean = MeanEscape(dr.square(root), *others)

    def of(self, v: mi.Vector3f) -> Escape:
        """Return what becomes of light from a direction."""
        slope2, y = self.smith.slope2(v), 0
        length = dr.sqrt(slope2 + v.z * v.z)
        x = 2 * v.z / (v.z + self.bend * (length - v.z)) - 1
        if not self.isotropic:
            # Towards the normal, which has no azimuth, go to the one where α² is αu αv.
            inverse, scale, shift = self.azimuth
            along, sin2 = slope2 * inverse + 2 * UPRIGHT, v.x * v.x + v.y * v.y + UPRIGHT
            y = along / (along + sin2) * scale + shift
        lost = horner([horner(row, x) for row in self.rows["lost"]], y)
        # The others change with the angle itself, and at the normal not with the azimuth.
        versine, others = 1 - v.z, []
        for name in Escape._fields[1:]:
            first, *rest = (horner(row, versine) for row in self.rows[name])
            others.append(dr.fma(versine * y, horner(rest, y), first) if rest else first)
        return Escape(dr.maximum(lost, 0), *others)


def ends(ratio: Any) -> tuple[Any, Any]:
    """Return the least and the largest value of α²/(α² + αu αv/2), for the ratio of the smaller α to the larger one."""
    return ratio / (ratio + 0.5), 1 / (1 + 0.5 * ratio)


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
        kept = np.concatenate([np.arange(sum(counts)) < counts[0] for counts in COUNTS.values()])
        kind, entries = mi.Texture1f, entries[-1][:, kept]
    # Channels are looked up together only if they are a power of two.
    spare = (1 << entries.shape[-1].bit_length()) - entries.shape[-1]
    values = np.pad(entries, [(0, 0)] * (entries.ndim - 1) + [(0, spare)])
    # And only from arrays that are aligned, as Dr.Jit's are and NumPy's need not be.
    tensor = mi.TensorXf(np.float32(values)) * dr.opaque(mi.Float, 1)
    dr.eval(tensor)
    # Accelerated look-ups of CUDA would interpolate with eight bits.
    return kind(tensor, use_accel=False, wrap_mode=dr.WrapMode.Clamp)
