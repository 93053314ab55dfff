from __future__ import annotations

import drjit as dr

from ..lobes import LambertLobe, Lobe, WeightedLobe, facet_lobes
from ..lobes.facets import HAZE, HAZE_SPREAD, RETROREFLECTIVITY
from ..microfacet.distributions import GGX, Distribution
from ..microfacet.facet import Facet
from ..microfacet.fresnel import Schlick
from ..microfacet.shadowing import MULTISCATTER, SchlickSmith, Shadowing
from ..model import Model, Values
from ..parameters import Number, OneOf, Reflectance


class MetallicRoughness(Model):
    """The metallic-roughness model of real-time rendering (Karis 2013).

    B. Karis, Real shading in Unreal Engine 4, in: Physically based shading in theory and practice, SIGGRAPH 2013
    courses, doi:10.1145/2504435.2504457.

        f = (1 - F(wi·h)) (1 - metallic) C/π + F(wi·h) D(h) G(wi, wo) / (4 cosθ_i cosθ_o)
        F(x) = f0 + (1 - f0) (1 - x)⁵,    f0 = (1 - metallic) 0.04 + metallic C
        D = α² / (π (1 + (α²-1) h_z²)²),    α = r²

    with h = (wi+wo)/|wi+wo|, the base colour C, the roughness r and, by ``shadowing``, G = g(cosθ_i) g(cosθ_o) where

    * direct: g(x) = x/(x (1-k) + k) with k = (r+1)²/8, which Karis uses for analytic lights. It darkens smooth surfaces
      at grazing angles: for C = 1, metallic = 1 and r = 0.1 the albedo is 0.34 at 80°.
    * ibl: the same with k = r²/2, which he uses for image-based lighting; it is nearly Smith's term.
    * smith: Smith's term for GGX, separable, as in ``walter``; with it, ``multiscatter`` says what becomes of light
      that facets reflect more than once, as in ``microfacet``.

    ``haze`` and ``retroreflectivity`` are those of ``microfacet``. There is no film, as F has no index of refraction.

    The factor 1-F of the diffuse lobe is common practice, as in the glTF 2.0 specification; Karis's notes have
    Lambert's lobe without it. It removes the light reflected by the facets between wi and wo, not all the light
    reflected by the specular lobe.

    Reciprocal. Energy-conserving for metallic = 1. Otherwise a bright surface gains energy towards grazing angles, more
    so if smoother: for C = 1, metallic = 0 and r = 0.5 or 0.1, the albedo reaches 1.00 or 1.08 (direct), 1.10 or 1.57
    (ibl), 1.12 or 1.72 (smith). One-sided. Depolarises.

    Sampling: for the diffuse lobe the cosine, for the specular lobe an antithetic pair of visible normals, one chosen
    by how much each reflects (mi_brdfs.microfacet.visible.VisibleNormals). At most 0.6 % of its samples fall below the
    horizon.

    Example
    -------
    {"type": "metallicroughness", "base_color": {"type": "rgb", "value": [0.9, 0.6, 0.3]}, "metallic": 1.0}
    """

    family = "production"

    base_color = Reflectance(0.5, "base colour C")
    metallic = Number(0, (0, 1), "from a dielectric (0) to a metal (1), which has no diffuse lobe")
    roughness = Number(0.5, (0.01, 1), "roughness r; its square is the facets' α")
    shadowing = OneOf({"direct": {}, "ibl": {}, "smith": {"multiscatter": MULTISCATTER}}, "shadowing term")
    haze, haze_spread, retroreflectivity = HAZE, HAZE_SPREAD, RETROREFLECTIVITY

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        fresnel = Schlick(dr.lerp(0.04, p.base_color, p.metallic))
        alpha = dr.square(p.roughness)

        def shadowing(facets: Distribution) -> Shadowing:
            if self.shadowing == "smith":
                return facets.smith(correlated=False)
            alpha = facets.alpha_u
            return SchlickSmith(dr.square(dr.sqrt(alpha) + 1) / 8 if self.shadowing == "direct" else alpha / 2)

        diffuse = WeightedLobe(
            LambertLobe((1 - p.metallic) * p.base_color),
            lambda wi, wo: 1 - fresnel(Facet.between(wi, wo).cos_d),
            lambda wi: 1 - fresnel(1),  # few pairs of directions graze their half vector
        )
        return diffuse, *facet_lobes(self, p, 1, GGX(alpha, alpha), shadowing, fresnel)
