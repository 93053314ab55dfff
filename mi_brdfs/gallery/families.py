"""The order of the models in the gallery, and the materials that show each: those that stand for the models of a family
have the same colour."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..mitsuba.registry import is_own
from ..model import FAMILIES, Model

MODELS = json.loads(Path(__file__).with_name("models.json").read_text(encoding="utf-8"))
"""The pack's models, each with its portrait and the sweeps that show it, the main one first: what is swept, its values,
and what is given besides.

Portraits have facets of about α = 0.2 or what comes near (a power of the half vector's cosine is about four times that
of the mirror direction's), lobes as wide as those of α = 0.15 among the fits to measurements, and what a model is known
for; others where two would look alike."""
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
    """Return the material that stands for a model: that of the table or, for other models, the example on its page."""
    name, known = model.plugins[0], of_own(model)
    return {"type": name, **coloured(known["portrait"])} if known else model.example()


def of_own(model: type[Model]) -> dict[str, Any]:
    """Return what the table has of a model: of others, nothing."""
    return MODELS["models"].get(model.plugins[0], {}) if is_own(model) else {}


def coloured(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of parameters, with colours in place of their names."""
    colours = MODELS["colours"]
    return {name: {"type": "rgb", "value": colours[it]} if str(it) in colours else it for name, it in values.items()}


def stage_of(model: type[Model]) -> str:
    """Return the stage on which a model is shown."""
    return STAGES.get(model.family, "studio")
