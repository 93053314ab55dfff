"""Mistakes that mypy must find: it reports a comment here that ignores none."""

from __future__ import annotations

import mitsuba as mi

from mi_brdfs.lobes import LambertLobe, Lobe, MicrofacetLobe
from mi_brdfs.math import Spectrum
from mi_brdfs.microfacet.distributions import GGX
from mi_brdfs.microfacet.facet import Cosines, Facet
from mi_brdfs.microfacet.fresnel import Schlick, Unit
from mi_brdfs.microfacet.shadowing import Kelemen, Shadowing
from mi_brdfs.model import Model, Values
from mi_brdfs.parameters import Choice, Flag, Number


class Mistaken(Model):
    alpha = Number(0.1, (1e-4, 1), "roughness")
    variant = Choice(("one", "two"), "a word")
    is_bright = Flag(True, "a flag")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        if self.variant == 1:  # type: ignore[comparison-overlap]
            return LambertLobe(0.5)  # type: ignore[return-value]
        if self.is_bright == "true":  # type: ignore[comparison-overlap]
            return (MicrofacetLobe(1, Kelemen(), GGX(p.alpha, p.alpha), Unit()),)  # type: ignore[arg-type]
        return (LambertLobe(self.alpha),)  # type: ignore[arg-type]


class MistakenLobe(Lobe):
    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:  # type: ignore[return]
        Schlick(0.04)(wi)  # type: ignore[arg-type]

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        value = mi.UnpolarizedSpectrum(wo.z)
        return wo.z + "a", value  # type: ignore[operator, return-value]

    def sample(self, wi: mi.Vector3f, u: mi.Float) -> mi.Vector3f:  # type: ignore[override]
        return Facet.between(wi, wi.z).wo  # type: ignore[arg-type]


class MistakenShadowing(Shadowing):
    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return facet.cos_t  # type: ignore[union-attr]
