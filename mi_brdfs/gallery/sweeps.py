"""The parameters and values that the gallery shows of each model. The first sweep of a model is its main one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..mitsuba.registry import is_own
from ..model import Model
from .families import BLUE, CLAY, GREEN, LACQUER, RED, rgb


@dataclass(frozen=True)
class Sweep:
    """A parameter at several values, with the others as ``given``. Several parameters, separated by commas, share each
    value."""

    parameter: str
    values: tuple
    given: dict[str, Any]

    def bsdfs(self, type: str) -> list[dict]:
        """Return the plugin dicts."""
        names = self.parameter.split(", ")
        return [{"type": type, **self.given, **dict.fromkeys(names, value)} for value in self.values]

    def heading(self, type: str) -> str:
        """Return the heading: the model, the parameter, and what is given."""
        given = ", ".join(f"{name} = {shown(value)}" for name, value in self.given.items())
        return f"{type}: {self.parameter}" + (f", with {given}" if given else "")


def shown(value: Any) -> str:
    """Return a value as a label."""
    if isinstance(value, dict):
        return "(" + ", ".join(f"{channel:g}" for channel in value["value"]) + ")"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def sweep(parameter: str, *values: Any, **given: Any) -> Sweep:
    return Sweep(parameter, values, given)


GOLD, INDIGO = rgb(0.9, 0.6, 0.25), rgb(0.02, 0.03, 0.1)

SWEEPS: dict[str, list[Sweep]] = {
    "ashikhminshirley": [
        sweep("exponent", 10, 50, 200, 1000, 10000, **LACQUER),
        sweep("exponent_u", 10, 50, 200, 1000, 5000, exponent_v=200, **LACQUER),
        sweep("specular_reflectance", 0.0, 0.05, 0.2, 0.5, 1.0, diffuse_reflectance=BLUE),
    ],
    "blinnphong": [
        sweep("exponent", 5, 20, 80, 320, 2000, diffuse_reflectance=BLUE),
        sweep("normalization", "energy", "approximate", "ndf", "none", "original", diffuse_reflectance=BLUE),
    ],
    "brady": [
        sweep("beta", 0.15, 0.25, 0.35, 0.5, 0.7, f0=0.6, diffuse_reflectance=0.1),
        sweep("exponent", 0.4, 0.6, 1.0, 2.0, 3.0, beta=0.5, f0=0.6, diffuse_reflectance=0.1),
    ],
    "burley": [
        sweep("roughness", 0.1, 0.3, 0.5, 0.7, 1.0, base_color=RED),
        sweep("metallic", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=GOLD, roughness=0.3),
        sweep("subsurface", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=RED),
        sweep("specular", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=RED, roughness=0.3),
        sweep("spec_tint", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=RED, specular=1.0, roughness=0.3),
        sweep("anisotropic", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=GOLD, metallic=1.0, roughness=0.4),
        sweep("sheen", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=INDIGO, roughness=0.8),
        sweep("sheen_tint", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=INDIGO, roughness=0.8, sheen=1.0),
        sweep("clearcoat", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=RED, roughness=0.7),
        sweep("clearcoat_gloss", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=RED, roughness=0.7, clearcoat=1.0),
    ],
    "cooktorrance": [
        sweep("alpha", 0.05, 0.1, 0.2, 0.4, 0.8, material="Cu"),
        sweep("material", "Ag", "Al", "Au", "Cu", "W", alpha=0.2),
        sweep("int_ior", 1.1, 1.33, 1.5, 2.0, 3.0, diffuse_reflectance=GREEN, alpha=0.15),
        sweep("distribution", "beckmann", "ggx", "blinn", material="Cu", alpha=0.3),
    ],
    "eon": [
        sweep("roughness", 0.0, 0.25, 0.5, 0.75, 1.0, reflectance=CLAY),
    ],
    "kurt": [
        sweep("alpha", 0.03, 0.1, 0.2, 0.3, 0.5, diffuse_reflectance=RED, f0=0.1),
        sweep("alpha_u", 0.03, 0.1, 0.2, 0.3, 0.5, alpha_v=0.1, diffuse_reflectance=RED, f0=0.1),
        sweep("kurt_exponent", 0.0, 0.125, 0.25, 0.375, 0.5, alpha=0.2, diffuse_reflectance=RED, f0=0.1),
    ],
    "lafortune": [
        sweep("exponent", 5, 20, 80, 320, 2000, diffuse_reflectance=BLUE),
        sweep("cx, cy", -1.0, -0.5, 0.0, 0.5, 1.0, exponent=3, diffuse_reflectance=0.1, specular_reflectance=0.8),
        sweep("cy", -1.0, -0.5, 0.0, 0.5, 1.0, exponent=20, diffuse_reflectance=BLUE, specular_reflectance=0.5),
        sweep("cz", 0.7, 0.8, 0.9, 1.0, 1.1, exponent=20, diffuse_reflectance=BLUE),
    ],
    "lambert": [
        sweep("reflectance", 0.1, 0.3, 0.5, 0.7, 0.9),
    ],
    "low": [
        sweep("b", 10, 100, 1000, 10000, 100000, normalization="unit", diffuse_reflectance=GREEN),
        sweep("c", 1.1, 1.5, 2.0, 4.0, 8.0, b=200, normalization="unit", diffuse_reflectance=GREEN),
        sweep("a", 1.0, 3.0, 10.0, 30.0, 100.0, b=1000, diffuse_reflectance=GREEN),
        sweep("variant", "microfacet", "smooth", a=10.0, b=100, diffuse_reflectance=GREEN),
    ],
    "metallicroughness": [
        sweep("roughness", 0.1, 0.3, 0.5, 0.7, 1.0, base_color=GOLD, metallic=1.0),
        sweep("metallic", 0.0, 0.25, 0.5, 0.75, 1.0, base_color=GOLD, roughness=0.3),
        sweep("shadowing", "direct", "ibl", "smith", base_color=GOLD, metallic=1.0, roughness=0.3),
    ],
    "microfacet": [
        sweep("gamma", 1.0, 1.5, 2.0, 3.0, 6.0, distribution="gtr", alpha=0.2, shadowing="vcavity", material="Cr"),
        sweep("alpha", 0.05, 0.1, 0.2, 0.4, 0.8, distribution="ggx", material="Cr"),
        sweep("distribution", "beckmann", "ggx", "blinn", "abc", "hepd", shadowing="vcavity", material="Cr"),
        sweep("shadowing", "smith", "vcavity", "kelemen", "neumann", "implicit", alpha=0.4, material="Cr"),
    ],
    "minnaert": [
        sweep("exponent", 0.3, 0.6, 1.0, 2.0, 4.0, reflectance=0.6),
        sweep("normalization", "energy", "published", "none", exponent=0.6, reflectance=0.6),
    ],
    "nishino": [
        sweep("gamma", 10, 40, 160, 640, 10000, material="Cu"),
        sweep("kappa", -60, -15, -5, 5, 15, gamma=40, material="Cu"),
        sweep("variant", "microfacet", "dsbrdf", gamma=40),
    ],
    "orennayar": [
        sweep("sigma", 0.0, 0.2, 0.4, 0.8, 1.5, reflectance=CLAY),
        sweep("model", "qualitative", "full", reflectance=CLAY, sigma=0.5),
    ],
    "phong": [
        sweep("exponent", 5, 20, 80, 320, 2000, diffuse_reflectance=BLUE),
        sweep("specular_reflectance", 0.0, 0.1, 0.2, 0.4, 0.6, diffuse_reflectance=BLUE),
        sweep("normalization", "energy", "none", "original", diffuse_reflectance=BLUE, exponent=10),
    ],
    "roughdiffuse": [
        sweep("alpha", 0.0, 0.25, 0.5, 1.0, 2.0, reflectance=CLAY),
        sweep("use_fast_approx", False, True, reflectance=CLAY, alpha=0.7),
    ],
    "toon": [
        sweep("diffuse_threshold", 0.1, 0.3, 0.5, 0.7, 0.9, diffuse_reflectance=RED, diffuse_shadow=0.2),
        sweep("diffuse_shadow", 0.0, 0.25, 0.5, 0.75, 1.0, diffuse_reflectance=RED),
        sweep("specular_threshold", 0.99, 0.95, 0.9, 0.8, 0.6, diffuse_reflectance=RED, diffuse_shadow=0.2),
    ],
    "walter": [
        sweep("alpha", 0.02, 0.1, 0.2, 0.4, 0.8, material="Au"),
        sweep("alpha_v", 0.02, 0.05, 0.1, 0.2, 0.4, alpha_u=0.1, material="Au"),
        sweep("material", "Ag", "Al", "Au", "Cu", "W", alpha=0.2),
        sweep("int_ior", 1.1, 1.33, 1.5, 2.0, 3.0, diffuse_reflectance=GREEN, alpha=0.15),
        sweep("multiscatter", "none", "walk", "kulla-conty", "turquin", material="Au", alpha=0.8),
        sweep("film_thickness", 0, 150, 300, 450, 800, material="Cr", alpha=0.15),
        sweep("f82", 1.0, 0.75, 0.5, 0.25, 0.0, f0=0.8, alpha=0.15),
        sweep("haze", 0.0, 0.25, 0.5, 0.75, 1.0, material="Au", alpha=0.05),
        sweep("retroreflectivity", 0.0, 0.25, 0.5, 0.75, 1.0, material="Au", alpha=0.3),
    ],
    "ward": [
        sweep("alpha", 0.02, 0.05, 0.1, 0.2, 0.4, diffuse_reflectance=RED),
        sweep("alpha_v", 0.02, 0.05, 0.1, 0.2, 0.4, alpha_u=0.1, diffuse_reflectance=RED),
        sweep("rotation", 0.0, 0.0625, 0.125, 0.1875, 0.25, alpha_u=0.05, alpha_v=0.4, diffuse_reflectance=RED),
        sweep("variant", "balanced", "ward", "ward-duer", "approximate", alpha=0.3, diffuse_reflectance=RED),
    ],
    "wrap": [
        sweep("wrap", 0.0, 0.25, 0.5, 0.75, 1.0, reflectance=CLAY),
        sweep("exponent", 0.5, 1.0, 2.0, 4.0, 8.0, reflectance=CLAY),
    ],
}


def sweeps_of(model: type[Model]) -> list[Sweep]:
    """Return the sweeps that show a model: those above or, for other models, each number over its range (or about its
    default, if the range spans orders of magnitude) and each choice, with the other parameters as in the example on the
    manual page. A model with neither sweeps its reflectances."""
    name = model.plugins[0]
    if is_own(model) and name in SWEEPS:
        return SWEEPS[name]
    numbers: list[Sweep] = []
    colours: list[Sweep] = []
    for parameter in model.declared():
        if values := parameter.tried:
            own = {"type", *parameter.names}
            given = {name: value for name, value in model.example().items() if name not in own}
            of_its_kind = colours if any(it.colour for it in parameter.quantities(pairs=False)) else numbers
            of_its_kind.append(Sweep(parameter.name, values, given))
    return numbers or colours
