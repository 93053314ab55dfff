"""BSDFs by the words that name them on the command line: plugins, published materials, measured files, XML, the
materials of scene files, fits; each with parameters of its own, as in ``ward:alpha_u=.1,alpha_v=.3``."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from .. import loading
from ..names import check_name, tabulated
from ..parameters import published
from ..parameters.messages import no_file
from ..srgb import decoded
from .bsdf import BSDFProbe, contained, load, shapes_of
from .directions import direction, on_side
from .variates import random

RESERVED = ("path", "string", "parallel", "optimize")
"""The arguments of Mitsuba's functions that load XML, which no parameter of it may be called."""
OWN = re.compile(r":(?=[A-Za-z_]\w*=)")
"""Where the parameters of a word begin."""
FILE = re.compile(r"(.+?\.(?:xml|json))(?::(.+))?", re.DOTALL)
"""The path of XML or of fits, and the material that is named after it."""


class BSDFSource(NamedTuple):
    """A BSDF by name, which any process can load."""

    name: str
    word: str
    """What a user may give for it."""
    source: str
    """The type of a plugin, XML text, or the path of a scene, of fits or of a measured file."""
    material: int | str | None = None
    """Which of the scene's materials, or of its BSDFs by its id, or of the fits."""
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
        if isinstance(self.material, int) and self.source.endswith(".json"):
            return _fits(Path(self.source))[self.material]["bsdf"] | values
        if self.source.endswith(".xml"):
            only = self.material if isinstance(self.material, str) else None
            loaded = loading.load(Path(self.source), self.parameters, only=only)
            return _materials(loaded)[self.material] if isinstance(self.material, int) else loaded
        if self.source.startswith("<"):
            return loading.load_text(self.source, self.parameters)
        return {"type": self.source} | values


def measured_file(given: Mapping[str, Any]) -> tuple[str, Any] | None:
    """Return the path and the quantity of the file of a ``tabulated`` dict, and None for any other, or one that says
    how to extrapolate, as that is to be seen, or is turned, of which tables know nothing."""
    if given.get("type") != "tabulated" or given.keys() & {"extrapolate", "rotation"}:
        return None
    return given["filename"], given.get("quantity", "stated")


def find_sources(word: str, parameters: Mapping[str, str] | None = None) -> Iterator[BSDFSource]:
    """Yield the BSDFs that a word stands for: the type of a plugin, the name of a published material, a ``<bsdf …>`` as
    text, the path of a measured file, which ``tabulated`` renders, the path of a scene, whose materials count once each
    and those of lamps only if they reflect, or any BSDF in it as ``scene.xml:id``, the path of the JSON of fits, or one
    of them as ``fit.json:model``. Parameters are those of the plugin, or the values of the ``<default>`` elements of
    XML; those of the word itself (:func:`split`) go before.

    Raises:
        ValueError: if it stands for none.
        Exception: what Mitsuba raises where it cannot be loaded.
    """
    word, own = split(word)
    if not word:
        raise ValueError("the name of a material is empty: give a plugin, a preset or a file")
    parameters = {**(parameters or {}), **own}
    if not (is_data := is_measured(word)):
        check_name(word)
    path, wanted = _parted(word)
    is_text = word.startswith("<") and not (is_data or path)
    if path and not path.is_file():
        raise ValueError(no_file(path))
    name = Path(word).name if is_data else path.name if path else word
    source = BSDFSource(name, word, str(path or word), None, parameters)
    if path and path.suffix == ".json":
        found = list(_chosen(source, _names_of(_fits(path)), wanted))
        for each, given in zip(found, shared([it.word for it in found], parameters), strict=True):
            fitted = each._replace(name=each.name + _suffix(given), parameters=given)
            load(fitted.load())
            yield fitted
        return
    if (path or is_text) and (reserved := [name for name in RESERVED if name in parameters]):
        raise ValueError(f"-D {reserved[0]}: Mitsuba reserves this name; rename the parameter in the XML")
    loaded = source.load()
    loaded = load(loaded) if isinstance(loaded, dict) else loaded
    if isinstance(loaded, mi.Scene) and path:
        names = _distinct([name_of(bsdf) for bsdf in _materials(loaded)])
        is_hidden = not names or wanted not in ("", *names)
        others = [id for id in loading.ids_of_bsdfs(path, parameters) if id not in names] if is_hidden else []
        if not (names or wanted):
            hint = f"; name one of its BSDFs, as {path}:{others[0]}" if others else ""
            raise ValueError(f"{path}: no shape of the scene has a material{hint}")
        for each in _chosen(source, [*names, *others], wanted):
            chosen = wanted if wanted in others else each.material
            yield each._replace(name=each.name + _suffix(parameters), material=chosen)
    elif isinstance(loaded, mi.BSDF) and not wanted:
        yield source._replace(name=(name_of(loaded) if is_text else source.name) + _suffix(parameters))
    else:
        raise ValueError(f"{word if wanted else source.name} is not a {'scene' if wanted else 'BSDF'}")


def split(word: str) -> tuple[str, dict[str, str]]:
    """Return a word without its own parameters, ``:name=value,name=value`` at its end, and these as text. What is no
    ``name=value`` after a comma belongs to the value before it, as in ``alpha=0.1,0.2``. The name of a file that exists
    has none, nor has what is within XML. Raise a ValueError if a parameter has no value, or two."""
    start = word.rfind(">") + 1 if word.startswith("<") else 0
    found = None if os.path.exists(word) else OWN.search(word, start)
    if found is None:
        return word, {}
    values: dict[str, str] = {}
    for name, value in re.findall(r"(\w+)=(.*?)(?=,\w+=|$)", word[found.end() :], re.DOTALL):
        if not value:
            raise ValueError(f"{word}: write {name}=value")
        if name in values:
            raise ValueError(f"{word}: {name} is given twice")
        values[name] = value
    return word[: found.start()], values


