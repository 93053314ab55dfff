from __future__ import annotations

from ..lobes import Lobe, facet_lobes, over_diffuse
from ..lobes.facets import HAZE, HAZE_SPREAD, RETROREFLECTIVITY
from ..microfacet.distributions import GGX
from ..microfacet.film import FILM_IOR, FILM_THICKNESS, filmed
from ..microfacet.shadowing import MULTISCATTER
from ..model import Model, Values
from ..parameters import Choice, FresnelSet, Number, Reflectance, Rotation


class Walter(Model):
    """The reflection part of the GGX microfacet model of Walter, Marschner, Li and Torrance (2007).

    B. Walter, S. R. Marschner, H. Li and K. E. Torrance, Microfacet models for refraction through rough surfaces, EGSR
    2007, doi:10.2312/EGWR/EGSR07/195-206. For the anisotropic and the height-correlated form: E. Heitz, Understanding
    the masking-shadowing function in microfacet-based BRDFs, Journal of Computer Graphics Techniques 3(2), 2014,
    https://jcgt.org/published/0003/02/03/.

        f = ρd/π + ρs F(wi·h) D(h) G(wi, wo) / (4 cosθ_i cosθ_o)
        D = 1 / (π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²)
        Λ(v) = ½ (√(1 + ((αu v_x)² + (αv v_y)²)/v_z²) - 1)

    with h = (wi+wo)/|wi+wo| and, by ``shadowing``, G = 1/((1+Λ(wi))(1+Λ(wo))) (separable, as published) or
    1/(1+Λ(wi)+Λ(wo)) (correlated). F is exact for conductors (``eta`` and ``k``, or ``material``) and dielectrics
    (``int_ior`` over ``ext_ior``), Schlick's approximation for ``f0``, and 1 if none of them is given. For f82, f90,
    ``film_thickness``, ``haze`` and ``retroreflectivity`` see ``microfacet``.

    Reciprocal, except for ``multiscatter`` = turquin. Energy-conserving with ρd + ρs <= 1: the lobe's albedo stays
    below ρs, and far below for rough surfaces, as light is reflected only once (α = 1, F = 1: 0.31 ρs at normal
    incidence), unless ``multiscatter`` says what becomes of the rest, as in ``microfacet``. Same as Mitsuba's
    ``roughconductor`` with ``distribution="ggx"`` (separable), in polarized variants, too. One-sided.

    In polarized variants facets of conductors and dielectrics polarise the light as a smooth surface or film does. All
    else depolarises it: ``f0``, F = 1, the diffuse lobe, and what ``multiscatter`` adds.

    Sampling: an antithetic pair of visible normals, bounded and tilted towards the normal, one chosen by how much each
    reflects (mi_brdfs.microfacet.visible.VisibleNormals). At most 0.6 % of the samples fall below the horizon for one
    alpha up to 1, 27 % for αu : αv = 1 : 0.125, and 42 % for alpha = 2.

    Example
    -------
    {"type": "walter", "material": "Au", "alpha": 0.2}
    """

    family = "microfacets"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default", role="diffuse")
    specular_reflectance = Reflectance(1, "scale ρs of the specular lobe; 1 is physical", role="specular")
    alpha = Number(0.1, (1e-4, 2), "roughness α of the facets", anisotropic=True)
    fresnel = FresnelSet()
    shadowing = Choice(("separable", "correlated"), "Smith's shadowing term")
    multiscatter = MULTISCATTER
    film_thickness, film_ior = FILM_THICKNESS, FILM_IOR
    haze, haze_spread, retroreflectivity = HAZE, HAZE_SPREAD, RETROREFLECTIVITY
    rotation = Rotation()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        correlated = self.shadowing == "correlated"
        specular = facet_lobes(
            self, p, p.specular_reflectance, GGX(*p.alpha), lambda facets: facets.smith(correlated), filmed(self, p)
        )
        return over_diffuse(p.diffuse_reflectance, *specular)
