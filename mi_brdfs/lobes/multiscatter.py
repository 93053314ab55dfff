"""Light that the facets of a lobe reflect more than once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, Spectrum, clamp, select
from ..microfacet.escape import Escape, Walks, textures
from ..microfacet.shadowing import Smith
from ..parameters import Choice, ParameterError
from .lobe import Lobe, WeightedLobe
from .microfacet import MicrofacetLobe


class MultipleScattering(Lobe):
    """f = ρ C (1 - E(wi)) (1 - E(wo)) / (π (1 - Ē)), where E is the albedo of a lobe with F = 1, Ē its mean, and C a
    colour: with C = 1 all that the lobe loses is reflected (C. Kulla and A. Conty, Revisiting physically based shading
    at Imageworks, in: Physically based shading in theory and practice, SIGGRAPH 2017 courses). Reciprocal.

    Draw from the cosine on rough surfaces, and uniformly on smooth ones, which lose light at grazing angles above all.
    """

    SMOOTH = 8
    """1/α of surfaces of which one direction in e is uniform. Efficiencies are within .01 for 4 to 16; the cosine alone
    costs .04 at α = .05 and 80°."""

    def __init__(self, lobe: MicrofacetLobe, walks: Walks) -> None:
        self.reflectance, self.fresnel, self.anisotropic = lobe.reflectance, lobe.fresnel, lobe.anisotropic
        self.walks, self.mean = walks, walks.mean
        self.uniform = dr.exp(-self.SMOOTH * dr.sqrt(walks.smith.alpha_u * walks.smith.alpha_v))

    def colour(self, i: Escape, o: Escape) -> Spectrum:
        """Return C for what becomes of light from both directions; it is 1 if F is."""
        raise NotImplementedError(f"{type(self).__name__} does not define colour.")

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        i, typical = self.walks.of(wi), Escape(self.mean.lost, self.mean.second, self.mean.schlick, self.mean.dip)
        return self.reflectance * self.colour(i, typical) * i.lost

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        i, o, cosine = self.walks.of(wi), self.walks.of(wo), wo.z * dr.inv_pi
        scale = i.lost * o.lost / dr.maximum(self.mean.lost, EPSILON)
        return self.reflectance * self.colour(i, o) * (scale * cosine), dr.lerp(cosine, dr.inv_two_pi, self.uniform)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        uniform, cosine = (
            warp(v) for warp in (mi.warp.square_to_uniform_hemisphere, mi.warp.square_to_cosine_hemisphere)
        )
        return select(u < self.uniform, uniform, cosine)


class WalkLobe(MultipleScattering):
    """The colour of a walk that is reflected at wi's end and at wo's by F₁, and in between by F₂, which are means of F,
    and escapes at the second reflection with probability p, later with q:

        C = F₁(wi) F₁(wo) (p + (1 - p) F₂ q / (1 - F₂ (1 - q))),  p = p(wi) + p(wo) - p̄

    p̄ is the mean of p(wo) under the lobe: so the mean of p over wo is p(wi), as in the walk.
    """

    def colour(self, i: Escape, o: Escape) -> Spectrum:
        second, between = clamp(i.second + o.second - self.mean.second, 0, 1), self._reflectance(self.mean)
        later = between * self.mean.third / (1 - between * (1 - self.mean.third))
        return self._reflectance(i) * self._reflectance(o) * (second + (1 - second) * later)

    def _reflectance(self, facets: Any) -> Spectrum:
        return self.fresnel.mean(facets.schlick, facets.dip)


class KullaContyLobe(MultipleScattering):
    """Kulla and Conty's colour, a geometric series in the means F̄ = 2 ∫ F cosθ dcosθ and Ē:
    C = F̄² Ē / (1 - F̄ (1 - Ē))."""

    def colour(self, i: Escape, o: Escape) -> Spectrum:
        mean, lost = self.fresnel.mean(1 / 21, 1 / 126), self.mean.lost
        return mean * mean * (1 - lost) / (1 - mean * lost)


def turquin(lobe: MicrofacetLobe, walks: Walks) -> Lobe:
    """Return a lobe scaled by 1 + F(1) (1 - E(wi)) / E(wi), which is not reciprocal (E. Turquin, Practical multiple
    scattering compensation for microfacet models, 2019)."""

    def scale(wi: mi.Vector3f, wo: Any = None) -> Spectrum:
        lost = walks.of(wi).lost
        return 1 + lobe.fresnel(mi.Float(1)) * (lost / dr.maximum(1 - lost, EPSILON))

    scaled = WeightedLobe(lobe, scale, scale)
    scaled.reciprocal = False
    return scaled


WAYS: dict[str, Callable[[MicrofacetLobe, Walks], tuple[Lobe, ...]]] = {
    "none": lambda lobe, walks: (lobe,),
    "walk": lambda lobe, walks: (lobe, WalkLobe(lobe, walks)),
    "kulla-conty": lambda lobe, walks: (lobe, KullaContyLobe(lobe, walks)),
    "turquin": lambda lobe, walks: (turquin(lobe, walks),),
}
MULTISCATTER = Choice(tuple(WAYS), "with Smith's shadowing term: light that facets reflect more than once")


def multiscattering(model: Any, lobe: MicrofacetLobe) -> tuple[Lobe, ...]:
    """Return a lobe of a model with what its ``multiscatter`` adds."""
    if model.multiscatter == "none":
        return (lobe,)
    smith = lobe.shadowing
    if not isinstance(smith, Smith):
        raise ParameterError(
            f'{model.plugins[0]}: multiscatter = "{model.multiscatter}" is known for Smith\'s shadowing term only; '
            "take it with that, or leave it out."
        )
    if not model.captured:
        model.captured += textures(smith)
    return WAYS[model.multiscatter](lobe, Walks(smith, *model.captured))
