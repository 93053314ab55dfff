"""BSDFs by the words that name them on the command line: plugins, XML, the materials of scene files."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from .. import legacy
from ..names import tabulated
from ..parameters import published
from ..srgb import decoded
from .bsdf import BSDFProbe, contained, load
from .directions import direction, on_side
from .variates import random

RESERVED = ("path", "string", "parallel", "optimize")
"""The arguments of Mitsuba's functions that load XML, which no parameter of it may be called."""


class BSDFSource(NamedTuple):
    """A BSDF by name, which any process can load."""

    name: str
    word: str
    """What a user may give for it."""
    source: str
    """The type of a plugin, XML text, or the path of a scene or of a measured file."""
    material: int | None = None
    """Which of the scene's materials."""
    parameters: Mapping[str, str] = {}
    """Those of the plugin, or of the XML, with their values as text."""

    @property
    def path(self) -> str:
        """The path of a measured file, or a name that the plugin looks for elsewhere."""
        return os.path.realpath(self.source) if os.path.exists(self.source) else self.source

    def load(self) -> dict[str, Any] | mi.BSDF:
        """Return the dict of a plugin that is given by its type, and else the BSDF, loaded in the active variant."""
        values = {name: value_of(text) for name, text in self.parameters.items()}
        if self.source in published.names():
            return published.preset(self.source) | values
        if is_measured(self.source):
            return tabulated(self.path) | values
        if self.source.endswith(".xml"):
            loaded = legacy.load(Path(self.source), self.parameters)
            return loaded if self.material is None else _materials(loaded)[self.material]
        if self.source.startswith("<"):
            return mi.load_string(_versioned(self.source), **self.parameters)
        return {"type": self.source} | values


def find_sources(word: str, parameters: Mapping[str, str] | None = None) -> Iterator[BSDFSource]:
    """Yield the BSDFs that a word stands for: the type of a plugin, the name of a published material, a ``<bsdf …>`` as
    text, the path of a measured file, which ``tabulated`` renders, the path of a scene, whose materials count once each
    and those of lamps only if they reflect, or one of them as ``scene.xml:id``. Parameters are those of the plugin, or
    the values of the ``<default>`` elements of XML.

    Raises:
        ValueError: if it stands for none.
        Exception: what Mitsuba raises where it cannot be loaded.
    """
    parameters = parameters or {}
    is_data = is_measured(word)
    file, _, wanted = ("", "", "") if is_data else word.partition(".xml:")
    path = Path(f"{file}.xml" if wanted else word)
    is_text = word.startswith("<") and not is_data and not os.path.isfile(path)
    is_file = path.suffix == ".xml" and not is_text
    wanted = wanted if is_file else ""
    if is_file and not path.is_file():
        raise ValueError(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    if (is_file or is_text) and (reserved := [name for name in RESERVED if name in parameters]):
        raise ValueError(f"-D {reserved[0]}: Mitsuba reserves this name; rename the parameter in the XML")
    name = path.name if is_file or is_data else word
    source = BSDFSource(name, word, str(path) if is_file or is_data else word, None, parameters)
    suffix = "".join(f" {name}={value}" for name, value in parameters.items())
    loaded = source.load()
    loaded = load(loaded) if isinstance(loaded, dict) else loaded
    if isinstance(loaded, mi.Scene) and is_file:
        names = _distinct([name_of(bsdf) for bsdf in _materials(loaded)])
        if not names:
            raise ValueError(f"{path}: the scene has no material")
        if wanted and wanted not in names:
            raise ValueError(f"{word}: there is no such material; there are {', '.join(names)}")
        for k, name in enumerate(names):
            if wanted in ("", name):
                yield source._replace(name=f"{path.name}:{name}{suffix}", word=f"{path}:{name}", material=k)
    elif isinstance(loaded, mi.BSDF) and not wanted:
        yield source._replace(name=(name_of(loaded) if is_text else source.name) + suffix)
    else:
        raise ValueError(f"{word if wanted else source.name} is not a {'scene' if wanted else 'BSDF'}")


def is_measured(word: str) -> bool:
    """Return whether a word is the path of a measured file: no XML, and neither a plugin nor a published material."""
    path = Path(word)
    if word in published.names():
        return False
    if word.startswith("<") or ".xml" in word:  # XML, unless it is the name of another file
        return os.path.isfile(word) and path.suffix != ".xml"
    return bool(path.suffix) or path.name != word


def name_of(bsdf: mi.BSDF) -> str:
    """Return the id of a BSDF, or the name of its class, with that of what it contains."""
    inner = " and ".join(_class_of(it) for it in contained(bsdf))
    return bsdf.id() or _class_of(bsdf) + (f" of {inner}" if inner else "")


def value_of(text: str) -> Any:
    """Return a number, true or false, a colour given as #rrggbb (sRGB) or r;g;b (linear), or else a word."""
    if text in ("true", "false"):
        return text == "true"
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        return _rgb(decoded(np.frombuffer(bytes.fromhex(text[1:]), np.uint8) / 255).tolist())
    try:
        colour = [float(part) for part in text.split(";")]
    except ValueError:
        return text
    return _rgb(colour) if len(colour) == 3 else text


def degrees_of(text: str) -> list[float]:
    """Return angles in degrees that are given as 10,40,70.

    Raises:
        ValueError: if they are no numbers.
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"{text}: write degrees, such as 10,40,70") from None


def _rgb(colour: list[float]) -> dict[str, Any]:
    return {"type": "rgb", "value": colour}


def _class_of(bsdf: mi.BSDF) -> str:
    kind = type(bsdf).__name__
    return bsdf.class_name() if kind == "BSDF" else kind


def _distinct(names: list[str]) -> list[str]:
    """Return names with a number for each of those that are alike."""
    several, seen = Counter(names), Counter[str]()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(f"{name} {seen[name]}" if several[name] > 1 else name)
    return numbered


def _materials(scene: mi.Scene) -> list[mi.BSDF]:
    """Return each material of a scene once, without the black ones of lamps and mere boundaries of media. Sort them:
    Mitsuba may merge shapes, in an order that differs each time."""
    found: list[mi.BSDF] = []
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        known = bsdf is None or any(bsdf is other for other in found)
        if not known and bsdf.class_name() != "Null" and not (shape.is_emitter() and _is_black(bsdf)):
            found.append(bsdf)
    return sorted(found, key=lambda bsdf: (name_of(bsdf), str(bsdf)))


def _is_black(bsdf: mi.BSDF) -> bool:
    probe, variates = BSDFProbe(bsdf), random(64, 1)
    sides = (on_side(direction(40), side) for side in (1, -1))
    return not any(probe.weights(probe.whole, wi[None], variates).any() for wi in sides)


def _versioned(text: str) -> str:
    """Return XML whose first element has a version, as Mitsuba demands."""
    head, _, rest = text.partition(">")
    return text if "version=" in head else f'{head.rstrip("/")} version="3.0.0"{"/" * head.endswith("/")}>{rest}'
