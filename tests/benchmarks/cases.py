"""The cases to measure: each model with some sets of parameters, and the built-in that matches it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mi_brdfs.mitsuba.registry import own_models

Plugin = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A model with a set of parameters."""

    name: str
    """The plugin, followed by words for the parameters, none for the defaults."""
    bsdf: Plugin
    builtin: Plugin | None = None
    """The built-in to compare it with, if there is one."""
    same: bool = False
    """Whether the built-in is the same model, at least nearly; otherwise it is one of the same kind, and only times are
    comparable."""

    @property
    def beside(self) -> str:
        """Return the names of both."""
        return f"{self.name} / {self.builtin['type']}" + ("" if self.same else ", another model")


def case(name: str, builtin: Plugin | None = None, same: bool = False, **given: Any) -> Case:
    return Case(name, {"type": name.split()[0], **given}, builtin, same)


def rgb(*value: float) -> Plugin:
    return {"type": "rgb", "value": list(value)}


def diffuse(**given: Any) -> Plugin:
    return {"type": "diffuse", **given}


def conductor(distribution: str, **given: Any) -> Plugin:
    material = {} if "material" in given else {"material": "none"}
    return {"type": "roughconductor", "distribution": distribution, **material, **given}


def principled(**given: Any) -> Plugin:
    """Return Mitsuba's ``principled`` with the defaults of ``burley``."""
    given.setdefault("spec_tint", 0.0)
    return {"type": "principled", "specular": 0.5, "sheen_tint": 0.5, "clearcoat_gloss": 1.0, **given}


def plastic(alpha: float) -> Plugin:
    """Return a glossy lobe over a diffuse one, as wide as that of the model compared with it."""
    return {"type": "roughplastic", "alpha": alpha}


GOLD = rgb(0.9, 0.6, 0.3)
COATED = {"base_color": rgb(0.6, 0.1, 0.05), "roughness": 0.4, "clearcoat": 0.5, "sheen": 0.5}
METAL = {"base_color": GOLD, "metallic": 1.0, "roughness": 0.4}
VELVET = {"base_color": rgb(0.2, 0.1, 0.4), "roughness": 0.8, "sheen": 1.0}

