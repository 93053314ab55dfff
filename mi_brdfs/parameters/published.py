"""The materials that papers publish as parameters of a model, by name."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from .messages import meant


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
    return dict(entry["plugin"]) | {parameter: _value(value) for parameter, value in values}


def provenance(name: str) -> Provenance:
    """Return where a published material comes from.

    Raises:
        ValueError: as :func:`preset`.
    """
    entry, _ = _find(name)
    return Provenance(*(entry[field] for field in Provenance._fields))


def _value(value: Any) -> Any:
    return {"type": "rgb", "value": list(value)} if isinstance(value, list) else value


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
    hint = f"did you mean {near!r}?" if near else "mi_brdfs.presets() lists them."
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
