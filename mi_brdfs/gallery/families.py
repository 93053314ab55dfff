"""The order of the models in the gallery, and the material that stands for each: in a family, the same colour, with
what a model is known for."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from ..mitsuba.registry import is_own
from ..model import FAMILIES, Model


def rgb(*channels: float) -> dict:
    return {"type": "rgb", "value": list(channels)}


CLAY, COPPER, BLUE = rgb(0.6, 0.35, 0.2), rgb(0.955, 0.638, 0.538), rgb(0.1, 0.2, 0.4)
RED, GREEN = rgb(0.6, 0.1, 0.05), rgb(0.1, 0.3, 0.2)
LACQUER = {"diffuse_reflectance": BLUE, "specular_reflectance": 0.2}
ENAMEL = {"diffuse_reflectance": GREEN, "f0": 0.2}

PORTRAITS: dict[str, dict[str, Any]] = {
    "lambert": {"reflectance": CLAY},
    "minnaert": {"reflectance": CLAY},
    "orennayar": {"reflectance": CLAY, "sigma": 0.8},
    "roughdiffuse": {"reflectance": CLAY, "alpha": 0.7},
    "wrap": {"reflectance": CLAY},
    "eon": {"reflectance": CLAY, "roughness": 1.0},
    # About α = 0.2
    "microfacet": {"f0": COPPER, "alpha": 0.2, "distribution": "gtr", "gamma": 1.2, "shadowing": "vcavity"},
    "cooktorrance": {"f0": COPPER, "alpha": 0.2},
    "ward": {"diffuse_reflectance": 0.0, "specular_reflectance": COPPER, "alpha_u": 0.05, "alpha_v": 0.3},
    "schlick": {"specular_reflectance": COPPER, "roughness": 0.04},
    "walter": {"f0": COPPER, "alpha": 0.2},
    "kurt": {"diffuse_reflectance": 0.0, "f0": COPPER, "alpha": 0.2},
    # A power of the half vector's cosine is about four times that of the mirror direction's.
    "phong": {**LACQUER, "exponent": 20},
    "blinnphong": {**LACQUER, "exponent": 80},
    "lafortune": {**LACQUER, "exponent": 20},
    "ashikhminshirley": {**LACQUER, "exponent_u": 1000, "exponent_v": 10},
    "burley": {"base_color": RED, "roughness": 0.3, "clearcoat": 1.0},
    "metallicroughness": {"base_color": RED, "metallic": 1.0, "roughness": 0.3},
    # Lobes as wide as those of α = 0.15
    "nishino": {**ENAMEL, "kappa": -5.0, "gamma": 100},
    "brady": {**ENAMEL, "beta": 0.4, "exponent": 2.0},
    "low": {"diffuse_reflectance": GREEN, "normalization": "unit", "b": 2000, "c": 1.2, "int_ior": 2.6},
    "toon": {"diffuse_reflectance": RED, "diffuse_shadow": 0.3},
}
STAGES = {"diffuse": "point", "cartoon": "point"}
"""The stages of families that are not shown in the studio."""


def year(model: type[Model]) -> str:
    """Return a model's year of publication: the first year on its manual page, if there is one."""
    found = re.search(r"\b(1[789]|20)\d\d\b", model.__doc__ or "")
    return found[0] if found else ""


def by_family(models: Iterable[type[Model]]) -> list[type[Model]]:
    """Return models by family and year: first the pack's families, then those of others, then models without one."""

    def place(model: type[Model]) -> tuple:
        own = FAMILIES.index(model.family) if model.family in FAMILIES else len(FAMILIES)
        return not model.family, own, model.family, year(model), model.plugins

    return sorted(models, key=place)


def portrait(model: type[Model]) -> dict[str, Any]:
    """Return the material that stands for a model: the one above or, for other models, the example on its page."""
    name = model.plugins[0]
    return {"type": name, **PORTRAITS[name]} if is_own(model) and name in PORTRAITS else model.example()


def stage_of(model: type[Model]) -> str:
    """Return the stage on which a model is shown."""
    return STAGES.get(model.family, "studio")
