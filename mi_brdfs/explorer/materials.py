"""The BSDFs that a page may show: plugins by name, with plain values, and files that were named or uploaded."""

from __future__ import annotations

import os
import re
import shlex
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from ..measured import Grid, Samples, read
from ..mitsuba.errors import one_line
from ..mitsuba.registry import DATA, MODELS, all_models, is_own
from ..model import EnergyWarning
from ..names import check_name
from ..parameters.messages import brief, listed, meant, printable
from ..parameters.published import closest, names, preset
from ..parameters.xml import to_xml
from ..probe.bsdf import BSDFProbe
from ..probe.sources import BSDFSource, measured_file, text_of
from . import controls
from .controls import Control
from .state import GIVEN, MEASURED, PRESET, Bsdf, StateError

BUILT_IN = (
    "conductor", "dielectric", "diffuse", "plastic", "principled", "principledthin", "roughconductor",
    "roughdielectric", "roughplastic", "thindielectric",
)  # fmt: skip
"""Mitsuba's BSDFs that need nothing but numbers and colours."""

BALLS, BALLS_ACROSS = Path(__file__).parent / "client" / "published.jpg", 38
"""The sheet with a ball of each published material, and how many are beside each other."""


@dataclass
class Materials:
    """What a session may load, besides plugins: ``files``, by the names that a page knows them by."""

    files: Mapping[str, BSDFSource] = field(default_factory=dict)
    _loaded: dict[str, mi.BSDF] = field(default_factory=dict)
    """Materials of XML files, which take long to load."""
    _data: dict[tuple[str, Any], Grid | Samples] = field(default_factory=dict)
    """What measured files hold, by their paths and quantities."""

    def forget(self) -> None:
        """Load the materials of XML files again, as models have changed."""
        self._loaded.clear()

    def expanded(self, bsdf: Bsdf) -> Bsdf:
        """Return a plugin dict with what its short forms stand for: a published material, beside which other members
        replace its own, the example of a model of which only the type is given, another number of lobes. Raise a
        StateError if there is no such type, file or material."""
        kind = bsdf["type"]
        if kind == PRESET:
            try:
                published = plain(preset(str(bsdf.get("name", ""))))
            except ValueError as error:
                raise StateError(str(error)) from None
            given = {name: value for name, value in bsdf.items() if name not in ("type", "name")}
            return self.expanded(published | given)
        if kind in (MEASURED, GIVEN):
            self.source(bsdf)
            return bsdf
        if kind in BUILT_IN:
            return bsdf
        if kind in DATA:
            raise StateError(f"{kind} needs a file; give the measured file itself.")
        if kind not in MODELS:
            known = [*MODELS, *BUILT_IN, MEASURED]
            near = meant(kind, known) or closest(kind, names())
            raise StateError(f"There is no BSDF {brief(kind)!r} here" + (f"; did you mean {near!r}?" if near else "."))
        if set(bsdf) == {"type"}:
            return {**plain(MODELS[kind].example()), "type": kind}
        return controls.with_lobes(MODELS[kind], bsdf) if controls.LOBES in bsdf else bsdf

    def source(self, bsdf: Bsdf) -> BSDFSource:
        """Return the file of a plugin dict, or raise a StateError."""
        file = str(bsdf.get("file", ""))
        if file not in self.files:
            raise StateError(f"{brief(file) or 'A file'} is not here: name it on the command line, or drop it in.")
        return self.files[file]

    @contextmanager
    def loaded(self, bsdf: Bsdf) -> Iterator[mi.BSDF]:
        """Load an expanded plugin dict, or raise a StateError with the plugin's sentence. Nothing should keep it:
        Dr.Jit compiles kernels for all BSDFs that live."""
        kind = bsdf["type"]
        values = {name: value for name, value in bsdf.items() if name not in ("type", "file")}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", EnergyWarning)  # the albedo tells
                if kind == GIVEN:
                    source = self.source(bsdf)
                    if source.word not in self._loaded:
                        found = source.load()
                        self._loaded[source.word] = mi.load_dict(found) if isinstance(found, dict) else found
                    kept = self._loaded[source.word]
                    usual = _set(kept, values)
                    try:
                        yield kept
                    finally:
                        mi.traverse(kept).update(usual)
                elif kind == MEASURED:
                    measured: Any = self.source(bsdf).load()
                    yield mi.load_dict({**measured, **properties(values)})
                elif kind in MODELS:
                    yield mi.load_dict(properties(controls.with_defaults(MODELS[kind], bsdf)))
                else:
                    yield _built_in(kind, values)
        except (RuntimeError, ValueError, TypeError) as error:
            raise StateError(one_line(error)) from None

    def data(self, bsdf: Bsdf) -> Grid | Samples | None:
        """Return what the file of an expanded plugin dict holds, if there is one and nothing says how it goes on."""
        if bsdf["type"] != MEASURED or not (file := measured_file(bsdf | {"filename": self.source(bsdf).path})):
            return None
        if file not in self._data:
            self._data[file] = read(*file).data
        return self._data[file]

    def controls(self, bsdf: Bsdf) -> list[Control]:
        """Return the controls of an expanded plugin dict."""
        if bsdf["type"] == MEASURED:
            found = controls.controls_of(DATA[MEASURED], bsdf)
            return [it for it in found if it["name"] != "differentiable"]
        if model := MODELS.get(bsdf["type"]):
            return controls.controls_of(model, bsdf)
        with self.loaded({"type": bsdf["type"], **({"file": bsdf["file"]} if "file" in bsdf else {})}) as usual:
            defaults = {it["name"]: it["value"] for it in controls.traversed(usual, {})}
        with self.loaded(bsdf) as loaded:
            return controls.traversed(loaded, defaults)

    def described(self, bsdf: Bsdf) -> dict[str, list[str]]:
        """Return the names of the components of an expanded plugin dict, and notes about it."""
        with self.loaded(bsdf) as loaded:
            probe = BSDFProbe(loaded)
            return {
                "components": [probe.name_of(i) for i in range(loaded.component_count())],
                "notes": ["anisotropic"] if mi.has_flag(loaded.flags(), mi.BSDFFlags.Anisotropic) else [],
            }

    def written(self, bsdf: Bsdf) -> dict[str, str]:
        """Return an expanded plugin dict as XML, as a Python dict, and as a command."""
        kind = bsdf["type"]
        values = properties({name: value for name, value in bsdf.items() if name not in ("type", "file")})
        if kind == GIVEN:
            word = self.source(bsdf).word
            if not values:
                return {**_remark(word), "command": _command(word)}
            if not (edited := self._edited(bsdf)):
                changed = ", ".join(f"{name} = {text_of(value)}" for name, value in values.items())
                return {**_remark(f"{word}, but with {changed}"), "command": f"{_command(word)}  # but with {changed}"}
            kind, values = edited.pop("type"), edited
        word, named = kind, {"type": kind, **values}
        if kind == MEASURED:
            word = self.source(bsdf).path
            named = {"type": kind, "filename": word, **values}
        options = [text for name, value in values.items() for text in ("-D", f"{name}={text_of(value)}")]
        try:
            check_name(word)
            told = {"xml": to_xml(named), "dict": repr(named)}
        except ValueError as error:
            told = _remark(str(error))
        return {**told, "command": _command(word, *options)}

    def _edited(self, bsdf: Bsdf) -> dict[str, Any]:
        """Return a dict of plain values for a material of a file; none if it is of no model or has other textures."""
        from ..fit.pictures import plugin_dict

        with self.loaded(bsdf) as loaded:
            found = plugin_dict(loaded) if hasattr(loaded, "model") else {}
        return {} if any(isinstance(it, mi.Texture) for it in found.values()) else found


