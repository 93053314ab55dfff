"""Microfacet lobes."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, Spectrum, safe_sqrt
from ..microfacet.facet import Cosines, Facet
from ..microfacet.sampling import MixedProposals
from ..microfacet.shadowing import Shadowing
from ..microfacet.terms import Directions, Distribution, Fresnel
from .lobe import Lobe


class MicrofacetLobe(Lobe):
    """f = ρ·F(cosθ_d)·D(h)·G / (4 cosθ_i cosθ_o), for any distribution, shadowing and Fresnel term of
    :mod:`mi_brdfs.microfacet`. ρ is a ``colour`` times a ``scale``. The three terms determine the sampler
    (:mod:`mi_brdfs.microfacet.sampling`).
    """

    # Constants of the estimated albedo, fitted by tests/calibration/estimated_albedo.py.
    TYPICAL = 0.57
    """The squared slope of the typical facet, in units of the mean square slope of narrow lobes."""
    LOST = 1.7
    """How fast the loss of an energy-conserving shadowing term vanishes away from the normal; other terms include it at
    the typical facet."""
    NEARER = 0.25
    """How much nearer to the normal than the mirror's cosine facets are visible at grazing angles,"""
    NEARER_LONG_TAILED = 0.4
    """for a long tail under an energy-conserving shadowing term,"""
    NEARER_UPRIGHT = 0.08
    """and for a shadowing term that does not lean."""

    def __init__(
        self, colour: Spectrum, distribution: Distribution, shadowing: Shadowing, fresnel: Fresnel, scale: mi.Float = 1
    ) -> None:
        self.colour, self.reflectance, self.distribution = colour, colour * scale, distribution
        self.shadowing, self.fresnel = shadowing, fresnel
        self.reciprocal, self.anisotropic = shadowing.reciprocal, distribution.anisotropic
        self.tabulated: Callable[[mi.Vector3f], mi.Float] | None = None
        """What takes the place of the fitted estimate of its albedo over ρ, if there are tables."""

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        """Return an estimate from F, D and G at a typical facet.

        At grazing angles the visible facets lean towards the viewer: F is evaluated at a cosine larger than cosθ_i, and
        a shadowing term that does not conserve energy at such a facet in the plane of incidence. The cosθ_d of that
        facet and its image about the normal add up to 2 cosθ_h cosθ_i, until at grazing angles only the first one is
        visible.
        """
        if self.tabulated:
            return self.reflectance * self.tabulated(wi)
        cos, versine = dr.maximum(wi.z, 1e-4), 1 - wi.z  # the terms must not vanish
        sin2 = dr.maximum(wi.x * wi.x + wi.y * wi.y, EPSILON)
        slope2 = self.distribution.mean_square_slope_along(wi) / sin2
        if self.shadowing.conserving:
            seen = self.distribution.estimated_albedo(wi.z)
        else:
            # The 0.18 keeps its reflection above the horizon up to a mean square slope of 4.
            typical2 = self.TYPICAL * slope2 / (1 + 0.18 * slope2)
            slope = typical2 * dr.rsqrt(typical2 + cos * cos)  # narrow lobes are about mirrors
            facet = Cosines.leaning(cos, dr.sqrt(sin2), slope)
            seen = self.shadowing(facet) * dr.maximum(0.5 * facet.cos_d / cos, facet.cos_h)
            seen *= self.distribution.estimated_albedo(1 - self.LOST * versine)
        if not self.shadowing.lean:
            nearer = self.NEARER_UPRIGHT
        elif self.shadowing.conserving and self.distribution.long_tailed:
            nearer = self.NEARER_LONG_TAILED
        else:
            nearer = self.NEARER
        nearer = nearer * versine * safe_sqrt(versine * slope2)
        # Not 1: Schlick's reflectance with f0 = 0 must not vanish.
        fresnel = self.fresnel.estimate(dr.minimum(dr.sqrt(cos * cos + nearer), 0.9))
        if (forward := self.fresnel.forward(self.distribution, wi)) is not None:
            fresnel += forward.reflectance
        return self.reflectance * (fresnel * seen)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        facet = Facet.between(wi, wo)
        facets = self._facets(facet)
        return self.reflectance * (self.fresnel(facet.cos_d) * facets), self._sampler(wi).pdf(facet)

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        facet = Facet.between(wi, wo)
        elements = self.fresnel.mueller(facet.cos_d)
        if elements is None:
            return super().mueller_pdf(wi, wo, x_i, x_o)
        facets = self._facets(facet)
        scaled = tuple(self.reflectance * (element * facets) for element in elements)
        return facet.mueller(scaled, x_i, x_o), self._sampler(wi).pdf(facet)

    def _facets(self, facet: Facet) -> mi.Float:
        """Return D G / (4 cosθ_i)."""
        # The last factor is the same for all facets of wi, so Dr.Jit computes it once.
        return self.distribution.eval(facet) * self.shadowing(facet) * (0.25 / facet.cos_i)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self._sampler(wi).draw(u, v)

    def _sampler(self, wi: mi.Vector3f) -> Directions:
        sampler = self.shadowing.sampler(self.distribution, self.fresnel, wi, self._reflect)
        forward = self.fresnel.forward(self.distribution, wi)
        return sampler if forward is None else MixedProposals(sampler, forward, forward.share)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return self.colour * self.fresnel(wi.z)

    def _reflect(self, facet: Facet) -> mi.Float:
        """Return F G, as the one number that samplers use."""
        return self.fresnel.brightness(facet.cos_d) * self.shadowing(facet)
