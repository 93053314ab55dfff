"""Diffuse lobes."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, TINY, Spectrum, choose, safe_sqrt, unit
from .lobe import AdjointLobe, Lobe


class LambertLobe(Lobe):
    """f = ρ/π, cosine-sampled: the weight is ρ."""

    glossy = False

    def __init__(self, reflectance: Spectrum) -> None:
        self.reflectance = reflectance

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.reflectance

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        pdf = wo.z * dr.inv_pi
        return self.reflectance * pdf, pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_cosine_hemisphere(v)


def over_diffuse(reflectance: Spectrum | None, *lobes: Lobe) -> tuple[Lobe, ...]:
    """Return lobes over a diffuse one, if its reflectance was given."""
    return lobes if reflectance is None else (LambertLobe(reflectance), *lobes)


class ZonalLobe(Lobe):
    """f |cosθ_o| = albedo(wi)·p(cosθ_o)/2π, with a density p of the cosine that does not depend on ``wi``. As p is
    drawn by its inverse cumulative distribution, and the azimuth uniformly, the weight is the albedo."""

    glossy = False

    def density(self, cos: mi.Float) -> mi.Float:
        """Return p, whose integral over the cosine is one."""
        raise NotImplementedError

    def cosine(self, u: mi.Float) -> mi.Float:
        """Return the cosine below which the fraction ``u`` of p lies."""
        raise NotImplementedError

    def adjoint(self) -> Lobe:
        return self if self.reciprocal else AdjointZonalLobe(self)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        pdf = self.density(wo.z) * dr.inv_two_pi
        return self.estimated_albedo(wi) * pdf, pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        cos = self.cosine(v.x)
        sin = safe_sqrt(1 - cos * cos)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.y)
        return mi.Vector3f(sin * cos_phi, sin * sin_phi, cos)


class AdjointZonalLobe(AdjointLobe):
    """f(wo, wi) |cosθ_o| = albedo(wo)·p(cosθ_i)/(2π cosθ_i) cosθ_o, cosine-sampled."""

    lobe: ZonalLobe

    def _radiance(self, wi: mi.Vector3f) -> mi.Float:
        """Return π times the response of a lobe of albedo 1 to light from ``wi``."""
        return 0.5 * self.lobe.density(self._mirrored(wi).z) / dr.maximum(wi.z, EPSILON)

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.estimated_albedo(mi.Vector3f(0, 0, 1)) * self._radiance(wi)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        viewer = self._mirrored(wo)
        pdf = viewer.z * dr.inv_pi
        return self.lobe.estimated_albedo(viewer) * (self._radiance(wi) * pdf), pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self._mirrored(mi.warp.square_to_cosine_hemisphere(v))


class RoughDiffuseLobe(Lobe):
    r"""A diffuse lobe, brighter towards ``wi``, as Oren and Nayar's are: ``retro`` = 0 is Lambert's, 1 the roughest.
    Subclasses evaluate it.

    Draw from a linearly transformed cosine, clipped to the horizon before the transform, in a mixture with uniform
    directions. The matrix and the fraction of uniform directions are the polynomials that Portsmouth, Kutz and Hill
    fitted to their model (the latter times an eighth root, not a tenth one, which takes logarithms), whose paper
    derives the density: that of the cosine before the transform M, times the Jacobian 1/(det M |M⁻¹wo|³) (EON, 2025,
    https://jcgt.org/published/0014/01/06/). No sample falls below the horizon, and ``retro`` = 0 is the cosine itself.
    """

    glossy = False

    def __init__(self, reflectance: Spectrum, retro: mi.Float) -> None:
        self.reflectance, self.retro = reflectance, retro

    def eval(self, wi: mi.Vector3f, wo: mi.Vector3f) -> Spectrum:
        """Return f."""
        raise NotImplementedError

    def _uniform(self, wi: mi.Vector3f) -> mi.Float:
        """Return the probability of the uniform directions."""
        mu, r = wi.z, self.retro
        share = 0.162925 + mu * (-0.372058 + mu * (0.538233 - 0.290822 * mu))
        root = dr.sqrt(dr.sqrt(dr.sqrt(dr.maximum(r, TINY))))
        return dr.select(r > 0, root, 0) * share

    def _matrix(self, wi: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        """Return ``(a, b, c, d)`` of the matrix ((a 0 b) (0 c 0) (d 0 1)), in a frame with wi in its xz plane."""
        mu, r = wi.z, self.retro
        a = 1 + r * (0.303392 + mu * (-0.518982 + 0.111709 * mu) + r * (-0.276266 + 0.335918 * mu))
        b = r * (-1.16407 + 1.15859 * mu + r * (0.150815 - 0.150105 * mu)) / (mu * mu * mu - 1.43545)
        c = 1 + r * (0.20013 + mu * (-0.506373 + 0.261777 * mu))
        d = r * (0.540852 + mu * (-1.01625 + 0.475392 * mu)) / (-1.0743 + mu * (0.0725628 + mu))
        # The clipping below needs d <= 0; the fit exceeds that by 0.003 near normal incidence.
        return a, b, c, dr.minimum(d, 0)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        a, b, c, d = self._matrix(wi)
        x, y = unit(wi.x, wi.y)
        along, across = x * wo.x + y * wo.y, x * wo.y - y * wo.x
        det = c * (a - b * d)
        # The direction before the transform, times det.
        cosine = mi.Vector3f(c * (along - b * wo.z), (a - b * d) * across, c * (a * wo.z - d * along))
        visible = 0.5 + 0.5 * dr.rsqrt(d * d + 1)
        transformed = dr.square(det / dr.squared_norm(cosine)) * dr.maximum(cosine.z, 0) / (dr.pi * visible)
        uniform = self._uniform(wi)
        return self.eval(wi, wo) * wo.z, uniform * dr.inv_two_pi + (1 - uniform) * transformed

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        is_uniform, _ = choose(u, self._uniform(wi))
        a, b, c, d = self._matrix(wi)
        # The transform moves what lies beyond half an ellipse in the disc below the horizon: squeeze that out.
        disc = mi.warp.square_to_uniform_disk_concentric(v)
        visible = 0.5 + 0.5 * dr.rsqrt(d * d + 1)
        end = safe_sqrt(1 - disc.y * disc.y)
        disc.x = visible * (disc.x + end) - end
        z = safe_sqrt(1 - dr.squared_norm(disc))
        local = dr.normalize(mi.Vector3f(a * disc.x + b * z, c * disc.y, d * disc.x + z))
        x, y = unit(wi.x, wi.y)
        wo = mi.Vector3f(local.x * x - local.y * y, local.x * y + local.y * x, local.z)
        return dr.select(is_uniform, mi.warp.square_to_uniform_hemisphere(v), wo)
