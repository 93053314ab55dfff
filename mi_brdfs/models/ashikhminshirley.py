from __future__ import annotations

import mitsuba as mi

from ..lobes import LambertLobe, Lobe, MicrofacetLobe, WeightedLobe
from ..microfacet.distributions import AshikhminShirleyNormals
from ..microfacet.fresnel import Schlick
from ..microfacet.shadowing import AshikhminShirleyShadowing
from ..model import Model, Values
from ..parameters import Number, Reflectance, Rotation


class AshikhminShirley(Model):
    """Ashikhmin and Shirley's anisotropic Phong model (2000), with a diffuse lobe for the light not reflected.

    M. Ashikhmin and P. Shirley, An anisotropic Phong BRDF model, Journal of Graphics Tools 5(2), 2000,
    doi:10.1080/10867651.2000.10487522.

        f  = fd + fs
        fs = √((nu+1)(nv+1))/(8π) cosθ_h^e F(wi·h) / ((wi·h) max(cosθ_i, cosθ_o)),  e = (nu h_x² + nv h_y²)/sin²θ_h
        fd = 28 Rd/(23π) (1-Rs) (1-(1-cosθ_i/2)⁵) (1-(1-cosθ_o/2)⁵)
        F  = Rs + (1-Rs) (1-wi·h)⁵

    with h = (wi+wo)/|wi+wo|. As a microfacet model, fs has the distribution D = √((nu+1)(nv+1))/(2π) cosθ_h^e,
    normalised without a cosine, and the shadowing term G = min(cosθ_i, cosθ_o)/(wi·h).

    Reciprocal. Energy-conserving: the albedo of fs is at most 1 (F = 1), that of fd is Rd (1-Rs) (1-(1-cosθ_i/2)⁵).
    These exponents differ from those of microfacet distributions called "phong" elsewhere, which are normalised with
    n+2. One-sided. Depolarises.

    Sampling: for fs an antithetic pair of half vectors, one chosen by how much each reflects
    (mi_brdfs.microfacet.sampling.Pair), so that no sample falls below the horizon; for fd the cosine.

    Example
    -------
    {"type": "ashikhminshirley", "diffuse_reflectance": {"type": "rgb", "value": [0.3, 0.1, 0.35]},
     "exponent_u": 20, "exponent_v": 400}
    """

    family = "cosine lobes"

    diffuse_reflectance = Reflectance(0.5, "colour Rd of the diffuse lobe", role="diffuse")
    specular_reflectance = Reflectance(0.05, "reflectance Rs of the specular lobe at normal incidence", role="specular")
    exponent = Number(100, (0, 1e6), "exponent n: the higher, the narrower the highlight", anisotropic=True)
    rotation = Rotation()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        specular = MicrofacetLobe(
            mi.UnpolarizedSpectrum(1),
            AshikhminShirleyNormals(*p.exponent),
            AshikhminShirleyShadowing(),
            Schlick(p.specular_reflectance),
        )
        diffuse = WeightedLobe(
            LambertLobe(p.diffuse_reflectance * (1 - p.specular_reflectance)),
            lambda wi, wo: 28 / 23 * darkening(wi.z) * darkening(wo.z),
            lambda wi: darkening(wi.z),  # exact
        )
        return diffuse, specular


def darkening(cos: mi.Float) -> mi.Float:
    """1-(1-cosθ/2)⁵."""
    m = 1 - 0.5 * cos
    m2 = m * m
    return 1 - m2 * m2 * m
