"""Scene files as Mitsuba 0.6 read them: elements with their lines, includes, and parameters."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

OBJECTS = {
    "bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor", "shape", "subsurface",
    "texture", "volume", "camera", "luminaire",
}  # fmt: skip
"""The elements that are plugins; the last two are those of 0.3."""

MOST_ELEMENTS, DEEPEST, LONGEST = 1_000_000, 60, 100_000
"""Bounds of the number of elements, of their nesting, and of the length of an attribute, which includes and parameters
may multiply."""


@dataclass(eq=False)
class Element:
    """An element of a scene. The names of its properties are in snake_case."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)
    place: str = ""
    """The file and the line that it comes from."""
    scale: list[float] | None = None
    """Of a texture, what it is multiplied by, which Mitsuba 3 has no plugin for."""

    @property
    def type(self) -> str:
        return self.attributes.get("type", "")

    @type.setter
    def type(self, type: str) -> None:
        self.attributes["type"] = type

    @property
    def name(self) -> str:
        return self.attributes.get("name", "")

    @property
    def value(self) -> str:
        return self.attributes.get("value", "")

    def __contains__(self, name: str) -> bool:
        return any(child.name == name for child in self.children)

    def __getitem__(self, name: str) -> Element | None:
        """Return the property of a name, of several the last, as 0.6 does."""
        return next((child for child in reversed(self.children) if child.name == name), None)

    def pop(self, *names: str) -> Element | None:
        """Take out the properties of some names, and return the last of them."""
        found = [child for child in self.children if child.name in names]
        self.children = [child for child in self.children if child.name not in names]
        return found[-1] if found else None

    def text(self, name: str, default: str = "") -> str:
        """Return the value of a property in lower case."""
        found = self[name]
        return found.value.strip().lower() if found else default

    def number(self, name: str, default: float) -> float:
        """Return the value of a number, and the default for a texture."""
        found = self[name]
        return float(found.value) if found and found.tag in ("float", "integer") else default

    def set(self, tag: str, name: str, value: Any) -> None:
        """Give a property, in place of those of its name."""
        self.pop(name)
        self.children.append(Element(tag, {"name": name, "value": written(value)}))

    def of(self, *tags: str) -> list[Element]:
        """Return the children of some tags."""
        return [child for child in self.children if child.tag in tags]

    def walk(self) -> Iterator[Element]:
        """Yield it and all that is in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def to_xml(self) -> str:
        """Return it as XML."""
        root = self._tree()
        ET.indent(root, "    ")
        return ET.tostring(root, encoding="unicode") + "\n"

    def _tree(self) -> ET.Element:
        tree = ET.Element(self.tag, self.attributes)
        tree.extend([child._tree() for child in self.children])
        return tree


def written(value: Any) -> str:
    """Return a value as an attribute."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.9g}"
    return ", ".join(map(written, value)) if isinstance(value, (list, tuple)) else str(value)


def snake_case(name: str) -> str:
    """Return a name of 0.6 as Mitsuba 3 writes it: ``int_ior`` for ``intIOR``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.strip()).lower()


def root_of(path: Path) -> tuple[str, dict[str, str]]:
    """Return the tag and the attributes of a file's root, nothing if it is no XML."""
    found: list[tuple[str, dict[str, str]]] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, attributes: found.append((tag, attributes))
    with open(path, "rb") as file, suppress(expat.ExpatError, LookupError):
        while not found and (part := file.read(65536)):
            parser.Parse(part)
    return found[0] if found else ("", {})


def read_document(path: Path, given: Mapping[str, str], lenient: bool) -> tuple[Element, list[tuple[str, str]]]:
    """Return the ``<scene>`` of a file, with its includes in their places and the values of its parameters, and places
    and names of includes that are missing, if ``lenient``.

    Raises:
        ValueError: if it is none, in a sentence that names file and line.
        OSError: if a file cannot be read.
    """
    reader = _Reader(path, given, lenient)
    root = reader.read(path)
    if unused := [name for name in given if name not in reader.used]:
        raise ValueError(f"{path}: the scene has no parameter {unused[0]}.")
    return root, reader.missing


class _Reader:
    """Reads elements in the order of the document, as what ``<default>`` says holds from there on."""

    def __init__(self, scene: Path, given: Mapping[str, str], lenient: bool) -> None:
        self.scene, self.values, self.lenient = scene, dict(given), lenient
        self.missing: list[tuple[str, str]] = []
        self.used: set[str] = set()
        self.count = 0
        self.reading: list[Path] = []

    def read(self, path: Path) -> Element:
        if path.resolve() in self.reading:
            raise ValueError(f"{path}: the file includes itself.")
        self.reading.append(path.resolve())
        parser = expat.ParserCreate()
        open_: list[Element] = [Element("")]

        def start(tag: str, attributes: dict[str, str]) -> None:
            place = f"{path.name}:{parser.CurrentLineNumber}"
            self.count += 1
            if self.count > MOST_ELEMENTS or len(open_) > DEEPEST:
                raise ValueError(f"{place}: the scene has more than {MOST_ELEMENTS} elements, or {DEEPEST} in another.")
            attributes = {name: self._substituted(value, place) for name, value in attributes.items()}
            element = Element({"lookAt": "lookat"}.get(tag, tag), attributes, place=place)
            if "name" in attributes and tag not in ("default", "scene"):
                attributes["name"] = snake_case(attributes["name"])
            if tag in OBJECTS:
                element.type = element.type.strip().lower()
            open_[-1].children.append(element)
            open_.append(element)

        def end(tag: str) -> None:
            element = open_.pop()
            if tag not in ("default", "include"):
                return
            open_[-1].children.pop()
            if tag == "default":
                self.values.setdefault(element.name, element.value)
                return
            if found := self._found(element, path):
                open_[-1].children += self.read(found).children

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
        if "$" in value:
            for name in sorted(self.values, key=len, reverse=True):
                if f"${name}" in value:
                    self.used.add(name)
                    value = value.replace(f"${name}", self.values[name])
        if len(value) > LONGEST:
            raise ValueError(f"{place}: an attribute has more than {LONGEST} letters.")
        if (missing := re.search(r"\$(\w+)", value)) and "[" not in value:  # as labels of films have it
            raise ValueError(f"{place}: the parameter {missing[1]} has no value; give it one (-D {missing[1]}=VALUE).")
        return value

    def _found(self, include: Element, path: Path) -> Path | None:
        name = include.attributes.get("filename", "")
        for folder in (self.scene.parent, path.parent):
            if name and os.path.isfile(folder / name):
                return folder / name
        if self.lenient:
            self.missing.append((include.place, name))
            return None
        raise ValueError(f"{include.place}: there is no file {name} to include.")
