from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import LambertLobe, Lobe, MicrofacetLobe
from ..math import EPSILON
from ..microfacet.distributions import EPD
from ..microfacet.facet import Cosines, Facet
from ..microfacet.fresnel import Schlick
from ..microfacet.shadowing import Shadowing
from ..model import Model, Values
from ..parameters import Choice, Colour, Number, Reflectance


class Brady(Model):
    """Model A of Brady, Lawrence, Peers and Weimer's genBRDF (2014), found by genetic programming.

    A. Brady, J. Lawrence, P. Peers and W. Weimer, genBRDF: discovering new analytic BRDFs with genetic programming,
    ACM Transactions on Graphics 33(4), 2014, doi:10.1145/2601097.2601193.

        f = ρd/π + K ρs F(wi·h)/(4 (wi·h)) exp(-(tanθ_h/β²)^α),    F = f0 + (1-f0) (1-wi·h)⁵

    with h = (wi+wo)/|wi+wo|. α = 2 has the tail of a Gaussian; lower α have longer tails. ``normalization`` chooses K:

    * unit: (α/2)/(π β⁴ Γ(2/α)), which makes the exponential over cos⁴θ_h an NDF, that of ``epd`` in ``microfacet`` with
      alpha = β² and gamma = α/2. Narrow lobes have an albedo of about ρs F at normal incidence.
    * none: 1, as published. This leaves the scale of the lobe to ρs, which a fit makes as large as needed: with ρs = 1
      the albedo is at most 0.025 for α = 2, β = 0.3, F = 1.

    The formula was checked against public code only, not against the paper; the paper's model B is not part of this
    plugin.

    Reciprocal. Energy-conserving for ``unit`` with ρd + ρs <= 1: for F = 1 the albedo is at most ρs, and that of narrow
    lobes falls like cosθ_i towards grazing angles. One-sided. Depolarises.

    Sampling: an antithetic pair of half vectors (mi_brdfs.microfacet.sampling.Pair), none below the horizon.

    Example
    -------
    {"type": "brady", "f0": 0.6, "exponent": 0.8, "diffuse_reflectance": 0.1}
    """

    family = "fits to measurements"

    diffuse_reflectance = Reflectance(0.5, "albedo ρd of the diffuse lobe", role="diffuse")
    specular_reflectance = Colour(1, (0, float("inf")), "scale ρs of the specular lobe", role="specular")
    f0 = Reflectance(0.04, "Fresnel reflectance at normal incidence", role="fresnel")
    exponent = Number(2, (0.1, 3), "exponent α: the lower, the longer the tail of the lobe")
    beta = Number(0.3, (0.01, 2), "width β of the lobe, the square root of a slope")
    normalization = Choice(("unit", "none"), "scale K")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        distribution = Exponential(dr.square(p.beta), 0.5 * p.exponent, self.normalization == "unit")
        specular = MicrofacetLobe(p.specular_reflectance, distribution, Projected(), Schlick(p.f0))
        return LambertLobe(p.diffuse_reflectance), specular


class Projected(Shadowing):
    """The shadowing term that turns 1/(cosθ_i cosθ_o) into 1/(wi·h)."""

    lean = 1

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return facet.cos_i * facet.cos_o / facet.cos_d


class Exponential(EPD):
    """D = K exp(-(tan²θ_h/α²)ᵞ), without the EPD's 1/cos⁴θ_h."""

    def __init__(self, alpha: mi.Float, gamma: mi.Float, unit: bool) -> None:
        super().__init__(alpha, gamma)
        if not unit:
            self.scale = 1

    def _limited(self, tan2: mi.Float) -> mi.Float:
        return tan2 / (1 + tan2)

    def _rest(self, tan2: mi.Float) -> mi.Float:
        return 1 / dr.square(1 + tan2)

    def eval(self, facet: Facet) -> mi.Float:
        return self.scale * dr.exp(-self._power(facet.sin2_h / dr.maximum(dr.square(facet.cos_h), EPSILON)))

    def estimated_albedo(self, cos: mi.Float) -> mi.Float:
        """∫ D cosθ_h dω_h, as the ramps have it."""
        return self.scale * dr.pi * self.ramps.total