CASES = [
    case("ashikhminshirley", plastic(0.14)),
    case("ashikhminshirley anisotropic", exponent_u=13, exponent_v=310),
    case("ashikhminshirley metal", exponent=1000, specular_reflectance=0.9, diffuse_reflectance=0.0),
    case("blinnphong", plastic(0.25)),
    case("blinnphong broad", exponent=8, specular_reflectance=0.4),
    case("blinnphong original, sharp", exponent=300, normalization="original"),
    case("brady"),
    case("brady metal", f0=0.9, beta=0.5, diffuse_reflectance=0.0),
    case("brady long tail", f0=0.6, exponent=0.8, diffuse_reflectance=0.1),
    case("burley", principled(base_color=0.5, roughness=0.5), same=True),
    case("burley coated", principled(**COATED), same=True, **COATED),
    case("burley metal", principled(**METAL, anisotropic=0.6), same=True, **METAL, anisotropic=0.6),
    case("burley velvet", principled(**VELVET, flatness=0.7), same=True, **VELVET, subsurface=0.7),
    case("cooktorrance", conductor("beckmann", alpha=0.1)),
    case("cooktorrance copper", alpha=0.3, material="Cu"),
    case("cooktorrance dielectric", alpha=0.5, int_ior=1.5, diffuse_reflectance=0.5),
    case("eon"),
    case("eon rough", reflectance=0.8, roughness=1.0),
    case("eon smooth", reflectance=rgb(0.6, 0.35, 0.2), roughness=0.1),
    case("kurt", plastic(0.1)),
    case("kurt two lobes", alpha_1=0.05, alpha_2=0.3),
    case("kurt anisotropic metal", alpha_u=0.1, alpha_v=0.5, f0=0.9, kurt_exponent=0.0, diffuse_reflectance=0.0),
    case("lafortune", plastic(0.25)),
    case("lafortune off-specular", cx=-0.9, cy=-0.9, cz=0.7, exponent=9),
    case("lafortune retro-reflective", exponent_1=20, cx_2=0.9, cy_2=0.9, cz_2=0.7, exponent_2=9),
    case("lambert", diffuse(reflectance=0.5), same=True),
    case("lambert white", reflectance=1.0),
    case("lambert red", reflectance=rgb(0.8, 0.1, 0.1)),
    case("low"),
    case("low unit, sharp", b=2000, c=1.2, normalization="unit", diffuse_reflectance=0.3),
    case("low smooth", variant="smooth", diffuse_reflectance=0.3, a=5.0),
    case("metallicroughness", principled(base_color=0.5, roughness=0.5), same=True),
    case("metallicroughness metal", principled(**METAL), same=True, **METAL, shadowing="smith"),
    case("metallicroughness rough", principled(base_color=0.5, roughness=0.8), same=True, roughness=0.8),
    case("microfacet", conductor("beckmann", alpha=0.1), same=True),
    case("microfacet alpha 0.5", conductor("beckmann", alpha=0.5), same=True, alpha=0.5),
    case("microfacet alpha 1", conductor("beckmann", alpha=1.0), same=True, alpha=1.0),
    case("microfacet ggx, anisotropic", distribution="ggx", shadowing="smith-correlated", alpha_u=0.1, alpha_v=0.4,
         int_ior=1.5, diffuse_reflectance=0.5),
    case("microfacet gtr", distribution="gtr", alpha=0.2, gamma=1.5, shadowing="vcavity", material="Al"),
    case("minnaert"),
    case("minnaert bright limb", exponent=0.5),
    case("minnaert published", exponent=3.0, normalization="published"),
    case("nishino"),
    case("nishino peaked", kappa=4, gamma=25, material="Cu"),
    case("nishino dsbrdf", kappa=-8, gamma=40, variant="dsbrdf", diffuse_reflectance=0.4, specular_reflectance=0.5),
    case("orennayar"),
    case("orennayar rough", sigma=0.9),
    case("orennayar full", sigma=0.5, model="full", reflectance=0.8),
    case("phong", plastic(0.25)),
    case("phong broad", exponent=3, specular_reflectance=0.4),
    case("phong original, sharp", exponent=300, normalization="original"),
    case("roughdiffuse"),
    case("roughdiffuse rough", alpha=1.0),
    case("roughdiffuse fast", alpha=0.5, use_fast_approx=True),
    case("toon"),
    case("toon soft", diffuse_smooth=0.4, diffuse_shadow=0.3, specular_threshold=0.6, specular_smooth=0.3),
    case("toon hard", diffuse_smooth=0.0, specular_smooth=0.0, specular_threshold=0.98),
    case("walter", conductor("ggx", alpha=0.1), same=True),
    case("walter alpha 0.5", conductor("ggx", alpha=0.5), same=True, alpha=0.5),
    case("walter alpha 1", conductor("ggx", alpha=1.0), same=True, alpha=1.0),
    case("walter gold, anisotropic", conductor("ggx", alpha_u=0.1, alpha_v=0.4, material="Au"), same=True,
         alpha_u=0.1, alpha_v=0.4, material="Au"),
    case("walter dielectric", alpha=0.3, int_ior=1.5, diffuse_reflectance=0.5),
    case("ward", plastic(0.1)),
    case("ward anisotropic", alpha_u=0.08, alpha_v=0.3, specular_reflectance=0.5),
    case("ward ward-duer, rough", alpha=0.5, variant="ward-duer"),
    case("wrap"),
    case("wrap little", wrap=0.3, exponent=1),
    case("wrap sphere", wrap=0.5, domain="sphere"),
]  # fmt: skip
TABLED = {case.bsdf["type"] for case in CASES}
for name, model in ((model.plugins[0], model) for model in own_models() if model.plugins[0] not in TABLED):
    CASES += [case(name), Case(f"{name} example", model.example())]
"""The cases of the pack's models, each model's defaults first: those above, or else the example on its manual page."""


def pairs() -> list[Case]:
    """Return the first case of each model that has a built-in."""
    return list({case.bsdf["type"]: case for case in reversed(CASES) if case.builtin}.values())[::-1]


def defaults() -> list[Plugin]:
    """Return the first case of each model."""
    return list({case.bsdf["type"]: case.bsdf for case in reversed(CASES)}.values())[::-1]


BUILT_INS = [
    diffuse(),
    {"type": "conductor"},
    {"type": "dielectric"},
    {"type": "thindielectric"},
    {"type": "plastic"},
    {"type": "plastic", "nonlinear": True},
    {"type": "pplastic"},
    conductor("ggx"),
    conductor("ggx", sample_visible=False),
    conductor("beckmann", material="Cu"),
    conductor("beckmann", material="Cu", sample_visible=False),
    {"type": "roughdielectric", "distribution": "ggx"},
    {"type": "roughdielectric", "distribution": "beckmann"},
    {"type": "roughplastic", "distribution": "ggx"},
    {"type": "roughplastic", "distribution": "beckmann", "nonlinear": True},
    {"type": "principled"},
    principled(clearcoat=0.5, sheen=0.5),
    principled(metallic=0.5, anisotropic=0.5),
    {"type": "principled", "spec_trans": 0.5},
    {"type": "principledthin"},
    {"type": "hair"},
]
"""Built-ins, no two with the same code, to load as many of them as models."""
