"""The lobes of a model's facets, with the words that all models of facets share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import Spectrum, choose
from ..microfacet.shadowing import Shadowing
from ..microfacet.terms import Distribution, Fresnel
from ..parameters import Number
from .lobe import Lobe
from .microfacet import MicrofacetLobe
from .multiscatter import multiscattering

HAZE = Number(None, (0, 1), "share of a second, wider lobe of the facets; omitted by default", sought=False)
SPREAD = 0.5
HAZE_SPREAD = Number(
    None, (0, 1), f"how wide that is: from the first one's roughness √α (0) to 1; {SPREAD} if omitted",
    sought=False, beside="haze",
)  # fmt: skip
RETROREFLECTIVITY = Number(
    None, (0, 1), "share of the light of the facets that goes back where it came from; omitted by default", sought=False
)


def facet_lobes(
    model: Any,
    p: Any,
    colour: Spectrum,
    distribution: Distribution,
    shadowing: Callable[[Distribution], Shadowing],
    fresnel: Fresnel,
    scale: mi.Float = 1,
) -> tuple[Lobe, ...]:
    """Return the lobes of facets, which ``p.haze``, ``p.haze_spread`` and ``p.retroreflectivity`` and the model's
    ``multiscatter`` make of one:

    * with haze, that share of the light comes from facets of roughness √α' = √α + spread (1 - √α) (P. Barla, R.
      Pacanowski and P. Vangorp, A composite BRDF model for hazy gloss, Computer Graphics Forum 37(4), 2018,
      doi:10.1111/cgf.13475, in the words of OpenPBR 1.2);
    * each may be followed by what its facets reflect more than once (:mod:`.multiscatter`);
    * retroreflectivity is that of :class:`RetroreflectiveLobe`.
    """
    shares: list[tuple[Any, Distribution]] = [(1, distribution)]
    if p.haze is not None:
        spread = SPREAD if p.haze_spread is None else p.haze_spread
        shares = [(1 - p.haze, distribution), (p.haze, distribution.widened(spread))]
    lobes: list[Lobe] = []
    for index, (share, facets) in enumerate(shares):
        lobe = MicrofacetLobe(colour * share, facets, shadowing(facets), fresnel, scale)
        first, *others = multiscattering(model, lobe, index)
        if p.retroreflectivity is not None:
            first = RetroreflectiveLobe(first, p.retroreflectivity)
        lobes += [first, *others]
    return tuple(lobes)


class RetroreflectiveLobe(Lobe):
    """(1 - r) f(wi, wo) + r f(wi', wo), where wi' = (-x, -y, z) is the mirror direction of wi: a share r of the facets
    reflects what it would reflect towards there, and so sends light back where it came from (M. Raab, L. Belcour,
    F. Liu and J. Portsmouth, The minimal retroreflective microfacet model, Journal of Computer Graphics Techniques
    15(1), 2026). It is as reciprocal as f, and has its albedo: facets are the same after half a turn about the normal.
    """

    def __init__(self, lobe: Lobe, share: mi.Float) -> None:
        self.lobe, self.share = lobe, share
        self.glossy, self.reciprocal, self.anisotropic = lobe.glossy, lobe.reciprocal, lobe.anisotropic

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.estimated_albedo(wi)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        value, pdf = self.lobe.eval_pdf(wi, wo)
        back, back_pdf = self.lobe.eval_pdf(self._mirrored(wi), wo)
        rest = 1 - self.share
        return value * rest + back * self.share, pdf * rest + back_pdf * self.share

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        value, pdf = self.eval_pdf(wi, wo)
        matrix, _ = self.lobe.mueller_pdf(wi, wo, x_i, x_o)
        matrix = matrix * (1 - self.share)
        return matrix + mi.depolarizer(mi.UnpolarizedSpectrum(value - matrix[0, 0])), pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        back, u = choose(u, self.share)
        return self.lobe.sample(dr.select(back, self._mirrored(wi), wi), u, v)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.mirror_reflectance(wi) * (1 - self.share)

    @staticmethod
    def _mirrored(wi: mi.Vector3f) -> mi.Vector3f:
        return mi.Vector3f(-wi.x, -wi.y, wi.z)
