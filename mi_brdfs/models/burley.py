from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe, MicrofacetLobe, facet_lobes
from ..lobes.facets import HAZE, HAZE_SPREAD, RETROREFLECTIVITY
from ..lobes.power import AxisFrame
from ..math import EPSILON, SMALL, TINY, Spectrum, choose, clamp, luminance, safe_sqrt, square
from ..microfacet.distributions import GGX, Berry
from ..microfacet.facet import Cosines, Facet
from ..microfacet.fresnel import Schlick
from ..microfacet.shadowing import MULTISCATTER, Shadowing
from ..model import Model, Values
from ..parameters import Number, Reflectance, Rotation

ALPHA_LIMIT = 0.001
"""The least α of the specular lobe's facets."""


class Burley(Model):
    """Burley's principled BRDF (2012), known as the Disney BRDF.

    B. Burley, Physically based shading at Disney, in: Practical physically based shading in film and game production,
    SIGGRAPH 2012 courses, doi:10.1145/2343483.2343493, as revised by its author's BRDF Explorer (disney.brdf).

        f = (1 - metallic) (C/π mix(fd, fss, subsurface) + sheen mix(1, C/L, sheen_tint) F(0))
            + F(f0) D G / (4 cosθ_i cosθ_o) + clearcoat/4 F(0.04) Dc Gc / (4 cosθ_i cosθ_o)

    where mix(a, b, t) = (1-t) a + t b, h = (wi+wo)/|wi+wo|, w(x) = (1-x)⁵, F(r) = r + (1-r) w(wi·h), and

        fd   = (1 + (d-1) w(cosθ_i)) (1 + (d-1) w(cosθ_o)),    d = 0.5 + 2 roughness (wi·h)²
        fss  = 1.25 (s (1/(cosθ_i + cosθ_o) - 0.5) + 0.5),    s as fd with d = roughness (wi·h)²
        f0   = mix(0.08 specular mix(1, C/L, spec_tint), C, metallic)
        D, G = those of walter (GGX, separable), α = roughness²: αu = α/a, αv = α a, both at least 0.001,
               with a = √(1 - 0.9 anisotropic)
        Dc   = (αc²-1) / (π log(αc²) (1 + (αc²-1) h_z²)),    αc = mix(0.1, 0.001, clearcoat_gloss)
        Gc   = G for α = 0.25

    L is the luminance of the base colour C, so that C/L is its hue; in spectral variants it is the mean of C over the
    wavelengths traced together, and tinted results differ from those of rgb variants. The hues of saturated blues are
    far above 1, and may raise the tinted f0 up to 1.1.

    The course notes have another shadowing term for the specular lobe, G of roughness (0.5 + roughness/2)²; the author
    replaced it by the one above in 2017. BRDF Explorer decodes C by a power of 2.2 and weights L by (0.3, 0.6, 0.1);
    here C is linear, as everywhere in Mitsuba, and L is Mitsuba's luminance. The revisions were checked against public
    code only, not against a paper. Mitsuba's ``principled`` has the same base lobe (``flatness`` is subsurface), sheen,
    and specular lobe for spec_tint = 1 or metallic = 1; otherwise it has the exact Fresnel reflectance instead of
    F(f0). Its clear coat is 4 cosθ_i cosθ_o times this one.

    ``multiscatter`` says what becomes of light that the facets of D reflect more than once, as in ``microfacet``, and
    ``haze`` and ``retroreflectivity`` are those of ``microfacet``, for the same facets. There is no film, as F has no
    index of refraction.

    Reciprocal, except for ``multiscatter`` = turquin. Not energy-conserving: for C = 1 the albedo reaches 1.19 with the
    defaults, 1.60 for roughness = 1 and, with everything else switched on, 1.82 for roughness = 0 and 1.88 along dp_dv
    for roughness = 0.17 and anisotropic = 1 (2.1 with walk), all beyond 80°; with metallic = 1 it stays below 1, and
    below 1.05 with a clear coat. One-sided. Depolarises.

    Sampling: for the base lobe the cosine with a few uniform directions, for the sheen a density of its own, for the
    clear coat an antithetic pair of half vectors and for the specular lobe one of visible normals, one of the pair
    chosen by how much each reflects (mi_brdfs.microfacet.sampling.Pair,
    mi_brdfs.microfacet.visible.VisibleNormals). Samples fall below the horizon from the last alone: at most 0.6 % for
    isotropic facets, and 65 % for the roughest with ``anisotropic`` = 1.

    Example
    -------
    {"type": "burley", "base_color": {"type": "rgb", "value": [0.6, 0.1, 0.05]}, "roughness": 0.4, "clearcoat": 1.0}
    """

    plugins = ("burley", "disney")
    family = "production"

    base_color = Reflectance(0.5, "base colour C")
    subsurface = Number(0, (0, 1), "share of the subsurface approximation in the base lobe")
    metallic = Number(0, (0, 1), "from a dielectric (0) to a metal (1), which has neither base lobe nor sheen")
    specular = Number(0.5, (0, 1), "reflectance of the dielectric at normal incidence, in units of 0.08")
    spec_tint = Number(0, (0, 1), "tint of the dielectric's reflection towards the hue of C")
    roughness = Number(0.5, (0, 1), "roughness of the base and the specular lobe; its square is the facets' α")
    anisotropic = Number(0, (0, 1), "how far the highlight is stretched along dp_du", isotropic_as="")
    sheen = Number(None, (0, 1), "scale of the sheen; omitted by default")
    sheen_tint = Number(0.5, (0, 1), "tint of the sheen towards the hue of C")
    clearcoat = Number(None, (0, 1), "scale of the clear coat, in units of 0.25; omitted by default")
    clearcoat_gloss = Number(1, (0, 1), "gloss of the clear coat: its roughness falls from 0.1 to 0.001")
    multiscatter = MULTISCATTER
    haze, haze_spread, retroreflectivity = HAZE, HAZE_SPREAD, RETROREFLECTIVITY
    rotation = Rotation()

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.is_stretched = "anisotropic" in props

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        brightness = luminance(p.base_color)
        black = brightness < EPSILON
        tint = dr.select(black, 1, p.base_color / dr.select(black, 1, brightness))
        dielectric = 1 - p.metallic
        f0 = dr.lerp(0.08 * p.specular * dr.lerp(1, tint, p.spec_tint), p.base_color, p.metallic)
        aspect2 = 1 - 0.9 * p.anisotropic
        # Lead back from where the limit holds both; where it holds αv alone, the parameters act through αu as they do.
        along = clamp(square(p.roughness) / dr.sqrt(aspect2), ALPHA_LIMIT, dr.inf)
        across = along * aspect2
        across = dr.select(across < ALPHA_LIMIT, ALPHA_LIMIT, across)
        lobes: list[Lobe] = [BaseLobe(dielectric * p.base_color, p.roughness, p.subsurface)]
        if p.sheen is not None:
            lobes.append(SheenLobe(dielectric * p.sheen * dr.lerp(1, tint, p.sheen_tint)))
        facets = GGX(along, across)
        facets.anisotropic = self.is_stretched
        lobes += facet_lobes(self, p, 1, facets, lambda it: it.smith(correlated=False), Schlick(f0))
        if p.clearcoat is not None:
            narrow = Berry(dr.lerp(0.1, 0.001, p.clearcoat_gloss))
            lobes.append(CoatLobe(0.25 * p.clearcoat, narrow, CoatShadowing(), Schlick(0.04)))
        return tuple(lobes)


