"""What the gallery shows: the order of the models, and of each the material that stands for it, in the colour of its
family, and sweeps of its parameters, the main one first."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
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
UNITS = MODELS["units"]
"""The units of parameters that have one."""
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


@dataclass(frozen=True)
class Sweep:
    """A parameter at several values, with others ``given``; several, separated by commas, share each value."""

    parameter: str
    values: tuple
    given: dict[str, Any]

    def bsdfs(self, type: str) -> list[dict]:
        """Return the plugin dicts."""
        names = self.parameter.split(", ")
        return [{"type": type, **self.given, **dict.fromkeys(names, value)} for value in self.values]

    def heading(self) -> str:
        """Return the heading: the parameter, and what is given."""
        given = listed(self.given)
        unit = f" in {UNITS[self.parameter]}" if self.parameter in UNITS else ""
        return self.parameter + unit + (f", with {given}" if given else "")

    def captions(self) -> list[str]:
        """Return a label for each value; of a rotation, also in degrees."""
        degrees = self.parameter == "rotation"
        return [shown(value) + (f" ({360 * value:g}°)" if degrees else "") for value in self.values]


def listed(values: Mapping[str, Any]) -> str:
    """Return parameters and their values as a label."""
    return ", ".join(f"{name} = {shown(value)}" for name, value in values.items())


def shown(value: Any) -> str:
    """Return a value as a label."""
    if isinstance(value, dict):
        return "(" + ", ".join(f"{channel:g}" for channel in value["value"]) + ")"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def sweeps_of(model: type[Model]) -> list[Sweep]:
    """Return the sweeps that show a model: those of the table or, for other models, each number over its range (or
    about its default, if the range spans orders of magnitude) and each choice, with the other parameters as in the
    example on the manual page. A model with neither sweeps its reflectances."""
    if rows := of_own(model).get("sweeps"):
        return [Sweep(name, tuple(values), coloured(given)) for name, values, given in rows]
    numbers: list[Sweep] = []
    colours: list[Sweep] = []
    for parameter in model.declared():
        if values := parameter.tried:
            own = {"type", *parameter.names}
            given = {name: value for name, value in model.example().items() if name not in own}
            of_its_kind = colours if any(it.colour for it in parameter.quantities(pairs=False)) else numbers
            of_its_kind.append(Sweep(parameter.name, values, given))
    return numbers or colours
