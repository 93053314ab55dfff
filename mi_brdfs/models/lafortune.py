from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import LambertLobe, Lobe, PowerLobe
from ..lobes.power import AxisFrame
from ..math import EPSILON, SMALL, TINY, Spectrum, clamp, log1p, log1p_series, safe_sqrt
from ..model import Model, Values
from ..parameters import Choice, Number, PerLobe, Reflectance, Rotation

C_LIMIT = 1.5
"""The largest |C|."""


class Lafortune(Model):
    """Lafortune, Foo, Torrance and Greenberg's generalised cosine lobes (1997).

    E. P. F. Lafortune, S.-C. Foo, K. E. Torrance and D. P. Greenberg, Non-linear approximation of reflectance
    functions, SIGGRAPH 1997, doi:10.1145/258734.258801.

        f = ρd/π + Σ ρ_l max(0, Cx wi_x wo_x + Cy wi_y wo_y + Cz wi_z wo_z)^n

    summed over one to eight lobes of ``specular_reflectance_i`` (ρ_l), ``cx_i``, ``cy_i``, ``cz_i`` and ``exponent_i``
    (n), numbered from 1; a single lobe needs no number. Cx = Cy = -Cz < 0 is a mirror lobe (Phong's, for Cz = 1),
    Cx = Cy > 0 reflects back towards the light, |Cz| < |Cx| lies beyond the mirror direction, Cx ≠ Cy is anisotropic.
    ``normalization`` is

    * energy: ρ_l is multiplied by (n+2)/(2π Cmax^n), with Cmax the largest of |Cx|, |Cy| and |Cz|: the albedo of a lobe
      stays below ρ_l.
    * none: as in the paper and in its published fits, where the C carry the energy. The albedo of a lobe is at most
      2π ρ_l Cmax^n/(n+2), which may exceed 1.

    With n = 0 a lobe is 1 up to where the cosine is 0, and jumps there; below about 0.2 float32 sees a jump, too.

    Reciprocal. Energy-conserving for ``energy`` with ρd + Σ ρ_l <= 1. For a spectral exponent, use one lobe for each
    colour. One-sided. Depolarises.

    Sampling: each lobe nearly in proportion to f cosθ_o (mi_brdfs.lobes.PowerLobe), even if its axis lies below the
    horizon (Cz < 0) and only its tail is visible: then a few samples fall below the horizon.

    Example
    -------
    {"type": "lafortune", "exponent_1": 20, "cx_2": 0.9, "cy_2": 0.9, "cz_2": 0.7, "exponent_2": 9}
    """

    family = "cosine lobes"

    diffuse_reflectance = Reflectance(0.5, "albedo ρd of the diffuse lobe", role="diffuse")
    specular = PerLobe(
        8,
        specular_reflectance=Reflectance(0.2, "scale ρ of lobe i", role="specular"),
        cx=Number(-1, (-C_LIMIT, C_LIMIT), "factor Cx of lobe i"),
        cy=Number(-1, (-C_LIMIT, C_LIMIT), "factor Cy of lobe i", isotropic_as="cx"),
        cz=Number(1, (-C_LIMIT, C_LIMIT), "factor Cz of lobe i"),
        exponent=Number(30, (0, 1e6), "exponent n of lobe i"),
    )
    normalization = Choice(("energy", "none"), "scale of the lobes")
    rotation = Rotation()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        energy = self.normalization == "energy"
        glossy = []
        for lobe in p.specular:
            n, c = lobe.exponent, (lobe.cx, lobe.cy, lobe.cz)
            largest = self._largest(*map(abs, c)) if energy else 1
            scale = (n + 2) * dr.inv_two_pi if energy else 1
            glossy.append(LafortuneLobe(lobe.specular_reflectance, n, scale, c, largest))
        return LambertLobe(p.diffuse_reflectance), *glossy

    @staticmethod
    def _largest(x: mi.Float, y: mi.Float, z: mi.Float) -> mi.Float:
        """Return Cmax. Where several are at the ends of their ranges, one that goes inwards does not change it."""
        largest = dr.maximum(dr.maximum(x, y), dr.maximum(z, 1e-6))  # for factors that are all zero
        at_ends = sum(dr.select(c >= C_LIMIT, 1, 0) for c in (x, y, z))
        return dr.select(at_ends > 1, dr.detach(largest), largest)


