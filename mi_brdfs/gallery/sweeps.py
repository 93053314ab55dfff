"""The parameters and values that the gallery shows of each model. The first sweep of a model is its main one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..model import Model
from .families import MODELS, coloured, of_own

UNITS = MODELS["units"]
"""The units of parameters that have one."""


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
