"""Forward reflection at grazing, for the dielectrics that hardly reflect elsewhere."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, choose, normalize_or, safe_sqrt, select
from .facet import Facet
from .sampling import FacetLobe, Sampler


class WithForwardShare(Sampler):
    """Another sampler for a dielectric, with a share of directions about the horizon opposite to ``wi``: there a
    dielectric of nearly the same index on both sides reflects by far the most.

    Where both directions are low, cosθ_d² is about ((z + z')² + δ²)/4, with their cosines z and z' and the azimuth δ
    from the plane of incidence. z' has the density ∝ z'/(z + z')³, and t = tan(δ/2) ∝ (w² + t²)^(-3/2), with w =
    (z + z')/2.
    """

    INDISTINCT = 0.008
    """The reflectance at normal incidence, that of η = 1.2, below which dielectrics need it."""
    LARGEST = 0.8
    """The share where it needs it most. tests/calibration/forward.py fits both."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler = sampler

    def _share(self, lobe: FacetLobe, wi: mi.Vector3f) -> mi.Float:
        distribution, z = lobe.distribution, self._cosine(wi)
        fresnel: Any = lobe.fresnel  # a Dielectric
        # From a facet in the plane of incidence that is steeper than three of four.
        x, y = normalize_or(wi.x, wi.y, (1, 0))
        g = dr.square(x / distribution.alpha_u) + dr.square(y / distribution.alpha_v)
        slope2 = distribution.inverse_cdf(0.75, 0.25, g)
        cos2 = z * z + slope2 / (1 + slope2)
        low = z * z / cos2
        brighter = low * (1 - low) * fresnel(z) / dr.maximum(fresnel(dr.minimum(dr.sqrt(cos2), 1)), EPSILON)
        distinct = dr.square(dr.square(dr.square((fresnel.eta - 1) / (fresnel.eta + 1)) / self.INDISTINCT))
        return self.LARGEST * brighter / ((1 + brighter) * (1 + distinct))

    @staticmethod
    def _cosine(wi: mi.Vector3f) -> mi.Float:
        """The z of above, not too small for what divides by it."""
        return dr.maximum(wi.z, 1e-3)

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.complete(lobe, wi, u, v, True, None)[0].wo

    def complete(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f, drawn: mi.Bool, given: Facet | None
    ) -> tuple[Facet, mi.Float]:
        share = self._share(lobe, wi)
        forward, u = choose(u, share)
        wo = self._draw(wi, v)
        if given is not None:
            wo = select(drawn, wo, given.wo)
        facet, pdf = self.sampler.complete(lobe, wi, u, v, select(forward, False, drawn), Facet.between(wi, wo))
        return facet, self._mixed(facet, pdf, share)

    def _draw(self, wi: mi.Vector3f, v: mi.Point2f) -> mi.Vector3f:
        z = self._cosine(wi)
        ratio = dr.sqrt(v.x) / (1 + z)  # z'/(z + z')
        cos = z * ratio / (1 - ratio)
        uniform = 2 * v.y - 1
        sin_half, cos_half = normalize_or(0.5 * (z + cos) * uniform, safe_sqrt(1 - uniform * uniform), (0, 1))  # of δ/2
        sin_delta, cos_delta = 2 * sin_half * cos_half, (cos_half - sin_half) * (cos_half + sin_half)
        x, y = normalize_or(-wi.x, -wi.y, (1, 0))
        sin = safe_sqrt(1 - cos * cos)
        return mi.Vector3f(sin * (x * cos_delta - y * sin_delta), sin * (y * cos_delta + x * sin_delta), cos)

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        return self._mixed(facet, self.sampler.pdf(lobe, facet), self._share(lobe, facet.wi))

    def _mixed(self, facet: Facet, pdf: mi.Float, share: mi.Float) -> mi.Float:
        """The density, where ``pdf`` is that of the other sampler."""
        wi, wo, z, cos = facet.wi, facet.wo, self._cosine(facet.wi), dr.maximum(facet.cos_o, 0)
        x_i, y_i = normalize_or(-wi.x, -wi.y, (1, 0))
        x_o, y_o = normalize_or(wo.x, wo.y, (1, 0))
        sin2_half = 0.25 * (dr.square(x_o - x_i) + dr.square(y_o - y_i))
        width2, scale = 0.25 * dr.square(z + cos), 1 / (z + cos)
        inverse = dr.rsqrt(dr.lerp(width2, 1, sin2_half))
        azimuth = 0.25 * width2 * safe_sqrt(1 - sin2_half) * inverse * dr.square(inverse)
        forward = 2 * (z * scale) * (cos * scale) * dr.square(1 + z) * scale * azimuth
        return dr.lerp(pdf, forward, share)