class LafortuneLobe(PowerLobe):
    """ρ·scale·max(0, (C∘wi)·wo / unit)ⁿ: a power of the cosine to the axis C∘wi, times the same power of its length."""

    anisotropic = True  # Cx and Cy are separate parameters, which may differ

    def __init__(
        self, reflectance: Spectrum, exponent: mi.Float, scale: mi.Float, c: tuple[mi.Float, ...], unit: mi.Float
    ) -> None:
        super().__init__(reflectance, exponent, scale)
        self.c, self.unit = c, unit

    def _stretched(self, wi: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float]:
        """Return ``(C∘wi, its length)``, relative to that of wi, which may differ from one by a rounding error."""
        v = mi.Vector3f(self.c[0] * wi.x, self.c[1] * wi.y, self.c[2] * wi.z)
        # At less than SMALL, the derivatives of its power leave the range of float32.
        return v, dr.sqrt(dr.maximum(dr.squared_norm(v) / dr.squared_norm(wi), SMALL * SMALL))

    def frame(self, wi: mi.Vector3f) -> AxisFrame:
        v, length = self._stretched(wi)
        return AxisFrame(dr.select(length > SMALL, v / length, mi.Vector3f(0, 0, 1)))

    def peak(self, wi: mi.Vector3f) -> Spectrum:
        _, length = self._stretched(wi)
        # (length/unit)² is one minus the deficit of the factors smaller than unit: a large exponent needs its digits.
        taken = sum((self.unit - c) * (self.unit + c) * w * w for c, w in zip(self.c, wi, strict=True))
        taken = taken / (self.unit * self.unit * dr.squared_norm(wi))
        near = abs(taken) < 0.5
        little = dr.select(near, -taken, 0)
        log = dr.select(near, 0.5 * little * log1p_series(little), dr.log(length / self.unit))
        # A C above 1 with a large exponent overflows float32: limit so bright a lobe.
        return self.scale * dr.exp(clamp(self.exponent * log, -dr.inf, 40))

    # Above the horizon, A is at most s, the sine of the axis's angle to the normal. If the axis lies so far below the
    # horizon that most of the lobe does, too, draw t = log(s/A) ∝ t exp(-(n+1) t), and an azimuth above the horizon.

    def _buried(self, frame: AxisFrame) -> tuple[mi.Bool, mi.Float, mi.Float]:
        """Return ``(whether it does, log s, c² (n+1))``, where c is the axis's cosine."""
        cos2 = dr.square(frame.axis.z)
        sin2 = dr.maximum(dr.square(frame.axis.x) + dr.square(frame.axis.y), EPSILON)  # 1 - c² would have no digits
        depth = dr.select(frame.axis.z < 0, cos2 * (self.exponent + 1), 0)
        # A large exponent needs the digits of log s for an axis near the horizon, too.
        log_s = 0.5 * dr.select(cos2 < 0.5, log1p(-dr.minimum(cos2, 0.5)), dr.log(sin2))
        # Of what is deeper float32 holds no value, and its steps of t are too coarse.
        return (depth > sin2) & (self.exponent * log_s > -80), log_s, depth

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        _, log_s, depth = self._buried(self.frame(wi))
        return super().estimated_albedo(wi) * (
            dr.select(depth > 0, dr.exp((self.exponent + 1) * log_s), 1) / (1 + depth)
        )

    @staticmethod
    def _arc(frame: AxisFrame, t: mi.Float) -> mi.Float:
        """Return the sine of the largest azimuth above the horizon, relative to ``up``, or a little more."""
        square = dr.minimum(2 * t / (1 + t), 1)  # the squared cosine to the horizon, whose sine is A/s
        s2, c2 = dr.square(frame.sin), dr.square(frame.axis.z)
        return dr.sqrt(square / (c2 + s2 * square))

    def _draw(self, frame: AxisFrame, u: mi.Float, v: mi.Point2f) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        left, log_a, b, c = super()._draw(frame, u, v)
        buried, log_s, _ = self._buried(frame)
        t = -dr.log(dr.maximum((1 - u) * (1 - v.x), TINY)) / (self.exponent + 1)
        across = (2 * v.y - 1) * self._arc(frame, t)
        log_a, b, c = (
            dr.select(buried, own, usual)
            for own, usual in ((log_s - t, log_a), (safe_sqrt(1 - across * across), b), (across, c))
        )
        return left, log_a, b, c

    def _pair(
        self, frame: AxisFrame, log_a: mi.Float, versine: mi.Float, power: mi.Float, cos_phi: mi.Float
    ) -> mi.Float:
        n, usual = self.exponent, super()._pair(frame, log_a, versine, power, cos_phi)
        buried, log_s, _ = self._buried(frame)
        t = dr.maximum(log_s - log_a, 1e-8)  # rounding may make it negative
        density = dr.square(n + 1) * t * dr.exp(-n * t - log_s) * cos_phi / (2 * self._arc(frame, t))
        return dr.select(buried, dr.select(log_a < 0, density, 0), usual)
