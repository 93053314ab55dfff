from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

import mitsuba as mi

from ..lobes import Lobe, MicrofacetLobe, over_diffuse
from ..microfacet.distributions import GGX, Beckmann, Blinn, Distribution
from ..microfacet.fresnel import Fresnel
from ..microfacet.shadowing import (
    AshikhminPremoze,
    AshikhminShirleyShadowing,
    Implicit,
    Kelemen,
    KurtShadowing,
    Neumann,
    SchlickSmith,
    Shadowing,
    VCavity,
)
from ..microfacet.tails import ABC, EPD, GTR, HemiEPD
from ..microfacet.term import Term
from ..model import Energy, Model, Values, full_name
from ..parameters import FresnelSet, Number, OneOf, Parameter, ParameterError, Preset, Reflectance, Rotation
from ..parameters import fresnel as fresnel_parameters
from ..parameters.messages import listed

ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets")
ANISOTROPIC_ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets", anisotropic=True)


class Facets(NamedTuple):
    """The distribution D of a word, made from the values of its parameters."""

    distribution: type[Distribution]
    parameters: Mapping[str, Parameter]


class Shadows(NamedTuple):
    """The shadowing term G of a word, made from the distribution and the values of its parameters."""

    make: Callable[..., Shadowing]
    parameters: Mapping[str, Parameter] = {}
    needs: str | None = None
    """The method of a distribution that it needs, if any."""

    def suits(self, distribution: type[Distribution]) -> bool:
        return not self.needs or getattr(distribution, self.needs) is not getattr(Distribution, self.needs)


DISTRIBUTIONS = {
    "beckmann": Facets(Beckmann, {"alpha": ANISOTROPIC_ROUGHNESS}),
    "ggx": Facets(GGX, {"alpha": ANISOTROPIC_ROUGHNESS}),
    "blinn": Facets(Blinn, {"exponent": Number(100, (0, 1e6), "exponent n")}),
    "gtr": Facets(GTR, {
        "alpha": ROUGHNESS,
        "gamma": Number(2, (0, 10), "exponent γ: the lower, the longer the tail"),
    }),
    "abc": Facets(ABC, {
        "b": Number(100, (0, 1e8), "width: the higher, the narrower the highlight"),
        "c": Number(1.5, (0, 10), "exponent of the tail: the higher, the steeper"),
    }),
    "hepd": Facets(HemiEPD, {
        "kappa": Number(-5, (-80, 80), "κ: below 0 the lobe has a flat top, above 0 a peak"),
        "gamma": Number(100, (0, 1e5), "exponent γ: the higher, the narrower the lobe"),
    }),
    "epd": Facets(EPD, {
        "alpha": ROUGHNESS,
        "gamma": Number(1, (0.1, 4), "exponent γ: the lower, the longer the tail"),
    }),
}  # fmt: skip

SHADOWING = {
    "smith": Shadows(lambda facets: facets.smith(correlated=False), needs="smith"),
    "smith-correlated": Shadows(lambda facets: facets.smith(correlated=True), needs="smith"),
    "vcavity": Shadows(lambda facets: VCavity()),
    "schlick": Shadows(lambda facets: SchlickSmith(math.sqrt(2 / math.pi) * facets.roughness()), needs="roughness"),
    "implicit": Shadows(lambda facets: Implicit()),
    "neumann": Shadows(lambda facets: Neumann()),
    "kelemen": Shadows(lambda facets: Kelemen()),
    "ashikhmin-shirley": Shadows(lambda facets: AshikhminShirleyShadowing()),
    "ashikhmin-premoze": Shadows(lambda facets: AshikhminPremoze()),
    "kurt": Shadows(
        lambda facets, kurt_exponent: KurtShadowing(kurt_exponent),
        {"kurt_exponent": Number(0.25, (0, 0.5), "exponent κ: the higher, the brighter at grazing")},
    ),
}

