"""Scene files as Mitsuba 0.6 read them: elements with their lines, colours, includes, and parameters."""

from __future__ import annotations

import importlib
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from ..srgb import decoded
from .tables import PLUGINS, Entry

MOST_ELEMENTS, DEEPEST, MOST_FILES, LONGEST, MOST_PARAMETERS = 1_000_000, 60, 1000, 100_000, 100
"""Bounds of what includes and parameters may multiply: elements, their nesting, the files read, the letters of an
attribute, and the parameters in it."""


@dataclass(eq=False)
class Element:
    """An element of a scene. The names of its properties are in snake_case."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    """Those beside the following four, which are empty where they are not given."""
    children: list[Element] = field(default_factory=list)
    type: str = ""
    id: str = ""
    name: str = ""
    value: str = ""
    place: str = ""
    """The file and the line that it comes from."""
    scale: list[float] = field(default_factory=lambda: [1.0])
    """Of a texture, what it is multiplied by, which Mitsuba 3 has no plugin for."""

    def __getitem__(self, name: str) -> Element | None:
        """Return the property of a name, of several the last, as 0.6 does."""
        return next((child for child in reversed(self.children) if child.name == name), None)

    def pop(self, *names: str) -> Element | None:
        """Take out the properties of some names, and return the last of them."""
        found = [child for child in self.children if child.name in names]
        self.children = [child for child in self.children if child.name not in names]
        return found[-1] if found else None

    def put(self, child: Element) -> None:
        """Give a property, in place of those of its name."""
        self.pop(child.name)
        self.children.append(child)

    def set(self, name: str, value: Any) -> None:
        """Give a property a value."""
        self.put(prop(name, value))

    def text(self, name: str) -> str:
        """Return the value of a property in lower case."""
        return (self[name] or Element("")).value.strip().lower()

    def number(self, name: str, default: float) -> float:
        """Return the value of a number, and the default for a texture."""
        found = self[name]
        return found.numbers(1)[0] if found and found.tag in ("float", "integer") else default

    @property
    def entry(self) -> Entry:
        """What its plugin is in Mitsuba 3."""
        return PLUGINS.get(self.tag, {}).get(self.type, Entry("", ""))

    def numbers(self, *counts: int, text: str = "") -> list[float]:
        """Return the finite numbers in its value, or in another text, as many as one of the counts says, if any."""
        text = text or self.value
        with suppress(ValueError):
            numbers = floats(text)
            if all(map(math.isfinite, numbers)) and (not counts or len(numbers) in counts):
                return numbers
        wanted = f"{' or '.join(map(str, counts)) or 'a list of'} finite numbers"
        raise self.error(f"{text!r} is not {'a finite number' if counts == (1,) else wanted}")

    def to_world(self) -> Element:
        """Return its transform, which it is given if it has none."""
        transform = self["to_world"] or Element("transform", name="to_world")
        self.put(transform)
        return transform

    def error(self, text: str) -> ValueError:
        """Return an error that says what is wrong with it."""
        return ValueError(f"{self.place}: {f'{self.tag} {self.type or self.name}'.strip()}: {text}.")

    def copy(self, name: str) -> Element:
        """Return a copy with another name and without ids, which stay with the original."""
        children = [it.copy(it.name) for it in self.children]
        return replace(self, name=name, id=self.id if self.tag == "ref" else "", children=children)

    def of(self, *tags: str) -> list[Element]:
        """Return the children of some tags."""
        return [child for child in self.children if child.tag in tags]

    def walk(self) -> Iterator[Element]:
        """Yield it and all that is in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def to_xml(self, margin: str = "") -> str:
        """Return it as XML."""
        given = {"type": self.type, "id": self.id, "name": self.name, "value": self.value} | self.attributes
        start = margin + "<" + " ".join([self.tag, *(f"{key}={quoteattr(it)}" for key, it in given.items() if it)])
        inner = "".join(child.to_xml(margin + "    ") for child in self.children)
        return f"{start}>\n{inner}{margin}</{self.tag}>\n" if inner else f"{start}/>\n"


def prop(name: str, value: Any) -> Element:
    """Return a property of the type that its value has; a list is a colour."""
    tags = {bool: "boolean", int: "integer", float: "float", str: "string", list: "rgb"}
    return Element(tags[type(value)], name=name, value=written(value))


def plugin(kind: str, type: str, *children: Element, **properties: Any) -> Element:
    """Return a plugin with some properties."""
    return Element(kind, type=type, children=[*(prop(*it) for it in properties.items()), *children])


def floats(text: str) -> list[float]:
    return [float(number) for number in re.split(r"[,;\s]+", text.strip(",; \t\n"))]


