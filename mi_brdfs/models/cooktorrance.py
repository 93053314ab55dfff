from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe, facet_lobes, over_diffuse
from ..lobes.facets import HAZE, HAZE_SPREAD, RETROREFLECTIVITY
from ..microfacet.distributions import GGX, Beckmann, Blinn, Distribution
from ..microfacet.film import FILM_IOR, FILM_THICKNESS, filmed
from ..microfacet.shadowing import VCavity
from ..model import Model, Values
from ..parameters import Choice, FresnelSet, Number, Preset, Reflectance


class CookTorrance(Model):
    """Cook and Torrance's microfacet model (1982): Beckmann facets in V-cavities.

    R. L. Cook and K. E. Torrance, A reflectance model for computer graphics, ACM Transactions on Graphics 1(1), 1982,
    doi:10.1145/357290.357293. K. E. Torrance and E. M. Sparrow, Theory for off-specular reflection from roughened
    surfaces, Journal of the Optical Society of America 57(9), 1967, doi:10.1364/JOSA.57.001105.

        f = ρd/π + ρs F(wi·h) D(h) G(wi, wo) / (4 cosθ_i cosθ_o)
        G = min(1, 2 cosθ_h cosθ_i / (wi·h), 2 cosθ_h cosθ_o / (wi·h))

    with h = (wi+wo)/|wi+wo| and, by ``distribution``,

    * beckmann: D = exp(-tan²θ_h/α²) / (π α² cos⁴θ_h)
    * ggx: D = α² / (π (sin²θ_h + α² cos²θ_h)²)
    * blinn: D = (n+2)/(2π) cosθ_h^n with n = 2/α² - 2; α is limited to 1

    F is exact for conductors (``eta`` and ``k``, or ``material``) and dielectrics (``int_ior`` over ``ext_ior``, in the
    paper's form), Schlick's approximation for ``f0``, and 1 if none of them is given. For f82, f90, a film, ``haze``
    and ``retroreflectivity`` see ``microfacet``. ``normalization`` is

    * modern: as above, where D is an NDF (∫ D cosθ_h = 1) and 4 comes from the Jacobian of the half vector. This agrees
      with the conference version of 1981, which has D/4 and 1/π.
    * tog82: four times that, as printed in 1982, where D lost its factor 1/4. The albedo is up to 4 ρs.

    Reciprocal. Energy-conserving for ``modern`` with ρd + ρs <= 1. For the paper's sum of several D of different
    roughness, use ``blendbsdf``. One-sided.

    In polarized variants facets of conductors and dielectrics polarise the light as a smooth surface or film does;
    ``f0``, F = 1 and the diffuse lobe depolarise it.

    Sampling: an antithetic pair of half vectors (mi_brdfs.microfacet.sampling.Pair), none below the horizon.

    Example
    -------
    {"type": "cooktorrance", "material": "Cu", "alpha": 0.25}
    """

    family = "microfacets"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default", role="diffuse")
    specular_reflectance = Reflectance(1, "scale ρs of the specular lobe; 1 is physical", role="specular")
    alpha = Number(0.1, (1e-4, 2), "roughness α (the paper's m), the root mean square slope of the facets")
    fresnel = FresnelSet()
    distribution = Choice(("beckmann", "ggx", "blinn"), "distribution of the facets; blinn limits α to 1")
    normalization = Choice(("modern", "tog82"), "scale of the specular lobe")
    film_thickness, film_ior = FILM_THICKNESS, FILM_IOR
    haze, haze_spread, retroreflectivity = HAZE, HAZE_SPREAD, RETROREFLECTIVITY
    preset = Preset()

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        if self.distribution == "blinn":
            self.ranges["alpha"] = self.parameters["alpha"].ranges["alpha"] = (1e-4, 1)

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        α = p.alpha
        if self.distribution == "blinn":
            distribution: Distribution = Blinn(2 / dr.square(α) - 2)
        else:
            distribution = {"beckmann": Beckmann, "ggx": GGX}[self.distribution](α, α)
        scale, fresnel = 4 if self.normalization == "tog82" else 1, filmed(self, p)
        specular = facet_lobes(self, p, p.specular_reflectance, distribution, lambda _: VCavity(), fresnel, scale)
        return over_diffuse(p.diffuse_reflectance, *specular)