class CoatShadowing(Shadowing):
    """Smith's separable term for GGX of α = 0.25, at any gloss. The facets' distribution is narrower, so they do not
    lean."""

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return self._seen(facet.cos_i) * self._seen(facet.cos_o)

    @staticmethod
    def _seen(cos: mi.Float) -> mi.Float:
        alpha2 = 0.0625
        return 2 * cos / (cos + dr.sqrt(alpha2 + (1 - alpha2) * cos * cos))


class CoatLobe(MicrofacetLobe):
    """A lobe so narrow that its albedo is about that of a mirror."""

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        mirror = Cosines(wi.z, wi.z, 1, wi.z)
        return self.reflectance * (self.fresnel(dr.minimum(wi.z, 0.9)) * self.shadowing(mirror))


def schlick_weight(cos: mi.Float) -> mi.Float:
    """(1 - cosθ)⁵."""
    return Schlick(0)(cos)


class BaseLobe(Lobe):
    """f = ρ/π times Burley's diffuse term, or his approximation of subsurface scattering, or a mixture of the two. Both
    brighten or darken towards grazing angles, depending on the roughness.

    Draw from the cosine and, for the brightening, a few directions uniformly.
    """

    glossy = False
    # Fitted by tests/calibration/burley.py.
    UNIFORM = 0.1, 0.3
    """The fractions of uniform directions for the diffuse term and for subsurface scattering."""
    SUBSURFACE = 1.43, 0.68
    """a and b of the albedo of subsurface scattering, about a - b cosθ_i."""

    def __init__(self, reflectance: Spectrum, roughness: mi.Float, subsurface: mi.Float) -> None:
        self.reflectance, self.roughness, self.subsurface = reflectance, roughness, subsurface

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        # Accurate to about 10 %. cos²θ_d is a half on average, for which d - 1 is roughness - 0.5.
        retro = 1 + (self.roughness - 0.5) * schlick_weight(wi.z)
        return self.reflectance * dr.lerp(retro, self.SUBSURFACE[0] - self.SUBSURFACE[1] * wi.z, self.subsurface)

    def _uniform(self, wi: mi.Vector3f) -> mi.Float:
        """Return the fraction of uniform directions."""
        return self.UNIFORM[0] * self.roughness + self.UNIFORM[1] * self.subsurface * dr.square(1 - wi.z)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        weight_i, weight_o = schlick_weight(wi.z), schlick_weight(wo.z)
        grazing = self.roughness * dr.square(Facet.between(wi, wo).cos_d)

        def falloff(f90: mi.Float) -> mi.Float:
            return (1 + (f90 - 1) * weight_i) * (1 + (f90 - 1) * weight_o)

        retro = falloff(0.5 + 2 * grazing)
        subsurface = 1.25 * (falloff(grazing) * (1 / (wi.z + wo.z) - 0.5) + 0.5)
        cosine = wo.z * dr.inv_pi
        value = self.reflectance * (dr.lerp(retro, subsurface, self.subsurface) * cosine)
        return value, dr.lerp(cosine, dr.inv_two_pi, self._uniform(wi))

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        uniform, _ = choose(u, self._uniform(wi))
        cos = dr.select(uniform, v.y, dr.sqrt(v.y))
        sin = dr.sqrt(1 - cos * cos)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v.x)  # as of half vectors: once for both lobes
        return mi.Vector3f(sin * cos_phi, sin * sin_phi, cos)


