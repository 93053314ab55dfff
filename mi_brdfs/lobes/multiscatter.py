"""Light that the facets of a lobe reflect more than once."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, Spectrum, luminance, safe_sqrt
from ..microfacet.escape import Escape, Walks, table
from ..microfacet.fresnel import Unit
from ..microfacet.shadowing import Smith
from ..microfacet.terms import Fresnel, basis
from .lobe import Lobe, WeightedLobe
from .microfacet import MicrofacetLobe

HEMISPHERE = 1 / 21, 1 / 126
"""The means of (1 - cosθ)⁵ and cosθ (1 - cosθ)⁶ over a hemisphere, weighed by cosθ."""


class MultipleScattering(Lobe):
    """f = C (1 - E(wi)) (1 - E(wo)) / (π (1 - Ē)), where E is the albedo of a lobe with F = 1, Ē its mean, and C a
    colour: with C = 1 all that the lobe loses is reflected (C. Kulla and A. Conty, Revisiting physically based shading
    at Imageworks, in: Physically based shading in theory and practice, SIGGRAPH 2017 courses). Reciprocal.

    Draw cos²θ from a density ∝ 1/(b + cos²θ): that is from the cosine on rough surfaces, where b is large, and towards
    grazing angles on smooth ones, which lose light there.
    """

    GRAZING = 30
    """b over (1 - Ē)^1.5. A tenth of it costs .1 of the efficiency of this lobe, and three times as much up to .05."""

    def __init__(self, lobe: MicrofacetLobe, walks: Walks, uniform: Callable[[str, Any], Any]) -> None:
        self.anisotropic, self.walks, self.mean = lobe.anisotropic, walks, walks.mean
        self.fresnel = uniform("fresnel", lobe.fresnel.combination())
        self.colours = uniform("colours", self.between(lobe.reflectance))
        lost = dr.maximum(self.mean.lost, EPSILON)
        b = self.GRAZING * lost * dr.sqrt(lost)
        self.b, self.norm, self.scale = uniform("lobe", (b, dr.log(1 + dr.rcp(b)), dr.inv_pi / lost))
        self.bright = uniform("brightness", tuple(luminance(it) for it in self.fresnel))

    def between(self, reflectance: Spectrum) -> tuple[Spectrum, ...]:
        """Return what of the colour is the same for all directions: by default all of it, ρ, as for F = 1."""
        return (reflectance,)

    def colour(self, i: Escape, o: Escape | None = None) -> Spectrum:
        """Return C for what becomes of light from both directions, or without the other one an estimate of its mean."""
        return self.colours[0]

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        i = self.walks.of(wi)
        return self.colour(i) * i.lost

    def lobe_albedo(self, wi: mi.Vector3f) -> mi.Float:
        """Return an estimate of the albedo of the lobe itself over its ρ, from F at a typical facet: at grazing angles
        those count that lean towards ``wi``."""
        typical = dr.minimum(wi.z + (self.walks.smith.length(wi) - wi.z) * (1 - wi.z), 1)
        _, schlick, dip = basis(typical)
        fresnel = Fresnel.mean(self.bright, schlick, dip)
        # It may vanish at one angle.
        least = 0.25 * Fresnel.mean(self.bright, *HEMISPHERE)
        return (1 - self.walks.of(wi).lost) * dr.maximum(fresnel, least)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return 0  # as mirrors, facets lose nothing

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        i, o = self.walks.of(wi), self.walks.of(wo)
        # What is the same for all directions of wi comes first, so that Dr.Jit computes it once.
        value = self.colour(i, o) * (i.lost * self.scale * (o.lost * wo.z))
        return value, wo.z * dr.inv_pi / ((self.b + wo.z * wo.z) * self.norm)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        # The angle is that of visible normals, too, which Dr.Jit computes once.
        cos2, (sin_phi, cos_phi) = self.b * (dr.exp(v.y * self.norm) - 1), dr.sincos(dr.two_pi * v.x)
        sin = safe_sqrt(1 - cos2)
        return mi.Vector3f(sin * cos_phi, sin * sin_phi, safe_sqrt(cos2))


class WalkLobe(MultipleScattering):
    """The colour of a walk that is reflected at wi's end and at wo's by R, and in between by F₂, the mean of F there,
    and escapes at the second reflection with probability p, later with q:

        C = ρ R(wi) R(wo) (p + (1 - p) L),  L = F₂ q / (1 - F₂ (1 - q)),  p = p(wi) + p(wo) - p̄
        R = F̄₁ s (2 + s)/3,  s = (1 + 3 F₁/F̄₁)/4

    p̄ is the mean of p(wo) under the lobe: so the mean of p over wo is p(wi), as in the walk. F₁(w) is F̄₁ and what F
    differs by from its means both at the first and at a later reflection of light from w. The product of the two, which
    is about R(wi) times the mean of R(wo), is ((F₁ + F̄₁)/2)² if both differ alike, as on facets that are seen at
    grazing angles again and again, and F₁ F̄₁ if one does. R is three quarters of the first and a quarter of the second.
    """

    MOST = 5
    """The largest s, of an F that nearly vanishes on the mean."""

    def between(self, reflectance: Spectrum) -> tuple[Spectrum, ...]:
        mean = Fresnel.mean(self.fresnel, self.mean.schlick, self.mean.dip)
        between, third = Fresnel.mean(self.fresnel, *self.mean.between), self.mean.third
        later = between * third / (1 - between * (1 - third))
        reflectance, scale = reflectance * dr.square(mean), 0.75 / dr.maximum(mean, EPSILON)
        normal, *others = self.fresnel
        return reflectance * later, reflectance * (1 - later), 0.25 + normal * scale, *(it * scale for it in others)

    def colour(self, i: Escape, o: Escape | None = None) -> Spectrum:
        later, sooner, *of_s = self.colours
        ends = [i] if o is None else [i, o]
        each = (Fresnel.mean(of_s, end.schlick, end.dip, self.MOST) for end in ends)
        second = 1 if o is None else dr.maximum(i.second + o.second, 0)
        return math.prod(s * (2 + s) / 3 for s in each) * (later + second * sooner)


class KullaContyLobe(MultipleScattering):
    """Kulla and Conty's colour, a geometric series in the means F̄ = 2 ∫ F cosθ dcosθ and Ē:
    C = ρ F̄² Ē / (1 - F̄ (1 - Ē))."""

    def between(self, reflectance: Spectrum) -> tuple[Spectrum, ...]:
        mean, lost = Fresnel.mean(self.fresnel, *HEMISPHERE), self.mean.lost
        return (reflectance * mean * mean * (1 - lost) / (1 - mean * lost),)


class TurquinLobe(WeightedLobe):
    """A lobe times a factor that adds unpolarized light."""

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        value, pdf = self.eval_pdf(wi, wo)
        matrix, _ = self.lobe.mueller_pdf(wi, wo, x_i, x_o)
        return matrix + mi.depolarizer(mi.UnpolarizedSpectrum(value - matrix[0, 0])), pdf


def turquin(lobe: MicrofacetLobe, walks: Walks) -> Lobe:
    """Return a lobe scaled by 1 + F(1) (1 - E(wi)) / E(wi), which is not reciprocal (E. Turquin, Practical multiple
    scattering compensation for microfacet models, 2019)."""

    def scale(wi: mi.Vector3f, wo: Any = None) -> Spectrum:
        lost = walks.of(wi).lost
        return 1 + lobe.fresnel(mi.Float(1)) * (lost / dr.maximum(1 - lost, EPSILON))

    scaled = TurquinLobe(lobe, scale, scale)
    scaled.reciprocal = False
    return scaled


def multiscattering(model: Any, lobe: MicrofacetLobe, index: int) -> tuple[Lobe, ...]:
    """Return the model's lobe of facets of that index with what its ``multiscatter`` adds, if it has that word."""
    way, smith = model.parameters.chosen.get("multiscatter", "none"), lobe.shadowing
    if way == "none" or not isinstance(smith, Smith):
        return (lobe,)
    if way == "walk" and smith.facets == "ggx":
        smith.correlated = True  # as the walk's first reflection is; for others it hardly matters
    if not model.captured:
        model.captured += [table(smith), model.uniform.kept]

    def uniform(name: str, values: Any) -> Any:
        return model.uniform(f"{name} {index}", values)

    walks = Walks(smith, model.captured[0], uniform)
    if way == "turquin":
        return (turquin(lobe, walks),)
    kind = WalkLobe if way == "walk" else KullaContyLobe
    added = (MultipleScattering if isinstance(lobe.fresnel, Unit) else kind)(lobe, walks, uniform)
    lobe.tabulated = added.lobe_albedo
    return lobe, added
