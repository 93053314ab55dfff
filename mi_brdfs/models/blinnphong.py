from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import LambertLobe, Lobe, MicrofacetLobe
from ..microfacet.distributions import Blinn
from ..microfacet.facet import Cosines, Facet
from ..microfacet.fresnel import Unit
from ..microfacet.shadowing import Implicit, Shadowing
from ..model import Model, Values
from ..parameters import Choice, Number, Preset, Reflectance


class BlinnPhong(Model):
    """Blinn's form of Phong's reflection (1977), a power of the cosine to the half vector, normalised.

    J. F. Blinn, Models of light reflection for computer synthesized pictures, SIGGRAPH 1977,
    doi:10.1145/563858.563893.

        f = ρd/π + ρs K cosθ_h^n

    with h = (wi+wo)/|wi+wo| and, by ``normalization``,

    * energy: K = (n+2)(n+4) / (8π (2^(-n/2) + n)). The lobe's albedo is ρs at normal incidence and falls towards
      grazing angles, so ρd + ρs <= 1 conserves energy.
    * approximate: K = (n+8)/(8π), the approximation common in games. The albedo exceeds ρs by up to 7.5 % (n = 9).
    * ndf: K = (n+2)/(2π), which normalises the power as an NDF. Published fits of measured materials use it. The albedo
      is 2.9 ρs (n = 10) to 3.85 ρs (n = 100) at normal incidence.
    * none: K = 1. Gains energy for small n: the albedo is 8π/((n+2)(n+4)) (2^(-n/2) + n) ρs at normal incidence.
    * original: f cosθ_o = ρs cosθ_h^n/π, where the term is the whole response to a light and π belongs to the light. As
      a BRDF it is neither reciprocal nor bounded at grazing angles.

    As a microfacet model, it has Blinn's distribution D = (n+2)/(2π) cosθ_h^n, F = 1, and the shadowing term G = cosθ_i
    cosθ_o times a constant (cosθ_i alone for ``original``).

    Reciprocal, except for ``original``. Energy-conserving for ``energy`` with ρd + ρs <= 1. One-sided. Depolarises.

    Sampling: an antithetic pair of half vectors, one chosen by how much each reflects
    (mi_brdfs.microfacet.sampling.Pair), with a few uniform directions at grazing for the original normalization; no
    sample falls below the horizon.

    Example
    -------
    {"type": "blinnphong", "diffuse_reflectance": {"type": "rgb", "value": [0.15, 0.3, 0.05]},
     "exponent": 80, "normalization": "ndf"}
    """

    family = "cosine lobes"

    diffuse_reflectance = Reflectance(0.5, "albedo ρd of the diffuse lobe", role="diffuse")
    specular_reflectance = Reflectance(0.2, "scale ρs of the specular lobe", role="specular")
    exponent = Number(30, (0, 1e6), "exponent n: the higher, the narrower the highlight")
    normalization = Choice(("energy", "approximate", "ndf", "none", "original"), "scale of the specular lobe")
    preset = Preset()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        n = p.exponent
        scale = {
            "energy": lambda: (n + 2) * (n + 4) / (8 * dr.pi * (dr.exp2(-0.5 * n) + n)),
            "approximate": lambda: (n + 8) / (8 * dr.pi),
            "ndf": lambda: (n + 2) * dr.inv_two_pi,
            "none": lambda: 1,
            "original": lambda: dr.inv_pi,
        }[self.normalization]()
        scale = 4 * dr.two_pi / (n + 2) * scale  # relative to D; G has the rest
        shadowing = ResponseShadowing() if self.normalization == "original" else Implicit()
        specular = MicrofacetLobe(p.specular_reflectance, Blinn(n), shadowing, Unit(), scale)
        return LambertLobe(p.diffuse_reflectance), specular


class ResponseShadowing(Shadowing):
    """The shadowing term for which f cosθ_o is D/4."""

    lean = 1
    favours_steep = True
    reciprocal = False

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return facet.cos_i
