from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import LambertLobe, Lobe, MicrofacetLobe, WeightedLobe
from ..math import EPSILON, TINY, Spectrum, clamp, expm1_ratio, log1p_ratio, safe_sqrt
from ..microfacet.distributions import GGX, Distribution
from ..microfacet.facet import Cosines, Facet
from ..microfacet.fresnel import Fresnel, Schlick
from ..microfacet.laws import LARGEST_TAN2
from ..microfacet.shadowing import SchlickSmith, Shadowing
from ..model import Model, Values
from ..parameters import Choice, Number, Reflectance, Rotation

TYPICAL = 0.58
"""The cosine u of albedo estimates, for other than mirror directions; fitted by tests/calibration/schlick.py."""


class Schlick94(Model):
    """Schlick's rational model (1994), the origin of his Fresnel term, with roughness and isotropy.

    C. Schlick, An inexpensive BRDF model for physically-based rendering, Computer Graphics Forum 13(3), 1994,
    doi:10.1111/1467-8659.1330233.

        f = S(u) D + (1 - S(u)) S'(u)/π,    S(u) = C + (1-C)(1-u)⁵,    S'(u) = C' + (1-C')(1-u)⁵
        Z = r / (1 + (r-1) h_z²)²,    A = √(p/(p² + (1-p²) w²)),    w = h_x/√(h_x² + h_y²)
        G(v) = v / (v + r (1-v))

    with h = (wi+wo)/|wi+wo|, u = wi·h, the roughness r, the isotropy p and, by ``variant``, the paper's

    * shadowed: D = G(cosθ_i) G(cosθ_o) Z A / (4π cosθ_i cosθ_o)
    * interreflection: the same plus (1 - G(cosθ_i) G(cosθ_o)) / (4π cosθ_i cosθ_o), which returns the shadowed light
    * plain: D = Z A / (4π cosθ_i cosθ_o)

    Scratches run along the tangent dp_du: the smaller p, the more facets lean across. Z/π is the GGX distribution with
    α² = r. A is not normalised: its mean over the azimuths is √p over the arithmetic-geometric mean of 1 and p, so
    brushed surfaces are darker.

    The second term of f is the paper's double layer over a diffuse layer (r' = 1), if C' is given
    (``diffuse_reflectance``). The plugin leaves out glossy lower layers, and the blend of D with a diffuse part and a
    perfect mirror, by the weight 4 r (1-r) and the rest.

    Reciprocal. Gains energy towards grazing angles: there G of a smooth surface shadows less than facets of that slope
    do, and the other two variants have no limit, as they divide by cosθ_i. One-sided. Depolarises.

    Sampling: for Z A an antithetic pair of half vectors, with azimuths from an ellipse near A, one chosen by how much
    each reflects (mi_brdfs.microfacet.sampling.Pair); for the interreflection its cosθ_o, nearly exact except for S(u);
    for the lower layer the cosine.

    Example
    -------
    {"type": "schlick", "specular_reflectance": {"type": "rgb", "value": [0.95, 0.7, 0.55]}, "roughness": 0.05,
     "isotropy": 0.2}
    """

    plugins = ("schlick",)
    family = "microfacets"

    specular_reflectance = Reflectance(0.04, "reflectance C at normal incidence", role="specular")
    diffuse_reflectance = Reflectance(
        None, "reflectance C' of a diffuse layer below; omitted by default", role="diffuse"
    )
    roughness = Number(0.05, (1e-6, 1), "roughness r, the square of GGX's α")
    isotropy = Number(1, (0.01, 1), "isotropy p: 1 is isotropic, 0 the most brushed", isotropic_as="")
    variant = Choice(("shadowed", "interreflection", "plain"), "treatment of the shadowed light")
    rotation = Rotation()

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.is_brushed = "isotropy" in props

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        fresnel, distribution = Schlick(p.specular_reflectance), SchlickNormals(p.roughness, p.isotropy)
        shadowing = Unshadowed() if self.variant == "plain" else SchlickSmith(p.roughness)
        specular = MicrofacetLobe(mi.UnpolarizedSpectrum(1), distribution, shadowing, fresnel)
        specular.anisotropic = self.is_brushed
        lobes: list[Lobe] = [specular]
        if self.variant == "interreflection":
            lobes.append(InterreflectionLobe(p.roughness, fresnel))
        if p.diffuse_reflectance is not None:
            lower = Schlick(p.diffuse_reflectance)

            def passed(cos_d: mi.Float) -> Spectrum:
                return (1 - fresnel(cos_d)) * lower(cos_d)

            weighted = WeightedLobe(
                LambertLobe(1), lambda wi, wo: passed(Facet.between(wi, wo).cos_d), lambda wi: passed(TYPICAL)
            )
            lobes.append(weighted)
        return tuple(lobes)


class Unshadowed(Shadowing):
    """G = 1."""

    lean = 1
    favours_steep = True

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return 1.0


