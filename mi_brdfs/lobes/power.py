"""Lobes that are a power of the cosine to an axis, by default the mirror direction."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, ONE_MINUS_EPSILON, TINY, Spectrum, choose, expm1, log1p, safe_sqrt, sin_theta, unit
from .lobe import Lobe


class AxisFrame:
    """Directions around a unit vector ``axis``, in the frame (side, up, axis) with ``up`` in the plane of the axis and
    the normal. Mirroring a direction i in the plane of axis and side keeps its cosine A = i·axis, and turns B = i·up
    into -B. The cosines of the two to the normal are axis_z A ± sinθ_axis |B|: samplers draw A and |B| first, and then
    one of the pair.
    """

    def __init__(self, axis: mi.Vector3f) -> None:
        self.axis = axis
        self.sin = sin_theta(axis)
        x, y = unit(axis.x, axis.y)
        self.up = mi.Vector3f(-axis.z * x, -axis.z * y, self.sin)
        self.side = mi.Vector3f(-y, x, 0)

    def cosine(self, w: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Bool]:
        """Return ``(log A, 1 - A, inside)`` of the direction ``w``, where ``inside`` says whether A > 0."""
        versine = 0.5 * dr.squared_norm(w - self.axis)
        inside = versine < 1
        versine = dr.select(inside, versine, 0)
        return log1p(-versine), versine, inside

    def direction(self, versine: mi.Float, b: mi.Float, c: mi.Float) -> mi.Vector3f:
        """Return the direction with A = 1 - ``versine`` and the rest along ``b up + c side``, with b² + c² = 1."""
        sin = safe_sqrt(versine * (2 - versine))
        return self.axis * (1 - versine) + self.up * (sin * b) + self.side * (sin * c)

    def mirrored_z(self, w: mi.Vector3f, versine: mi.Float) -> mi.Float:
        """Return the cosine to the normal of the mirror image of ``w``, or 0 below the horizon."""
        return dr.maximum(2 * self.axis.z * (1 - versine) - w.z, 0)


class MirrorLobe(Lobe):
    """A lobe of scale·max(0, A)ⁿ around the mirror direction."""

    def __init__(self, reflectance: Spectrum, exponent: mi.Float, scale: Spectrum) -> None:
        self.reflectance, self.exponent, self.scale = reflectance, exponent, scale

    def frame(self, wi: mi.Vector3f) -> AxisFrame:
        return AxisFrame(mi.Vector3f(-wi.x, -wi.y, wi.z))

    def peak(self, wi: mi.Vector3f) -> Spectrum:
        """Return the scale for ``wi``."""
        return self.scale

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        log_a, _, inside = self.frame(wi).cosine(mi.Vector3f(-wi.x, -wi.y, wi.z))
        relative = dr.select(inside, dr.exp(self.exponent * log_a), 0) * self.peak(wi) / self.scale
        return self.reflectance * relative


class PowerLobe(MirrorLobe):
    r"""f = ρ·scale·max(0, A)ⁿ, sampled nearly in proportion to f cosθ.

    A and |B| = √(1-A²) cosφ come from a mixture on the half space B > 0, one density for each term of cosθ:

        P (n+2)/π Aⁿ⁺¹  +  (1-P) ¾(n+1) Aⁿ √(1-Aⁿ⁺¹) cosφ,

    where the second stands for AⁿB: with √(1-Aⁿ⁺¹) instead of √(1-A²) its radial part can be inverted. P is the first
    term's share of the integrals. Then choose one of the pair with probability ∝ cosθ⁺, so that none lies below the
    horizon. While both cosines are positive they add up to 2 axis_z A, as in the first term: so the weight is constant
    where both lie well above the horizon, and below three times its mean everywhere.
    """

    def _masses(self, frame: AxisFrame) -> tuple[mi.Float, mi.Float]:
        """Return the integrals of the two terms over the pair, relative to 2π/(n+2). The second one approximates a
        ratio of Gamma functions, √π Γ((n+1)/2) / Γ(n/2+1): exactly for n = 0 and in the limit, and within 2 %
        otherwise."""
        return dr.maximum(frame.axis.z, 0), frame.sin * dr.rsqrt(dr.two_pi * self.exponent + 4)

    def _share(self, frame: AxisFrame) -> mi.Float:
        axial, lateral = self._masses(frame)
        return axial / dr.maximum(axial + lateral, EPSILON)  # both are zero for an axis straight below the surface

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        # Exact for an axis along the normal or in the horizon.
        axial, lateral = self._masses(self.frame(wi))
        mass = dr.sqrt(axial * axial + lateral * lateral)
        return self.reflectance * (self.peak(wi) * dr.two_pi / (self.exponent + 2) * mass)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        n, frame = self.exponent, self.frame(wi)
        log_a, versine, inside = frame.cosine(wo)
        power = dr.select(inside, dr.exp(n * log_a), 0)
        sin = dr.sqrt(dr.maximum(versine * (2 - versine), TINY))
        cos_phi = dr.minimum(abs(dr.dot(wo - frame.axis, frame.up)) / sin, 1)
        return (
            self.reflectance * (self.peak(wi) * power * wo.z),
            self._pair(frame, log_a, versine, power, cos_phi)
            * wo.z
            / dr.maximum(wo.z + frame.mirrored_z(wo, versine), EPSILON),
        )

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        frame = self.frame(wi)
        u, log_a, b, c = self._draw(frame, u, v)
        versine = -expm1(log_a)
        wo, mirrored = frame.direction(versine, b, c), frame.direction(versine, -b, c)
        z, mirrored_z = dr.maximum(wo.z, 0), dr.maximum(mirrored.z, 0)
        return dr.select(u * (z + mirrored_z) < z, wo, mirrored)

    def _draw(self, frame: AxisFrame, u: mi.Float, v: mi.Point2f) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        """Return ``(u, log A, |B|/√(1-A²), …)`` of the mixture, with the remaining variate ``u``."""
        n = self.exponent
        is_axial, u = choose(u, self._share(frame))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.y)
        c = dr.select(is_axial, sin_phi, 2 * v.y - 1)
        b = dr.select(is_axial, abs(cos_phi), safe_sqrt(1 - c * c))
        above = dr.select(is_axial, v.x, dr.square(dr.cbrt(v.x)))
        return u, log1p(-above) / (n + dr.select(is_axial, 2, 1)), b, c

    def _pair(
        self, frame: AxisFrame, log_a: mi.Float, versine: mi.Float, power: mi.Float, cos_phi: mi.Float
    ) -> mi.Float:
        """Return the density of the mixture, where ``power`` is Aⁿ, or 0 for A < 0."""
        n = self.exponent
        cos = 1 - versine
        axial = (n + 2) * cos
        radial = dr.sqrt(dr.maximum(1 - power * cos, 1 - ONE_MINUS_EPSILON))  # not 0, where rounding leaves nothing
        lateral = 0.75 * dr.pi * (n + 1) * radial * cos_phi
        share = self._share(frame)
        return power * dr.inv_pi * (share * axial + (1 - share) * lateral)


class PowerResponseLobe(MirrorLobe):
    """f cosθ = ρ·scale·max(0, A)ⁿ above the horizon: a power that stands for the whole response to light, cosine
    included, as in the shading formulas of the 1970s. Neither reciprocal nor bounded as a BRDF.

    Draw A ∝ Aⁿ, and then one of the pair that lies above the horizon. The density is (n+1)/π Aⁿ if only one does, and
    half of that if both do: the weight takes two values only.
    """

    reciprocal = False

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        # The tanh estimates the fraction above the horizon, within 0.12.
        visible = 0.5 + 0.5 * dr.tanh(wi.z * dr.sqrt(self.exponent + 1))
        return self.reflectance * (self.peak(wi) * dr.two_pi / (self.exponent + 1) * visible)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        frame = self.frame(wi)
        log_a, versine, inside = frame.cosine(wo)
        power = dr.select(inside, dr.exp(self.exponent * log_a), 0)
        pdf = power * (self.exponent + 1) * dr.inv_pi
        alone = frame.mirrored_z(wo, versine) <= 0
        return self.reflectance * (self.peak(wi) * power), dr.select(alone, pdf, 0.5 * pdf)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        frame = self.frame(wi)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.y)
        versine = -expm1(log1p(-v.x) / (self.exponent + 1))
        wo, mirrored = frame.direction(versine, cos_phi, sin_phi), frame.direction(versine, -cos_phi, sin_phi)
        # The azimuth has chosen one of the two at random; the other replaces it only if it lies below the horizon.
        return dr.select(wo.z > 0, wo, mirrored)
