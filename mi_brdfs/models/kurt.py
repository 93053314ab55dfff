from __future__ import annotations

from ..lobes import LambertLobe, Lobe, MicrofacetLobe
from ..microfacet.distributions import Beckmann
from ..microfacet.fresnel import Schlick
from ..microfacet.shadowing import KurtShadowing
from ..model import Model, Values
from ..parameters import Number, PerLobe, Reflectance, Rotation


class Kurt(Model):
    """Kurt, Szirmay-Kalos and Křivánek's anisotropic model (2010): Beckmann facets with an adjustable grazing term.

    M. Kurt, L. Szirmay-Kalos and J. Křivánek, An anisotropic BRDF model for fitting and Monte Carlo rendering, ACM
    SIGGRAPH Computer Graphics 44(1), 2010, doi:10.1145/1722991.1722996.

        f = ρd/π + Σ ks F(wi·h) D(h) / (4 (wi·h) (cosθ_i cosθ_o)^κ)
        D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴),    F = f0 + (1-f0) (1-wi·h)⁵

    with h = (wi+wo)/|wi+wo|, summed over one to eight lobes of ``specular_reflectance_i`` (ks), ``f0_i``, ``alpha_i``
    (or ``alpha_u_i`` and ``alpha_v_i``) and ``kurt_exponent_i`` (κ, the paper's α), numbered from 1; a single lobe
    needs no number. As a microfacet model, each lobe has Beckmann's D and the shadowing term G = (cosθ_i
    cosθ_o)^(1-κ)/(wi·h).

    Reciprocal. Energy-conserving for κ = 0 with ρd + Σ ks <= 1. Otherwise the albedo diverges at grazing angles: for
    κ = 0.25 and F = 1 it exceeds 1 from 89.9° on for α = 0.3, and from 88° on for α = 1; for κ = 0.5 and α = 0.1 it is
    1.05 at 88° and 3.7 at 89.9°. The power 4 of the cosine in D was not checked against the paper. One-sided.
    Depolarises.

    Sampling: an antithetic pair of half vectors (mi_brdfs.microfacet.sampling.Pair), none below the horizon.

    Example
    -------
    {"type": "kurt", "diffuse_reflectance": {"type": "rgb", "value": [0.03, 0.2, 0.2]}, "alpha_1": 0.05, "alpha_2": 0.3}
    """

    family = "microfacets"

    diffuse_reflectance = Reflectance(0.5, "albedo ρd of the diffuse lobe", role="diffuse")
    specular = PerLobe(
        8,
        specular_reflectance=Reflectance(1, "scale ks of lobe i", role="specular"),
        f0=Reflectance(0.04, "Fresnel reflectance of lobe i at normal incidence", role="fresnel"),
        alpha=Number(0.1, (1e-4, 2), "roughness of lobe i, the root mean square slope of its facets", anisotropic=True),
        kurt_exponent=Number(0.25, (0, 0.5), "exponent κ of lobe i: the higher, the brighter at grazing"),
    )
    rotation = Rotation()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        glossy = [
            MicrofacetLobe(
                lobe.specular_reflectance, Beckmann(*lobe.alpha), KurtShadowing(lobe.kurt_exponent), Schlick(lobe.f0)
            )
            for lobe in p.specular
        ]
        return LambertLobe(p.diffuse_reflectance), *glossy