def shared(words: Sequence[str], parameters: Mapping[str, str]) -> list[dict[str, str]]:
    """Return which parameters each of some words gets: those that it declares, and, so that it says what is wrong, each
    that none declares. XML declares its ``<default>`` elements."""
    declared = [{name for name in parameters if len(words) == 1 or _declares(word, name)} for word in words]
    known = set().union(*declared)
    return [{name: parameters[name] for name in parameters if name in own or name not in known} for own in declared]


def _declares(word: str, name: str) -> bool:
    """Return whether a BSDF that a word stands for has a parameter; also if that is seen only where it is loaded."""
    word, _ = split(word)
    path, wanted = _parted(word)
    if path and path.suffix == ".json" and path.is_file():
        fits = _fits(path)
        rows = zip(_names_of(fits), fits, strict=True)
        return any(_has(row["bsdf"], name) for own, row in rows if wanted in ("", own))
    if path or (word.startswith("<") and not is_measured(word)):
        text = path.read_text(encoding="utf-8", errors="replace") if path and path.is_file() else word
        named = re.escape(name)
        return bool(re.search(rf"""\$\{{?{named}\b|<include|<default[^>]+["']{named}["']""", text))
    return _has(BSDFSource(word, word, word).load(), name)


def _has(bsdf: dict[str, Any], name: str) -> bool:
    """Return whether a plugin has a parameter: whether it, or a value of it, is refused as such."""
    try:
        load(bsdf | {name: 0.5})
    except (RuntimeError, TypeError) as error:
        return not re.search("unreferenced|unknown parameter", str(error))
    return True


def is_measured(word: str) -> bool:
    """Return whether a word without parameters of its own is the path of a measured file: neither XML nor fits, and
    neither a plugin nor a published material."""
    path = Path(word)
    if word in published.names():
        return False
    if word.startswith("<") or FILE.fullmatch(word):  # unless it is the name of another file
        return os.path.isfile(word) and path.suffix not in (".xml", ".json")
    return bool(path.suffix) or path.name != word


def name_of(bsdf: mi.BSDF) -> str:
    """Return the id of a BSDF, or the name of its class, with that of what it contains."""
    inner = " and ".join(_class_of(it) for it in contained(bsdf))
    return bsdf.id() or _class_of(bsdf) + (f" of {inner}" if inner else "")


def value_of(text: str) -> Any:
    """Return a number, true or false, a colour given as #rrggbb (sRGB) or r;g;b (linear), or else a word."""
    if text in ("true", "false"):
        return text == "true"
    if "_" in text:  # which Python ignores in numbers
        return text
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


def text_of(value: Any) -> str:
    """Return a number, a boolean, a colour or a word as text that :func:`value_of` takes."""
    if isinstance(value, dict):
        return ";".join(f"{number:.7g}" for number in value["value"])
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else f"{value:.7g}"


def degrees_of(text: str) -> list[float]:
    """Return angles in degrees that are given as 10,40,70, or raise a ValueError."""
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
    """Return each material of a scene once, by name, without the black ones of lamps and mere boundaries of media."""
    found: list[mi.BSDF] = []
    for shape in shapes_of(scene):
        bsdf = shape.bsdf()
        known = any(bsdf is other for other in found)
        if not known and bsdf.class_name() != "Null" and not (shape.is_emitter() and _is_black(bsdf)):
            found.append(bsdf)
    return sorted(found, key=name_of)


def _is_black(bsdf: mi.BSDF) -> bool:
    probe, variates = BSDFProbe(bsdf), random(64, 1)
    sides = (on_side(direction(40), side) for side in (1, -1))
    return not any(probe.weights(probe.whole, wi[None], variates).any() for wi in sides)


def _parted(word: str) -> tuple[Path | None, str]:
    """Return the path of XML or of fits in a word, if that is not text itself, and the material named after it."""
    found = None if is_measured(word) else FILE.fullmatch(word)
    if found is None or (word.startswith("<") and not os.path.isfile(found[1])):
        return None, ""
    return Path(found[1]), found[2] or ""


def _suffix(parameters: Mapping[str, str]) -> str:
    return "".join(f" {name}={value}" for name, value in parameters.items())


def _chosen(source: BSDFSource, names: list[str], wanted: str) -> Iterator[BSDFSource]:
    """Yield the materials of a file, or the one that is wanted."""
    path = Path(source.source)
    if wanted and wanted not in names:
        raise ValueError(f"{path}:{wanted}: there is no such material; there are {', '.join(names)}")
    for k, name in enumerate(names):
        if wanted in ("", name):
            yield source._replace(name=f"{path.name}:{name}", word=f"{path}:{name}", material=k)


def _fits(path: Path) -> list[dict[str, Any]]:
    """Return the fits that ``mi-brdfs fit --json`` wrote, or raise a ValueError."""
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        words = [word for it in rows for word in (it["bsdf"]["type"], it["model"], it["file"])]
        if words and all(isinstance(word, str) and word for word in words):
            return rows
    except (ValueError, TypeError, KeyError, RecursionError):
        pass
    raise ValueError(f"{path}: it holds no fits, as mi-brdfs fit --json writes them")


def _names_of(fits: list[dict[str, Any]]) -> list[str]:
    """Return the names of fits: their models, after the names of the files if there are several."""
    several = len({it["file"] for it in fits}) > 1
    return _distinct([f"{Path(it['file']).stem}/{it['model']}" if several else it["model"] for it in fits])