class SchlickNormals(Distribution):
    """D = Z A/π. q has D's Z, and instead of A the azimuths of an ellipse with axes ∝ √p and 1, whose densities have
    the same ratio. It is the best of all ellipses, with an efficiency of 0.96 for p = 0.1 and 0.73 for 0.01."""

    LOSS = GGX.LOSS
    long_tailed = True

    def __init__(self, roughness: mi.Float, isotropy: mi.Float) -> None:
        self.r, self.isotropy = roughness, isotropy
        stretch = dr.sqrt(dr.sqrt(isotropy))
        alpha = dr.sqrt(roughness)
        super().__init__(alpha * stretch, alpha / stretch)

    def mean_square_slope(self) -> mi.Float:
        return self.r

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        u, v2 = dr.square(v.x) * self.alpha_u, dr.square(v.y) * self.alpha_v
        return 2 * self.r * (u + v2) / (self.alpha_u + self.alpha_v)

    def estimated_albedo(self, cos: mi.Float) -> mi.Float:
        root = dr.sqrt(self.isotropy)
        mean = 0.5 * (0.5 * (1 + self.isotropy) + root)  # two steps of the arithmetic-geometric mean
        return super().estimated_albedo(cos) * root / mean

    def _zenith(self, facet: Facet) -> mi.Float:
        """Return Z."""
        return self.r / dr.square(facet.sin2_h + self.r * dr.square(facet.cos_h))

    def eval(self, facet: Facet) -> mi.Float:
        w, _ = facet.azimuth
        p2 = dr.square(self.isotropy)
        return dr.inv_pi * self._zenith(facet) * dr.sqrt(self.isotropy / (p2 + (1 - p2) * w * w))

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        return dr.inv_pi * self._zenith(facet) * facet.cos_h / (self.r * g)

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        x = dr.minimum(tan2 / self.r, LARGEST_TAN2)
        return x / (1 + x), 1 / (1 + x)

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        return dr.minimum(c / dr.maximum(complement, TINY) * self.r, LARGEST_TAN2)


class InterreflectionLobe(Lobe):
    """f = S(u) (1 - G(cosθ_i) G(cosθ_o)) / (4π cosθ_i cosθ_o).

    f cosθ_o is S times a function of x = cosθ_o: with k = (1-r)/r, 1 - G G' = (1 - G) + G h(x), h = (1-x)/(1 + k x).
    Draw from the constant or from h, in proportion to their integrals. An invertible law replaces h, with the
    complementary cumulative distribution (1 - t)^(1+e), t = log(1 + k x)/log(1 + k): for k = 0 it is h, with e = 1; e
    falls as 1/√log k.
    """

    def __init__(self, roughness: mi.Float, fresnel: Fresnel) -> None:
        self.roughness, self.fresnel = roughness, fresnel
        self.k = (1 - roughness) / roughness
        self.scale = log1p_ratio(self.k)
        self.power = dr.rsqrt((1 + self.k) * self.scale)  # e
        self.integral = self._integral()

    def _integral(self) -> mi.Float:
        """Return ∫ h from 0 to 1."""
        k = self.k
        series = 1 / 2 - k * (1 / 6 - k * (1 / 12 - k * (1 / 20 - k / 30)))
        k = dr.maximum(k, 0.2)
        return dr.select(self.k < 0.2, series, ((1 + k) * dr.log(1 + k) - k) / dr.square(k))

    def _constant(self, wi: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
        """Return ``(1 - G(cosθ_i), the integral of 1 - G G')``."""
        lost = self.roughness * (1 - wi.z) / (wi.z + self.roughness * (1 - wi.z))
        return lost, lost + (1 - lost) * self.integral

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.fresnel(TYPICAL) * (0.5 * self._constant(wi)[1] / dr.maximum(wi.z, EPSILON))

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return 0  # a mirror sends no light from facet to facet

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        lost, integral = self._constant(wi)
        x, k = wo.z, self.k
        gone = x * log1p_ratio(k * x) / self.scale
        # The 1e-7 is the rounding error of 1 - gone: a power below one has a derivative there.
        law = (1 + self.power) * dr.power(dr.maximum(1 - gone, 1e-7), self.power) / ((1 + k * x) * self.scale)
        shadowed = lost + (1 - lost) * (1 - x) / (1 + k * x)
        facet = Facet.between(wi, wo)
        value = self.fresnel(facet.cos_d) * (shadowed / (4 * dr.pi * dr.maximum(wi.z, EPSILON)))
        return value, dr.inv_two_pi * (lost + (1 - lost) * self.integral * law) / integral

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        lost, integral = self._constant(wi)
        t = 1 - dr.power(1 - v.x, 1 / (1 + self.power))
        x = t * self.scale * expm1_ratio(t * self.k * self.scale)
        z = clamp(dr.select(u * integral < lost, v.x, x), 0, 1)
        sin, cos = dr.sincos(dr.two_pi * v.y)
        r = safe_sqrt(1 - z * z)
        return mi.Vector3f(r * cos, r * sin, z)
