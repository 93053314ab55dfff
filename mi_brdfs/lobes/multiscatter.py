"""Light that the facets of a lobe reflect more than once."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, Spectrum, safe_sqrt
from ..microfacet.escape import Escape, MeanEscape, Walks
from ..microfacet.shadowing import Smith
from .lobe import Lobe, WeightedLobe
from .microfacet import MicrofacetLobe


class MultipleScattering(Lobe):
    """f = ρ C (1 - E(wi)) (1 - E(wo)) / (π (1 - Ē)), where E is the albedo of a lobe with F = 1, Ē its mean, and C a
    colour: with C = 1 all that the lobe loses is reflected (C. Kulla and A. Conty, Revisiting physically based shading
    at Imageworks, in: Physically based shading in theory and practice, SIGGRAPH 2017 courses). Reciprocal.

    Draw cos²θ from a density ∝ 1/(b + cos²θ): that is from the cosine on rough surfaces, where b is large, and towards
    grazing angles on smooth ones, which lose light there.
    """

    GRAZING = 30
    """b over (1 - Ē)^1.5. A tenth of it costs .1 of the efficiency of this lobe, and three times as much up to .05."""

    def __init__(self, lobe: MicrofacetLobe, walks: Walks) -> None:
        self.reflectance, self.fresnel, self.anisotropic = lobe.reflectance, lobe.fresnel, lobe.anisotropic
        self.walks, self.mean = walks, walks.mean
        lost = dr.maximum(self.mean.lost, EPSILON)
        self.b = self.GRAZING * lost * dr.sqrt(lost)
        self.norm = dr.log(1 + dr.rcp(self.b))

    def colour(self, i: Escape, o: Escape | MeanEscape) -> Spectrum:
        """Return C for what becomes of light from both directions, or of the mean one; it is 1 if F is."""
        raise NotImplementedError(f"{type(self).__name__} does not define colour.")

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        i = self.walks.of(wi)
        return self.reflectance * self.colour(i, self.mean) * i.lost

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        i, o = self.walks.of(wi), self.walks.of(wo)
        scale = i.lost * o.lost / dr.maximum(self.mean.lost, EPSILON)
        cosine = wo.z * dr.inv_pi
        return self.reflectance * self.colour(i, o) * (scale * cosine), cosine / ((self.b + wo.z * wo.z) * self.norm)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        cos2 = self.b * (dr.exp(v.x * self.norm) - 1)
        sin, (sin_phi, cos_phi) = safe_sqrt(1 - cos2), dr.sincos(dr.two_pi * v.y)
        return mi.Vector3f(sin * cos_phi, sin * sin_phi, safe_sqrt(cos2))


class WalkLobe(MultipleScattering):
    """The colour of a walk that is reflected at wi's end and at wo's by F₁, and in between by F₂, which are means of F,
    and escapes at the second reflection with probability p, later with q:

        C = F₁(wi) F₁(wo) (p + (1 - p) F₂ q / (1 - F₂ (1 - q))),  p = p(wi) + p(wo) - p̄

    p̄ is the mean of p(wo) under the lobe: so the mean of p over wo is p(wi), as in the walk.
    """

    def colour(self, i: Escape, o: Escape | MeanEscape) -> Spectrum:
        second, between = dr.clip(i.second + o.second - self.mean.second, 0, 1), self._reflectance(self.mean)
        later = between * self.mean.third / (1 - between * (1 - self.mean.third))
        return self._reflectance(i) * self._reflectance(o) * (second + (1 - second) * later)

    def _reflectance(self, facets: Any) -> Spectrum:
        return self.fresnel.mean(facets.schlick, facets.dip)


class KullaContyLobe(MultipleScattering):
    """Kulla and Conty's colour, a geometric series in the means F̄ = 2 ∫ F cosθ dcosθ and Ē:
    C = F̄² Ē / (1 - F̄ (1 - Ē))."""

    def colour(self, i: Escape, o: Escape | MeanEscape) -> Spectrum:
        mean, lost = self.fresnel.mean(1 / 21, 1 / 126), self.mean.lost
        return mean * mean * (1 - lost) / (1 - mean * lost)


class TurquinLobe(WeightedLobe):
    """A lobe times a factor that adds unpolarized light."""

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        value, pdf = self.eval_pdf(wi, wo)
        matrix, _ = self.lobe.mueller_pdf(wi, wo, x_i, x_o)
        return matrix + mi.depolarizer(value - matrix[0, 0]), pdf


def turquin(lobe: MicrofacetLobe, walks: Walks) -> Lobe:
    """Return a lobe scaled by 1 + F(1) (1 - E(wi)) / E(wi), which is not reciprocal (E. Turquin, Practical multiple
    scattering compensation for microfacet models, 2019)."""

    def scale(wi: mi.Vector3f, wo: Any = None) -> Spectrum:
        lost = walks.of(wi).lost
        return 1 + lobe.fresnel(mi.Float(1)) * (lost / dr.maximum(1 - lost, EPSILON))

    scaled = TurquinLobe(lobe, scale, scale)
    scaled.reciprocal = False
    return scaled


def multiscattering(model: Any, lobe: MicrofacetLobe) -> tuple[Lobe, ...]:
    """Return a lobe of a model with what its ``multiscatter`` adds, if it has that word."""
    way, smith = model.parameters.chosen.get("multiscatter", "none"), lobe.shadowing
    if way == "none" or not isinstance(smith, Smith):
        return (lobe,)
    walks = Walks(smith)
    if way == "turquin":
        return (turquin(lobe, walks),)
    return lobe, (WalkLobe if way == "walk" else KullaContyLobe)(lobe, walks)