def written(value: Any) -> str:
    """Return a value as an attribute."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.9g}"
    return ", ".join(map(written, value)) if isinstance(value, list) else str(value)


def rgb_of(element: Element, folder: Path) -> list[float]:
    """Return the channels of an ``<rgb>``, ``<srgb>``, ``<spectrum>`` or ``<blackbody>``, one if all are the same."""
    text, light = element.value.strip(", \t\n"), None
    try:
        if element.tag == "blackbody":
            kelvin = float(element.attributes.get("temperature", "").strip().rstrip("Kk"))
            light = _blackbody(kelvin, float(element.attributes.get("scale", 1)))
        elif "filename" in element.attributes:
            if not (path := folder / element.attributes["filename"]).is_file():  # a pipe would never end
                raise ValueError(f"there is no file {path}")
            light = np.loadtxt(path, usecols=(0, 1), ndmin=2, encoding="utf-8").T
        elif ":" in text:
            pairs = [pair.split(":") for pair in re.split(r"[,\s]+(?=\S)", re.sub(r"\s*:\s*", ":", text))]
            light = np.array(pairs, float).T
        elif re.fullmatch(r"#[0-9a-fA-F]{6}", text):
            rgb = [byte / 255 for byte in bytes.fromhex(text[1:])]
        else:
            rgb = floats(text)
        if light is not None:  # linear between its wavelengths in nm and 0 beyond; Y is the mean under the observer's
            if not (np.diff(light[0]) > 0).all():
                raise ValueError("wavelengths must increase")
            scalar = importlib.import_module("mitsuba.scalar_rgb")  # whose functions compute without kernels
            rgb = [float(v) for v in scalar.spectrum_list_to_srgb(*light, bounded=False, d65=False)]
    except (ValueError, OSError, RuntimeError) as error:
        raise element.error(f"it has no colour that can be read: {error}") from None
    if len(rgb) not in (1, 3) or not np.isfinite(rgb).all():
        raise element.error(f"{element.value!r} has not one or three numbers")
    return decoded(rgb).tolist() if element.tag == "srgb" else rgb


def _blackbody(kelvin: float, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return wavelengths in nm and Planck's radiance in W/(m² sr nm)."""
    h, c, k = 6.62607015e-34, 299792458.0, 1.380649e-23
    if not kelvin > 0:
        raise ValueError("its temperature must be above 0 K")
    wavelengths = np.arange(360.0, 831.0)
    metres = wavelengths * 1e-9
    with np.errstate(over="ignore"):  # of the cold ones, whose light is 0
        return wavelengths, scale * 1e-9 * 2 * h * c**2 / (metres**5 * np.expm1(h * c / (metres * k * kelvin)))


def root_of(path: Path) -> tuple[str, dict[str, str]]:
    """Return the tag and the attributes of a file's root, nothing if it is no XML."""
    with open(path, "rb") as file, suppress(ET.ParseError, LookupError, ValueError):
        for _, root in ET.iterparse(file, ["start"]):
            return root.tag, root.attrib
    return "", {}


class Reader:
    """Reads elements in the order of the document, as what ``<default>`` says holds from there on."""

    def __init__(self, scene: Path, values: Mapping[str, str], lenient: bool) -> None:
        self.scene, self.values, self.lenient = scene, dict(values), lenient
        self.used: set[str] = set()
        self.count = self.files = 0
        self.reading: list[Path] = []

    def read(self, path: Path) -> Element:
        """Return the ``<scene>`` of a file, with its includes in their places and the values of its parameters."""
        if path.resolve() in self.reading:
            raise ValueError(f"{path}: the file includes itself.")
        self.reading.append(path.resolve())
        self.files += 1
        if self.files > MOST_FILES:
            raise ValueError(f"{path}: the scene includes more than {MOST_FILES} files.")
        parser = expat.ParserCreate()
        open_: list[Element] = [Element("")]

        def start(tag: str, attributes: dict[str, str]) -> None:
            place = f"{path.name}:{parser.CurrentLineNumber}"
            self.count += 1
            if self.count > MOST_ELEMENTS or len(open_) > DEEPEST:
                raise ValueError(f"{place}: the scene has more than {MOST_ELEMENTS} elements, or {DEEPEST} in another.")
            given = {name: self._substituted(value, place) for name, value in attributes.items()}
            type, id, name, value = (given.pop(key, "") for key in ("type", "id", "name", "value"))
            if tag != "default":  # intIOR is int_ior
                name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.strip()).lower()
            element = Element(tag.replace("lookAt", "lookat"), given, [], type.strip().lower(), id, name, value, place)
            open_[-1].children.append(element)
            open_.append(element)

        def end(tag: str) -> None:
            element, siblings = open_.pop(), open_[-1].children
            if tag == "default":
                siblings.pop()
                self.values.setdefault(element.name, element.value)
            elif tag == "include" and (found := self._found(element, path)):
                siblings.pop()
                siblings += self.read(found).children

        def refuse(*_: Any) -> None:
            raise ValueError(f"{path}: a scene has no DOCTYPE; take it out.")

        parser.StartElementHandler, parser.EndElementHandler = start, end
        parser.StartDoctypeDeclHandler = refuse
        try:
            parser.Parse(path.read_bytes(), True)
        except (expat.ExpatError, LookupError) as error:
            raise ValueError(f"{path}: no well-formed XML: {error}.") from None
        self.reading.pop()
        root = open_[0].children[0]
        if root.tag != "scene":
            raise ValueError(f"{path}: the file has a <{root.tag}>, no <scene>.")
        return root

    def _substituted(self, value: str, place: str) -> str:
        """Return an attribute with the values of the parameters, the longest name first."""

        def valued(found: re.Match) -> str:
            rest = found[1]
            if name := next((rest[:k] for k in range(len(rest), 0, -1) if rest[:k] in self.values), ""):
                self.used.add(name)
            elif (word := re.match(r"\w+", rest)) and "[" not in value:  # as labels of films have it
                raise ValueError(f"{place}: the parameter {word[0]} has no value; give it one (-D {word[0]}=VALUE).")
            return self.values[name] + rest[len(name) :] if name else found[0]

        few = value.count("$") <= MOST_PARAMETERS and len(value) <= LONGEST
        if not few or len(value := re.sub(r"\$([^$]{1,99})", valued, value)) > LONGEST:
            raise ValueError(f"{place}: an attribute has more than {LONGEST} letters, or {MOST_PARAMETERS} parameters.")
        return value

    def _found(self, include: Element, path: Path) -> Path | None:
        name = include.attributes.get("filename", "")
        found = [it for folder in (self.scene.parent, path.parent) if name and os.path.isfile(it := folder / name)]
        if not found and not self.lenient:
            raise ValueError(f"{include.place}: there is no file {name} to include.")
        return next(iter(found), None)