def kinds() -> list[dict[str, str]]:
    """Return the types that a page may add."""
    found = []
    for model in sorted(all_models(), key=lambda it: (not is_own(it), it.plugins)):
        group = "mi_brdfs" if is_own(model) else "guests"
        found.append({"name": model.plugins[0], "title": model.summary().replace("``", "").rstrip("."), "group": group})
    return found + [{"name": name, "title": name, "group": "Mitsuba"} for name in BUILT_IN]


def plain(bsdf: Mapping[str, Any]) -> Bsdf:
    """Return a plugin dict with its colours as [r, g, b] and its numbers as Python's."""
    return {name: _plain(value) for name, value in bsdf.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict) and value.get("type") == "rgb":
        numbers = np.ravel(value.get("value", ())).tolist()
        return numbers * 3 if len(numbers) == 1 else numbers
    return value.item() if isinstance(value, np.generic) else value


def properties(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain values as Mitsuba's dicts have them."""
    return {name: {"type": "rgb", "value": it} if isinstance(it, list) else it for name, it in values.items()}


def _remark(text: str) -> dict[str, str]:
    """Return a comment in place of XML and of a dict."""
    text = printable(text)
    return {"xml": f"<!-- {re.sub('-(?=-)', '- ', text)} -->", "dict": f"# {text}"}


def _command(*words: str) -> str:
    return " ".join(map(_quoted, ["mi-brdfs", "show", *words]))


def _quoted(word: str) -> str:
    """Return a word as a shell takes it, with the bytes of what cannot be printed."""
    if word.isprintable():
        return shlex.quote(word)
    escaped = {it: "".join(f"\\x{byte:02x}" for byte in os.fsencode(it)) for it in word}
    return "$'" + "".join(it if it.isprintable() and it not in "'\\" else escaped[it] for it in word) + "'"


def _built_in(kind: str, values: Bsdf) -> mi.BSDF:
    """Return one of Mitsuba's BSDFs with some values of what ``mitsuba.traverse`` shows: not all are parameters."""
    try:
        return mi.load_dict({"type": kind, **properties(values)})
    except RuntimeError as error:
        loaded = mi.load_dict({"type": kind})
        try:
            _set(loaded, values)
        except TypeError:  # a parameter, with a value that is none of its
            raise error from None
        return loaded


def _set(bsdf: mi.BSDF, values: Bsdf) -> dict[str, Any]:
    """Give a BSDF values, and return those that it had, by their keys."""
    params = mi.traverse(bsdf)
    keys = {controls.key_to_name(key): key for key, _ in params}
    for name in values:
        if name not in keys:
            raise StateError(f"There is no value {name}" + (f"; there are {listed(keys, 'and')}." if keys else "."))
    usual = {keys[name]: type(params[keys[name]])(params[keys[name]]) for name in values}
    try:
        params.update({keys[name]: mi.Color3f(it) if isinstance(it, list) else it for name, it in values.items()})
    except TypeError:  # perhaps not at the first one
        params.update(usual)
        raise
    return usual