NEARLY_ALL = ("beckmann", "ggx", "blinn", "abc", "hepd")


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
    Schlick's approximation for ``f0``, and 1 if none of them is given.

    Other plugins are combinations of this kit: ``cooktorrance`` (beckmann, ggx or blinn with vcavity), ``walter`` (ggx
    with smith), ``ward`` (beckmann with kelemen, for variant balanced), ``kurt`` (beckmann with kurt), ``nishino``
    (hepd with vcavity, or with implicit for variant dsbrdf), ``low`` with normalization unit (abc with vcavity), and
    the specular lobe of ``metallicroughness`` (ggx with smith).

    Reciprocal. With ρd + ρs <= 1 vcavity conserves energy for every D, and smith and smith-correlated for beckmann and
    ggx; for the others see the table below. The more αu and αv differ, the less schlick shadows. For Ashikhmin and
    Premoze's term, Neumann's and the EPD, only the formulas were at hand, in later papers and public code. One-sided.

    Sampling: an antithetic pair of half vectors, one chosen by how much each reflects (mi_brdfs.microfacet.sampling),
    so that no sample falls below the horizon: visible normals for ggx with smith, smith-correlated or schlick, and
    otherwise those of D, with a few uniform directions at grazing if steep facets may reflect most there.

    Example
    -------
    <bsdf type="microfacet">
        <string name="distribution" value="gtr"/>
        <float name="alpha" value="0.2"/>
        <float name="gamma" value="1.5"/>
        <string name="shadowing" value="vcavity"/>
        <string name="material" value="Al"/>
    </bsdf>

    {"type": "microfacet", "distribution": "gtr", "alpha": 0.2, "gamma": 1.5, "shadowing": "vcavity", "material": "Al"}
    """

    family = "microfacets"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default")
    specular_reflectance = Reflectance(1, "scale ρs of the specular lobe; 1 is physical")
    distribution = OneOf({word: it.parameters for word, it in DISTRIBUTIONS.items()}, "distribution D of the facets")
    shadowing = OneOf({word: it.parameters for word, it in SHADOWING.items()}, "shadowing term G")
    fresnel = FresnelSet()
    rotation = Rotation()
    preset = Preset()
    energy = Energy(
        1,
        [
            ({"shadowing": "smith", "distribution": ("beckmann", "ggx")}, 1),
            ({"shadowing": "smith", "distribution": "blinn"}, 1.34),
            ({"shadowing": "smith-correlated", "distribution": ("beckmann", "ggx")}, 1),
            ({"shadowing": "smith-correlated", "distribution": "blinn"}, 1.75),
            ({"shadowing": "vcavity"}, 1),
            ({"shadowing": "schlick", "distribution": "blinn"}, 1),
            ({"shadowing": "schlick", "distribution": "beckmann"}, 43.3),
            ({"shadowing": "schlick", "distribution": "ggx"}, 73.8),
            ({"shadowing": "schlick", "distribution": "gtr"}, float("inf")),
            ({"shadowing": "schlick", "distribution": "epd"}, float("inf")),
            ({"shadowing": "implicit"}, 1),
            ({"shadowing": "kelemen"}, 1),
            ({"shadowing": ("neumann", "ashikhmin-premoze"), "distribution": NEARLY_ALL}, 1),
            ({"shadowing": "neumann", "distribution": "gtr"}, 2.84),
            ({"shadowing": "ashikhmin-premoze", "distribution": "gtr"}, 2.75),
            ({"shadowing": "neumann", "distribution": "epd"}, 52.8),
            ({"shadowing": "ashikhmin-premoze", "distribution": "epd"}, 36.7),
            ({"shadowing": "ashikhmin-shirley", "distribution": ("blinn", "abc", "hepd")}, 1),
            ({"shadowing": "ashikhmin-shirley", "distribution": "beckmann"}, 1.05),
            ({"shadowing": "ashikhmin-shirley", "distribution": "ggx"}, 1.69),
            ({"shadowing": "ashikhmin-shirley", "distribution": "gtr"}, 4.41),
            ({"shadowing": "ashikhmin-shirley", "distribution": "epd"}, 66.1),
            ({"shadowing": "kurt", "kurt_exponent": 0.25, "distribution": NEARLY_ALL}, 3.64),
            ({"shadowing": "kurt", "distribution": NEARLY_ALL}, 20.3),
            ({"shadowing": "kurt", "distribution": "gtr"}, 35),
            ({"shadowing": "kurt", "distribution": "epd"}, float("inf")),
        ],
    )

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        suited = [word for word, it in DISTRIBUTIONS.items() if SHADOWING[self.shadowing].suits(it.distribution)]
        if self.distribution not in suited:
            raise ParameterError(
                f'microfacet: shadowing = "{self.shadowing}" is not known for distribution = "{self.distribution}"; '
                f'take it with {listed(suited)}, or another one such as "vcavity".'
            )

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        distribution = DISTRIBUTIONS[self.distribution].distribution.of_values(vars(p.distribution))
        shadowing = SHADOWING[self.shadowing].make(distribution, **vars(p.shadowing))
        return over_diffuse(
            p.diffuse_reflectance, MicrofacetLobe(p.specular_reflectance, distribution, shadowing, p.fresnel)
        )


# --- Words of others ------------------------------------------------------------------------------------------------

BROUGHT: dict[tuple[str, str], type[Term]] = {}
"""The terms registered by others, by the name of the choice and the word."""


def add_term(term: type[Term], replace: bool) -> None:
    """Register a distribution, a shadowing or a Fresnel term under its word: see :func:`mi_brdfs.register`."""
    name, word = term.__name__, term.word
    if not word or not re.fullmatch(r"[a-z][a-z0-9-]*", word):
        raise ValueError(f'{name}: word is {word!r}; it must be lower-case letters, digits and -, as in "student-t".')
    kinds = {Distribution: Microfacet.distribution, Shadowing: Microfacet.shadowing, Fresnel: fresnel_parameters.OTHERS}
    kind, choice = next((kind, choice) for kind, choice in kinds.items() if issubclass(term, kind))
    former = BROUGHT.get((choice.name, word))
    owner = full_name(former) if former else "mi_brdfs"
    if word in choice.words and owner != full_name(term) and not replace:
        raise ValueError(
            f'{name}: the word "{word}" belongs to {owner}; take another one, or register with replace=True.'
        )
    others = [it for it in Microfacet.declared() if it is not choice and not (kind is Fresnel and it.name == "fresnel")]
    taken = {name for parameter in others for name in parameter.names}
    if clash := next((name for it in term.parameters for name in (it, f"{it}_u", f"{it}_v") if name in taken), None):
        raise ValueError(f"{name}: a parameter cannot be called {clash}, a parameter of microfacet.")
    choice.add(word, term.parameters)
    BROUGHT[choice.name, word] = term
    if issubclass(term, Distribution):
        DISTRIBUTIONS[word] = Facets(term, term.parameters)
    elif issubclass(term, Shadowing):
        SHADOWING[word] = Shadows(lambda facets, **values: term.of_values(values), term.parameters)
    elif issubclass(term, Fresnel):
        fresnel_parameters.TERMS[word] = term
