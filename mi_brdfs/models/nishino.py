from __future__ import annotations

from ..lobes import Lobe, MicrofacetLobe, over_diffuse
from ..microfacet.distributions import HemiEPD
from ..microfacet.fresnel import Unit
from ..microfacet.shadowing import Implicit, VCavity
from ..model import Model, Values
from ..parameters import FresnelSet, Number, OneOf, Reflectance


class Nishino(Model):
    """The hemispherical exponential power distribution of Nishino and Lombardi's directional statistics BRDF (2011).

    K. Nishino and S. Lombardi, Directional statistics-based reflectance model for isotropic bidirectional reflectance
    distribution functions, Journal of the Optical Society of America A 28(1), 2011, doi:10.1364/JOSAA.28.000008;
    first K. Nishino, Directional statistics BRDF model, ICCV 2009.

        D = C |exp(κ cosᵞθ_h) - 1|,    ∫ D cosθ_h dω_h = 1

    with h = (wi+wo)/|wi+wo|. κ < 0 gives a flat-topped lobe with steep sides, κ > 0 a peaked one, and κ → 0 Blinn's,
    (γ+2)/(2π) cosᵞθ_h. The higher γ, the narrower the lobe. By ``variant``,

    * microfacet: f = ρd/π + ρs F(wi·h) D G/(4 cosθ_i cosθ_o), for facets of this distribution in V-cavities, G = min(1,
      2 cosθ_h cosθ_i/(wi·h), 2 cosθ_h cosθ_o/(wi·h)). F is exact for conductors (``eta`` and ``k``, or ``material``)
      and dielectrics (``int_ior`` over ``ext_ior``), Schlick's approximation for ``f0``, and 1 if none of them is
      given.
    * dsbrdf: f = ρd/π + ρs D/4. In the paper the BRDF itself has this distribution, without F and G, as a sum of lobes
      whose κ and γ are curves over the angle between wi and h, one for each colour channel. Here it is one lobe with
      constant κ and γ; the factor 1/4 makes the albedo of a narrow lobe about ρs at normal incidence.

    C was derived here, for every κ and γ. The paper was not at hand: its notation is cited from public code and from
    memory.

    Reciprocal. Energy-conserving for ``microfacet`` with ρd + ρs <= 1. For ``dsbrdf`` the albedo falls towards grazing
    angles, like cos²θ_i for narrow lobes. One-sided.

    In polarized variants facets of conductors and dielectrics polarise the light as a smooth surface does; ``f0``,
    F = 1, ``dsbrdf`` and the diffuse lobe depolarise it.

    Sampling: an antithetic pair of half vectors (mi_brdfs.microfacet.sampling.Pair), none below the horizon.

    Example
    -------
    {"type": "nishino", "kappa": -8, "gamma": 40, "material": "Cu"}
    """

    family = "fits to measurements"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default", role="diffuse")
    specular_reflectance = Reflectance(1, "scale ρs of the specular lobe", role="specular")
    kappa = Number(-5, (-80, 80), "κ: below 0 the lobe has a flat top, above 0 a peak")
    gamma = Number(100, (0, 1e5), "exponent γ: the higher, the narrower the lobe")
    variant = OneOf(
        {"microfacet": {"fresnel": FresnelSet()}, "dsbrdf": {}}, "distribution of the facets, or of f itself"
    )

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        distribution = HemiEPD(p.kappa, p.gamma)
        terms = (VCavity(), p.variant.fresnel) if self.variant == "microfacet" else (Implicit(), Unit())
        specular = MicrofacetLobe(p.specular_reflectance, distribution, *terms)
        return over_diffuse(p.diffuse_reflectance, specular)
