"""The materials that papers publish as parameters of a model, by name, and the parameter that takes such a name."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi

from .messages import meant, shown
from .parameter import Parameter, ParameterRow
from .reader import PropertyReader


class Provenance(NamedTuple):
    """Where the numbers of a preset come from, and what they mean."""

    source: str
    doi: str
    convention: str
    """The formula that they were published for, as the plugin evaluates it."""
    defects: list[str]
    """What is known to be wrong with them, and how they differ from the printed ones."""


def names(plugin: str | None = None) -> list[str]:
    """Return the names of the published materials, as in ``ngan/ward/blue-acrylic``, or only those of a plugin."""
    return [
        f"{name}/{material}"
        for name, entry in _data()["sets"].items()
        if plugin in (None, entry["plugin"]["type"])
        for material in entry["materials"]
    ]


def preset(name: str) -> dict[str, Any]:
    """Return a published material as a new plugin dict, of numbers, words and rgb colours.

    Raises:
        ValueError: if there is no such material; the message has the closest one, or why it was left out.
    """
    entry, material = _find(name)
    values = zip(entry["parameters"], entry["materials"][material], strict=True)
    return dict(entry["plugin"]) | {
        parameter: {"type": "rgb", "value": list(value)} if isinstance(value, list) else value
        for parameter, value in values
    }


def provenance(name: str) -> Provenance:
    """Return where a published material comes from; raise as :func:`preset`."""
    entry, _ = _find(name)
    return Provenance(*(entry[field] for field in Provenance._fields))


def _find(name: str) -> tuple[dict[str, Any], str]:
    """Return the set that a material belongs to, and its name there."""
    data = _data()
    family, _, material = str(name).rpartition("/")
    entry = data["sets"].get(family, {"materials": {}, "left_out": {}})
    if material in entry["materials"]:
        return entry, material
    if reason := data["left_out"].get(family) or entry["left_out"].get(material):
        raise ValueError(f"There is no preset {name!r}: {reason}.")
    near = closest(str(name), names())
    hint = f"did you mean {near!r}?" if near else "mi-brdfs presets and mi_brdfs.presets() list them."
    raise ValueError(f"There is no preset {name!r}; {hint}")


def closest(name: str, known: list[str]) -> str | None:
    """Return the name that may have been meant by another one: of the same set, or the first of this material."""
    family, _, material = name.rpartition("/")
    same = [it for it in known if it.rpartition("/")[0] == family]
    if same:
        near = meant(material, [it.rpartition("/")[2] for it in same])
        return near and f"{family}/{near}"
    return next((it for it in known if it.endswith(f"/{name}")), None) or meant(name, known)


@cache
def _data() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("published.json").read_text(encoding="utf-8"))


class Preset(Parameter):
    """The name of a published material, whose values stand where no others are given."""

    def __init__(self) -> None:
        super().__init__("a published material, as mi-brdfs presets lists them; other parameters replace its values")

    def fill_in(self, reader: PropertyReader, declared: Iterable[Parameter]) -> None:
        """Give the properties the values of the named material, unless they, or others that replace them, are given."""
        if self.name not in reader:
            return
        values = self._values(reader)
        # The same word takes no place of another parameter.
        given = {
            name
            for name in reader.props.keys()
            if not isinstance(reader.props[name], str) or reader.props[name] != values.get(name)
        }
        for parameter in declared:
            for name in parameter.names:
                if name in values and name not in reader and given.isdisjoint(parameter.rivals(name)):
                    value = values[name]
                    reader.props[name] = mi.ScalarColor3d(value["value"]) if isinstance(value, dict) else value

    def _values(self, reader: PropertyReader) -> dict:
        name, plugin = reader.text(self.name), reader.plugin
        wanted = f"it must be a material that `mi-brdfs presets --model {plugin}` lists"
        known = names()
        if name not in known:
            near = closest(name, names(plugin)) or closest(name, known)
            hint = f'did you mean "{near}"? {wanted[0].upper()}{wanted[1:]}' if near else wanted
            raise reader.error(self.name, f"= {shown(name)} is unknown; {hint}")
        values = preset(name)
        if values["type"] != plugin:
            raise reader.error(self.name, f"= {shown(name)} is a material of the plugin {values['type']}; {wanted}")
        return values

    def bind(self, reader: PropertyReader) -> Preset:
        return self.replace(chosen={self.name: reader.text(self.name)} if self.name in reader else {})

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> None:
        return None

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "string", "none", "see mi-brdfs presets", self.text)]
