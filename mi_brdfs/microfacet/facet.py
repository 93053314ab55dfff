"""The geometry of a reflection at a facet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from ..math import SMALL, Spectrum, unit


class Cosines(NamedTuple):
    """The cosines of a facet, without directions, for estimates."""

    cos_i: mi.Float
    cos_o: mi.Float
    cos_h: mi.Float
    cos_d: mi.Float

    @classmethod
    def leaning(cls, cos_i: mi.Float, sin_i: mi.Float, slope: mi.Float) -> Cosines:
        """Return the cosines of a facet in the plane of incidence that leans towards ``wi`` by a slope."""
        cos_h = dr.rsqrt(slope * slope + 1)
        cos_d = (cos_i + sin_i * slope) * cos_h
        return cls(cos_i, 2 * cos_d * cos_h - cos_i, cos_h, cos_d)


@dataclass
class Facet:
    """A reflection of ``wi`` into ``wo`` at a facet with the normal ``h``, the half vector. The cosines (n·wi), (n·wo),
    (n·h) and (wi·h) = (wo·h) are written cosθ_i, cosθ_o, cosθ_h and cosθ_d."""

    wi: mi.Vector3f
    wo: mi.Vector3f
    h: mi.Vector3f
    cos_d: mi.Float

    @classmethod
    def between(cls, wi: mi.Vector3f, wo: mi.Vector3f) -> Facet:
        """Return the facet that reflects ``wi`` into ``wo``, both above the horizon."""
        # Opposite directions in the horizon have no half vector; derivatives divide by the length, up to its fourth
        # power.
        h = mi.Vector3f(wi.x + wo.x, wi.y + wo.y, dr.maximum(wi.z + wo.z, SMALL))
        length2 = dr.dot(h, h)
        inv_length = dr.rsqrt(length2)
        return cls(wi, wo, h * inv_length, 0.5 * length2 * inv_length)

    @classmethod
    def at(cls, wi: mi.Vector3f, slope_x: mi.Float, slope_y: mi.Float) -> Facet:
        """Return the facet whose normal is ∝ (slope_x, slope_y, 1)."""
        inv_length = dr.rsqrt(slope_x * slope_x + slope_y * slope_y + 1)
        return cls.reflecting(wi, mi.Vector3f(slope_x * inv_length, slope_y * inv_length, inv_length))

    @classmethod
    def reflecting(cls, wi: mi.Vector3f, h: mi.Vector3f) -> Facet:
        """Return the facet with the normal ``h``."""
        cos_d = dr.dot(wi, h)
        return cls(wi, dr.fma(h, 2 * cos_d, -wi), h, cos_d)

    def image(self) -> Facet:
        """Return the facet mirrored about the normal, which reflects the same ``wi``."""
        return self.reflecting(self.wi, mi.Vector3f(-self.h.x, -self.h.y, self.h.z))

    def mueller(self, elements: tuple[Spectrum, ...], x_i: mi.Vector3f, x_o: mi.Vector3f) -> mi.Spectrum:
        """Return the matrix R(φ_i) M R(φ_o)ᵀ of :meth:`Fresnel.mueller`'s elements, for light from ``wo`` to ``wi``
        whose Stokes vectors have the first axes ``x_o`` and ``x_i``: φ_o and φ_i are the angles from these to s."""
        f, b, c, s = elements
        # Near wi = wo its digits are lost: there any axis will do that is the same for both.
        axis = dr.cross(self.wi, self.wo)
        (ci, si), (co, so) = _double_angle(axis, x_i, self.wi), _double_angle(axis, x_o, -self.wo)
        return mi.Spectrum(
            f, b * co, b * so, 0,
            b * ci, ci * f * co + si * c * so, ci * f * so - si * c * co, si * s,
            b * si, si * f * co - ci * c * so, si * f * so + ci * c * co, -ci * s,
            0, -s * so, s * co, c,
        )  # fmt: skip

    @property
    def cos_i(self) -> mi.Float:
        return self.wi.z

    @property
    def cos_o(self) -> mi.Float:
        return self.wo.z

    @property
    def cos_h(self) -> mi.Float:
        return self.h.z

    @property
    def sin2_h(self) -> mi.Float:
        # Not 1 - cos², which loses the digits of narrow lobes.
        return self.h.x * self.h.x + self.h.y * self.h.y

    @property
    def azimuth(self) -> tuple[mi.Float, mi.Float]:
        """The direction of the half vector in the surface."""
        return unit(self.h.x, self.h.y)

    @property
    def tan2_h(self) -> mi.Float:
        return self.sin2_h / dr.square(self.cos_h)


def _double_angle(axis: mi.Vector3f, x: mi.Vector3f, forward: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Return cosine and sine of twice the angle from ``x`` to an axis, counter-clockwise for whom the light meets."""
    cos, sin = unit(dr.dot(axis, x), dr.dot(axis, dr.cross(forward, x)))
    return cos * cos - sin * sin, 2 * cos * sin
