from __future__ import annotations

import mitsuba as mi

from ..lobes import Lobe, facet_lobes, over_diffuse
from ..lobes.facets import HAZE, HAZE_SPREAD, RETROREFLECTIVITY
from ..microfacet import shadowing
from ..microfacet.distributions import ABC, EPD, GGX, GTR, Beckmann, Blinn, Distribution, HemiEPD
from ..microfacet.film import FILM_IOR, FILM_THICKNESS, filmed
from ..model import Model, Values
from ..parameters import FresnelSet, OneTerm, ParameterError, Preset, Reflectance, Rotation
from ..parameters.messages import listed


class Microfacet(Model):
    """The microfacet model as a kit: any distribution D with any shadowing term G and any Fresnel reflectance F.

    K. E. Torrance and E. M. Sparrow, Theory for off-specular reflection from roughened surfaces, Journal of the Optical
    Society of America 57(9), 1967, doi:10.1364/JOSA.57.001105.

        f = ρd/π + ρs F(wi·h) D(h) G(wi, wo) / (4 cosθ_i cosθ_o)

    with h = (wi+wo)/|wi+wo|. Every D has ∫ D cosθ_h dω_h = 1. ``distribution`` is one of

    * beckmann: D = exp(-((h_x/αu)² + (h_y/αv)²)/h_z²) / (π αu αv h_z⁴)
    * ggx: D = 1 / (π αu αv ((h_x/αu)² + (h_y/αv)² + h_z²)²) (Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206)
    * blinn: D = (n+2)/(2π) h_zⁿ, n = ``exponent`` (Blinn 1977, doi:10.1145/563858.563893)
    * gtr: D ∝ (1 + (α²-1) h_z²)^-γ, generalised Trowbridge-Reitz (Burley 2012, doi:10.1145/2343483.2343493); γ = 2 is
      GGX, γ = 1 has a longer tail
    * abc: D ∝ (1 + b (1-h_z))^-c (Church and Takacs 1991; Löw et al. 2012, doi:10.1145/2077341.2077350)
    * hepd: D ∝ |exp(κ h_zᵞ) - 1| (Nishino and Lombardi 2011, doi:10.1364/JOSAA.28.000008)
    * epd: D = exp(-(tan²θ_h/α²)ᵞ) / (π α² Γ(1 + 1/γ) h_z⁴) (Holzschuch and Pacanowski 2017,
      doi:10.1145/3072959.3073621); γ = 1 is Beckmann's, lower γ have longer tails

    and ``shadowing`` one of

    * smith: 1/((1+Λ(wi)) (1+Λ(wo))) (Smith 1967, doi:10.1109/TAP.1967.1138991), with the Λ of beckmann or ggx; for
      blinn, Walter et al.'s rational approximation of Beckmann's
    * smith-correlated: 1/(1+Λ(wi)+Λ(wo)) (Heitz 2014, https://jcgt.org/published/0003/02/03/), for the same
      distributions
    * smith-rational: smith for beckmann with that approximation of Λ, as in Mitsuba's ``roughconductor``; G is up to
      0.7 % off
    * vcavity: min(1, 2 h_z cosθ_i/(wi·h), 2 h_z cosθ_o/(wi·h)) (Torrance and Sparrow)
    * schlick: Π c/(c (1-k) + k) over c = cosθ_i and cosθ_o, with k = α √(2/π) (Schlick 1994,
      doi:10.1111/1467-8659.1330233), where α = √(αu αv), or √(2/(n+2)) for blinn; not for abc and hepd
    * implicit: cosθ_i cosθ_o
    * neumann: cosθ_i cosθ_o / max(cosθ_i, cosθ_o) (Neumann, Neumann and Szirmay-Kalos 1999)
    * kelemen: cosθ_i cosθ_o / (wi·h)² (Kelemen and Szirmay-Kalos 2001)
    * ashikhmin-shirley: cosθ_i cosθ_o / ((wi·h) max(cosθ_i, cosθ_o)) (2000, doi:10.1080/10867651.2000.10487522)
    * ashikhmin-premoze: cosθ_i cosθ_o / (cosθ_i + cosθ_o - cosθ_i cosθ_o) (2007)
    * kurt: (cosθ_i cosθ_o)^(1-κ) / (wi·h), κ = ``kurt_exponent`` (2010, doi:10.1145/1722991.1722996)

    F is exact for conductors (``eta`` and ``k``, or ``material``) and dielectrics (``int_ior`` over ``ext_ior``),
    Schlick's approximation for ``f0``, and 1 if none of them is given. Schlick's is

        F(c) = max(f0 + (f90 - f0) (1-c)ᵖ - a c (1-c)⁶, 0)

    with f90 = 1 and p = ``schlick_exponent`` = 5 unless they are given, and a = 0 without ``f82``: with it, a is such
    that F at c = 1/7, 82°, is f82 times what it was (P. Kutz, M. Hašan and D. Edmondson, Novel aspects of the Adobe
    Standard Material, 2021; generalized_schlick_bsdf of MaterialX).

    ``film_thickness`` = d covers a conductor or dielectric with a film of so many nm and the index n = ``film_ior``,
    whose reflections interfere. F is then the mean of |r|² for s and p,

        r = (a + b e)/(1 + a b e),    e = exp(-4πi n d cosθ_t/λ)

    with the amplitudes a and b that the film's upper and lower face reflect, and the angle θ_t inside (L. Belcour and
    P. Barla, A practical extension to microfacet theory for the modeling of varying iridescence, ACM Transactions on
    Graphics 36(4), 2017, doi:10.1145/3072959.3073620). In spectral variants λ are the wavelengths of the ray. In rgb F
    is the integral over them under D65, with the η and k of each channel, to 1 %, and limited to [0, 1]; in mono
    variants it is that of the luminance. A film of a lower index than ``ext_ior`` does nothing, nor does any with
    F = 1. Schlick's approximation has no index, and takes no film.

    Two words change the lobe of the facets. With ``haze`` = h and ``haze_spread`` = s it is (1-h) times this one and h
    times one of rougher facets, √α' = √α + s (1-√α), where α < 1 (P. Barla, R. Pacanowski and P. Vangorp, A composite
    BRDF model for hazy gloss, Computer Graphics Forum 37(4), 2018, doi:10.1111/cgf.13475, as OpenPBR 1.2 words it); not
    for abc and hepd. With ``retroreflectivity`` = r it is (1-r) f(wi, wo) + r f(wi', wo), where wi' = (-x, -y, z) is
    the mirror direction of wi: that share of the light goes back where it came from (M. Raab, L. Belcour, F. Liu and
    J. Portsmouth, The minimal retroreflective microfacet model, Journal of Computer Graphics Techniques 15(1), 2026).
    The albedo stays; what goes back is unpolarized. Fits leave these, the film, f82, f90 and the exponent as they
    are, unless given as "free".

    With smith and smith-correlated, ``multiscatter`` says what becomes of light that facets reflect more than once. The
    larger α, the more: for GGX with α = 1 and F = 1 the facets' lobe reflects 0.31 at normal incidence.

    * none: it is lost
    * walk: a second lobe returns it, ρs C (1-E(wi)) (1-E(wo)) / (π (1-Ē)), where E(w) is the albedo for F = 1 and Ē its
      mean. Its colour C is that of a random walk on the surface (Heitz, Hanika, d'Eon and Dachsbacher 2016,
      doi:10.1145/2897824.2925943), C = R(wi) R(wo) (p + (1-p) F₂ q/(1-F₂ (1-q))), R = F̄₁ s (2+s)/3 with
      s = (1 + 3 F₁/F̄₁)/4 up to 5, and with tabulated means F₁ and F₂ at the ends of a path and between them, of F or
      the nearest to it of Schlick's with an f82, and probabilities p and q that light escapes at its second reflection
      and at each later one; F̄₁ is the mean of F₁ over directions, and p = p(wi) + p(wo) - p̄, so that f is
      reciprocal. The walk's first reflection has the height-correlated term, and so has f for ggx, also with smith; for
      the others it hardly matters
    * kulla-conty: the same with C = F̄² Ē/(1-F̄ (1-Ē)), F̄ = 2 ∫ F cosθ dcosθ (Kulla and Conty 2017)
    * turquin: f is scaled by 1 + F(1) (1-E(wi))/E(wi) (Turquin 2019). Not reciprocal

    For F = 1 all of them conserve energy within 0.005, with ggx and beckmann, where neither α exceeds 1, up to 85° and
    αu : αv = 8 : 1; where one reaches 2, within 0.016 (turquin within 0.05); rough blinn gains by itself. Beyond that
    facets may be up to 0.07 too dark or 0.06 too bright. Where neither α exceeds 1, the albedo of walk is up to 4 : 1
    that of the simulated walk up to 60° (and at 80°) within 0.005 (0.015) for Schlick's reflectance with an exponent of
    5 or more (0.007 with an f82 of 0.5 or more, 0.016 with a smaller one), and for dielectrics and metals (0.007 where
    η < 1 <= k, 0.065 where both are less); within 0.03 for smaller exponents, and for films in rgb; and within 0.14
    where light is reflected totally, for ``int_ior`` < ``ext_ior``. At 8 : 1 that of metals is within 0.006 (0.01).
    Where one α reaches 2, up to 4 : 1 and 80°, that of all these is within 0.035, but 0.09 for metals with η and k
    below 1 and for smaller exponents with f90 < f0, and 0.17 where light is reflected totally. The published ways are
    farther off: for Schlick's reflectance the albedo of kulla-conty is up to 0.045 too low (0.06), or with an f82 or
    f90 below 1 up to 0.16 too high (0.19), and that of turquin up to 0.06 too high and 0.03 too low (0.05), or up to
    0.29 too high.

    Other plugins are combinations of this kit: ``cooktorrance`` (beckmann, ggx or blinn with vcavity), ``walter`` (ggx
    with smith), ``ward`` (beckmann with kelemen, for variant balanced), ``kurt`` (beckmann with kurt), ``nishino``
    (hepd with vcavity, or with implicit for variant dsbrdf), ``low`` with normalization unit (abc with vcavity), and
    the specular lobe of ``metallicroughness`` (ggx with smith).

    Reciprocal, except for turquin. With ρd + ρs <= 1 vcavity conserves energy for every D, and smith and
    smith-correlated for beckmann and ggx; for the others see the table below. The more αu and αv differ, the less
    schlick shadows. For Ashikhmin and Premoze's term, Neumann's and the EPD, only the formulas were at hand, in later
    papers and public code. One-sided.

    In polarized variants facets of conductors and dielectrics polarise the light as a smooth surface or film does. All
    else depolarises it: ``f0``, F = 1, the diffuse lobe, and what ``multiscatter`` adds.

    Sampling: an antithetic pair of half vectors, one chosen by how much each reflects (mi_brdfs.microfacet.sampling):
    visible normals for ggx with smith, smith-correlated or schlick, of which some reflect below the horizon (see
    ``walter``), and otherwise those of D, of which one of the pair always reflects above it, with a few uniform
    directions at grazing if steep facets may reflect most there.

    Example
    -------
    {"type": "microfacet", "distribution": "gtr", "alpha": 0.2, "gamma": 1.5, "shadowing": "vcavity", "material": "Al"}
    """

    family = "microfacets"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default", role="diffuse")
    specular_reflectance = Reflectance(1, "scale ρs of the specular lobe; 1 is physical", role="specular")
    distribution = OneTerm((Beckmann, GGX, Blinn, GTR, ABC, HemiEPD, EPD), "distribution D of the facets")
    shadowing = OneTerm(
        (
            shadowing.SmithOfDistribution,
            shadowing.CorrelatedSmithOfDistribution,
            shadowing.RationalSmithOfBeckmann,
            shadowing.VCavity,
            shadowing.SchlickSmith,
            shadowing.Implicit,
            shadowing.Neumann,
            shadowing.Kelemen,
            shadowing.AshikhminShirleyShadowing,
            shadowing.AshikhminPremoze,
            shadowing.KurtShadowing,
        ),
        "shadowing term G",
    )
    fresnel = FresnelSet()
    film_thickness, film_ior = FILM_THICKNESS, FILM_IOR
    haze, haze_spread, retroreflectivity = HAZE, HAZE_SPREAD, RETROREFLECTIVITY
    rotation = Rotation()
    preset = Preset()

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        distributions, shadowings = type(self).distribution.terms, type(self).shadowing.terms
        suited = [word for word, it in distributions.items() if shadowings[self.shadowing].suits(it)]
        if self.distribution not in suited:
            raise ParameterError(
                f'microfacet: shadowing = "{self.shadowing}" is not known for distribution = "{self.distribution}"; '
                f'take it with {listed(suited)}, or another one such as "vcavity".'
            )
        widened = [word for word, it in distributions.items() if it.widened is not Distribution.widened]
        if self.parameters["haze"].textures and self.distribution not in widened:
            raise ParameterError(
                f'microfacet: haze is not known for distribution = "{self.distribution}"; take it with '
                f"{listed(widened)}."
            )

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        specular = facet_lobes(self, p, p.specular_reflectance, p.distribution(), p.shadowing, filmed(self, p))
        return over_diffuse(p.diffuse_reflectance, *specular)