class SheenLobe(Lobe):
    r"""f = ρ (1 - cosθ_d)⁵, which is bright where wo is far from wi.

    Drawn about the axis -wi: m = 1 - cosθ_d from the density ∝ t^3.5 (1 - t^4.5)² of its share t in what it can be
    (Kumaraswamy's; tests/calibration/burley.py fits the exponents), and then the azimuth ψ nearly ∝ cosθ_o, which is
    A + B cosψ: exactly, by a choice among ψ and ψ + π, if all of the circle lies above the horizon, and else by a
    density ¾ (1-s²) of s = sin(ψ/2)/sin(ψ₀/2), with ψ₀ where the circle meets the horizon.
    """

    glossy = False
    ALBEDO = 3e-4, 0.06, 0.02
    """a, b and c of the albedo, about a + b x² + c x³ with x = 1 - cosθ_i; fitted, too."""

    def __init__(self, reflectance: Spectrum) -> None:
        self.reflectance = reflectance

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        x, (a, b, c) = 1 - wi.z, self.ALBEDO
        return self.reflectance * (a + x * x * (b + c * x))

    @staticmethod
    def _largest(sin: mi.Float) -> mi.Float:
        """The largest m there is: of the direction in the horizon opposite to wi."""
        cos_d2 = 0.5 * (1 - sin)
        return (1 - cos_d2) / (1 + dr.sqrt(dr.maximum(cos_d2, EPSILON)))

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        frame = AxisFrame(-wi)
        cos = dr.dot(frame.axis, wo)
        sin_d2 = dr.minimum(0.25 * dr.squared_norm(wo - wi), 1)
        cos_d = dr.sqrt(dr.maximum(1 - sin_d2, 1e-12))  # it divides the density
        m = sin_d2 / (1 + cos_d)
        m2 = m * m
        value = m2 * m2 * m * wo.z

        scale = dr.rcp(self._largest(frame.sin))
        t = dr.clip(m * scale, SMALL, 1 - 1e-6)  # rounding must not leave a density of 0
        t_3_5 = t * t * t * dr.sqrt(t)
        density = 13.5 / 4 * t_3_5 * dr.square(1 - t_3_5 * t) * scale / cos_d  # dcos = 4 cosθ_d dm

        axial, lateral = -wi.z * cos, frame.sin * safe_sqrt(1 - cos * cos)
        highest = dr.maximum(axial + lateral, wo.z)
        whole = axial >= lateral
        circle = wo.z * dr.inv_two_pi / dr.select(whole, dr.maximum(axial, EPSILON), 1)
        inverse = dr.rcp(highest)
        arc = 0.375 * (wo.z * inverse) * safe_sqrt((lateral + wo.z - axial) * inverse)
        return self.reflectance * value, density * dr.select(whole, circle, arc)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        frame = AxisFrame(-wi)
        m = self._largest(frame.sin) * dr.power(1 - dr.cbrt(1 - v.x), 2 / 9)
        sin_d2 = m * (2 - m)
        cos, sin = 2 * sin_d2 - 1, 2 * (1 - m) * dr.sqrt(sin_d2)

        axial, lateral = -wi.z * cos, frame.sin * sin
        whole = axial >= lateral
        sin_a, cos_a = dr.sincos(dr.select(whole, dr.two_pi * v.y, dr.asin(2 * v.y - 1) / 3))
        flip = dr.select(2 * u * axial > axial + lateral * cos_a, -1, 1)
        half = safe_sqrt(0.5 * (axial + lateral) / dr.select(whole, 1, dr.maximum(lateral, TINY)))
        s = 2 * sin_a * dr.minimum(half, 1)
        sin_psi = dr.select(whole, flip * sin_a, 2 * s * safe_sqrt(1 - s * s))
        cos_psi = dr.select(whole, flip * cos_a, 1 - 2 * s * s)
        return frame.axis * cos + frame.up * (sin * cos_psi) + frame.side * (sin * sin_psi)
