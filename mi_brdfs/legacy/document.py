"""Scene files as Mitsuba 0.6 read them: elements with their lines, includes, and parameters."""

from __future__ import annotations

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

from .tables import PLUGINS

OBJECTS = {*PLUGINS, "camera", "luminaire"}
"""The elements that are plugins; the last two are those of 0.3."""

MOST_ELEMENTS, DEEPEST, LONGEST, MOST_FILES = 1_000_000, 60, 100_000, 1000
"""Bounds of the number of elements, of their nesting, of the length of an attribute, and of the files read, which
includes and parameters may multiply."""


def _attribute(name: str) -> property:
    return property(
        lambda self: self.attributes.get(name, ""), lambda self, value: self.attributes.update({name: value})
    )


@dataclass(eq=False)
class Element:
    """An element of a scene. The names of its properties are in snake_case."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)
    place: str = ""
    """The file and the line that it comes from."""
    scale: list[float] = field(default_factory=lambda: [1.0])
    """Of a texture, what it is multiplied by, which Mitsuba 3 has no plugin for."""

    type, name, value = _attribute("type"), _attribute("name"), _attribute("value")

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
        return float(found.value if found and found.tag in ("float", "integer") else default)

    @property
    def label(self) -> str:
        return self.name or self.type or self.tag

    def numbers(self, *counts: int, name: str = "value") -> list[float]:
        """Return the finite numbers of an attribute, as many as one of the counts says, if there are any."""
        text = self.attributes.get(name, "")
        with suppress(ValueError):
            numbers = floats(text)
            if all(map(math.isfinite, numbers)) and (not counts or len(numbers) in counts):
                return numbers
        words = {(): "a list of finite numbers", (1,): "a finite number"}
        wanted = words.get(counts, f"{' or '.join(map(str, counts))} finite numbers")
        raise self.error(f"{text!r} is not {wanted}")

    def to_world(self) -> Element:
        """Return its transform, which it is given if it has none."""
        transform = self["to_world"] or Element("transform", {"name": "to_world"})
        self.put(transform)
        return transform

    def error(self, text: str) -> ValueError:
        """Return an error that says what is wrong with it."""
        return ValueError(f"{self.place}: {f'{self.tag} {self.type or self.name}'.strip()}: {text}.")

    def copy(self, name: str) -> Element:
        """Return a copy with another name and without an id, which stays with the original."""
        given = {**self.attributes, "name": name}
        kept = {key: value for key, value in given.items() if value and (key != "id" or self.tag == "ref")}
        return replace(self, attributes=kept, children=[*self.children])

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


def prop(name: str, value: Any) -> Element:
    """Return a property of the type that its value has; a list is a colour."""
    tags = {bool: "boolean", int: "integer", float: "float", str: "string", list: "rgb"}
    return Element(tags[type(value)], {"name": name, "value": written(value)})


def plugin(kind: str, type: str, *children: Element, **properties: Any) -> Element:
    """Return a plugin with some properties."""
    return Element(kind, {"type": type}, [*(prop(*it) for it in properties.items()), *children])


def floats(text: str) -> list[float]:
    return [float(number) for number in re.split(r"[,\s]+", text.strip(", \t\n"))]


def written(value: Any) -> str:
    """Return a value as an attribute."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.9g}"
    return ", ".join(map(written, value)) if isinstance(value, list) else str(value)


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
        self.lengths = set(map(len, values))
        """Of the parameters' names."""
        self.missing: list[Element] = []
        """Includes whose files are missing, if ``lenient``."""
        self.used: set[str] = set()
        self.count = self.files = 0
        self.reading: list[Path] = []

    def read(self, path: Path) -> Element:
        """Return the ``<scene>`` of a file, with its includes in their places and the values of its parameters.

        Raises:
            ValueError: if it is none, in a sentence that names file and line.
            OSError: if a file cannot be read.
        """
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
            attributes = {name: self._substituted(value, place) for name, value in attributes.items()}
            element = Element({"lookAt": "lookat"}.get(tag, tag), attributes, place=place)
            if "name" in attributes and tag not in ("default", "scene"):
                element.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", element.name.strip()).lower()  # intIOR: int_ior
            if tag in OBJECTS:
                element.type = element.type.strip().lower()
            open_[-1].children.append(element)
            open_.append(element)

        def end(tag: str) -> None:
            element = open_.pop()
            if tag == "default":
                self.values.setdefault(element.name, element.value)
                self.lengths.add(len(element.name))
            elif tag == "include" and (found := self._found(element, path)):
                open_[-1].children += self.read(found).children
            if tag in ("default", "include"):
                open_[-1].children.remove(element)

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
        first, *parts = value.split("$")
        found, length, lengths = [first], len(first), sorted(self.lengths, reverse=True) if parts else []
        for part in parts:
            name = next((part[:k] for k in lengths if part[:k] in self.values), "")
            self.used |= {name} if name else set()
            found.append(self.values[name] + part[len(name) :] if name else f"${part}")
            length += len(found[-1])
            if length > LONGEST:
                break
        if length > LONGEST:
            raise ValueError(f"{place}: an attribute has more than {LONGEST} letters.")
        value = "".join(found)
        if (missing := re.search(r"\$(\w+)", value)) and "[" not in value:  # as labels of films have it
            raise ValueError(f"{place}: the parameter {missing[1]} has no value; give it one (-D {missing[1]}=VALUE).")
        return value

    def _found(self, include: Element, path: Path) -> Path | None:
        name = include.attributes.get("filename", "")
        for folder in (self.scene.parent, path.parent):
            if name and os.path.isfile(folder / name):
                return folder / name
        if not self.lenient:
            raise ValueError(f"{include.place}: there is no file {name} to include.")
        self.missing.append(include)
        return None
