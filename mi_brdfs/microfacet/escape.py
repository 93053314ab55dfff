"""Where light goes on a rough surface: how much of it escapes at the first reflection, at the second and later, and
what it meets before. Tables of walks on Smith's surfaces, which tests/calibration/escape.py makes.

A walk is that of E. Heitz, J. Hanika, E. d'Eon and C. Dachsbacher, Multiple-scattering microfacet BSDFs with the Smith
model, ACM Transactions on Graphics 35(4), 2016, doi:10.1145/2897824.2925943. What it does depends on a direction by its
cosine, the roughness α∥ along it, α⊥ across, and the correlation ρ of slopes along and across:

    α∥² = (αu cosφ)² + (αv sinφ)²,  α⊥² = (αu sinφ)² + (αv cosφ)²,  ρ² = 1 - (αu αv / (α∥ α⊥))²

which are four numbers as (θ, φ, αu, αv) are, but all that is tabulated is nearly linear in ρ²: three axes suffice, with
polynomials in ρ² at their nodes. The cosine is that of the direction in the space stretched by α, in which grazing
angles of smooth surfaces take as much of the axis as those of rough ones.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import EPSILON
from .shadowing import Smith

FILE = Path(__file__).with_name("escape.npz")
ROUGHEST = 3.2
"""The largest tabulated α: that of Burley's most anisotropic facets."""
UPRIGHT = 1e-3
"""The sin²θ below which the azimuth counts less and less: what is tabulated changes little with it there."""


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
    """What the :func:`textures` say of walks on a surface with Smith's term."""

    def __init__(self, smith: Smith, towards: Any, mean: Any) -> None:
        self.smith, self.towards = smith, towards
        at = [_texel(_compressed(alpha), mean.shape[0]) for alpha in (smith.alpha_v, smith.alpha_u)]
        root, second, third, schlick, dip, *_ = mean.eval(mi.Point2f(*at))
        self.mean = MeanEscape(dr.square(root), second, third, schlick, dip)

    def of(self, v: mi.Vector3f) -> Escape:
        """Return what becomes of light from a direction."""
        u2, v2, x2, y2 = (dr.square(each) for each in (self.smith.alpha_u, self.smith.alpha_v, v.x, v.y))
        cos = v.z * dr.rsqrt(dr.maximum(v.z * v.z + u2 * x2 + v2 * y2, EPSILON))
        # At the normal all azimuths are one.
        even = UPRIGHT * dr.square(dr.square(v.z))
        inverse = dr.rcp(dr.maximum(x2 + y2 + 2 * even, EPSILON))
        x2, y2 = (x2 + even) * inverse, (y2 + even) * inverse
        along2, across2 = u2 * x2 + v2 * y2, u2 * y2 + v2 * x2
        at = [cos, _compressed(dr.sqrt(along2)), _compressed(dr.sqrt(across2))]
        k = self.towards.eval(
            mi.Point3f(*reversed([_texel(x, n) for x, n in zip(at, self.towards.shape[:3], strict=True)]))
        )
        rho2 = 1 - u2 * v2 / (along2 * across2)
        lost = k[0] + rho2 * (k[1] + rho2 * k[2])
        second, schlick, dip = k[3] + rho2 * k[4], k[5] + rho2 * k[6], k[7]
        return Escape(dr.clip(lost, 0, 1), dr.clip(second, 0, 1), schlick, dip)


def textures(smith: Smith) -> list[Any]:
    """Return the tables for one of Smith's terms, as textures of the active variant."""
    name = f"{smith.facets}-{'correlated' if smith.correlated else 'separable'}"
    # Accelerated look-ups of CUDA would interpolate with eight bits.
    options = {"use_accel": False, "wrap_mode": dr.WrapMode.Clamp}
    with np.load(FILE) as data:
        towards = np.concatenate([data[name], data[f"{smith.facets}-walk"]], axis=-1)
        mean = data[f"{name}-mean"]
    return [kind(_aligned(it), **options) for kind, it in ((mi.Texture3f, towards), (mi.Texture2f, mean))]


def _aligned(values: np.ndarray) -> Any:
    """Return a tensor in Dr.Jit's own memory: channels are looked up together only where arrays are aligned, as
    NumPy's need not be."""
    tensor = mi.TensorXf(np.float32(values)) * dr.opaque(mi.Float, 1)
    dr.eval(tensor)
    return tensor


def _compressed(alpha: Any) -> Any:
    """Return a place in [0, 1]: nodes are denser on smooth surfaces."""
    return dr.clip((1 + 1 / ROUGHEST) * alpha / (1 + alpha), 0, 1)


def _texel(x: mi.Float, count: int) -> mi.Float:
    """Return the coordinate of a texture of which the outer texels' centres are at 0 and 1."""
    return (x * (count - 1) + 0.5) / count
