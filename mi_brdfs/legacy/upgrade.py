"""Scenes of Mitsuba 0.2 to 0.6 as scenes of Mitsuba 3, with a report of what changed."""

from __future__ import annotations

import importlib
import os
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from functools import partialmethod
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import mitsuba as mi
import numpy as np

from .document import OBJECTS, Element, Reader, plugin, prop, root_of
from .rules import RULES, colours
from .sheets import modernize
from .spectra import rgb_of
from .tables import PLUGINS

PROPERTIES = ("float", "integer", "boolean", "string", "point", "vector", "transform")
PLACES = ("point", "vector", "transform")
COUNTS: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("x", "y", "z", "angle"), (1,)), **dict.fromkeys(("origin", "target", "up"), (3,)), "value": (),
}  # fmt: skip
"""How many numbers the attributes of these have; a matrix has 16."""
COLOURS = ("rgb", "srgb", "spectrum", "blackbody")
NUMBERS = ("alpha", "alpha_u", "alpha_v", "exponent", "opacity", "weight")
"""Properties that Mitsuba 3 reads of a texture as numbers."""
STAND_INS = {"shape": "cube", "emitter": "constant", "volume": "constvolume", "texture": "grey"}
"""What takes the place of plugins whose files are missing."""
Kind = Literal["changed", "approximated", "dropped", "replaced"]
KINDS: tuple[Kind, ...] = get_args(Kind)


class Change(NamedTuple):
    """A change, and where in the old scene it was made: ``FILE:LINE``."""

    place: str
    kind: Kind
    """``changed`` keeps the meaning, ``approximated`` does not quite, ``dropped`` is left out, and ``replaced`` is a
    stand-in for a file that is missing."""
    text: str


@dataclass
class Upgraded:
    """An upgraded scene."""

    version: str
    """The version that it had."""
    xml: str
    """The scene of Mitsuba 3; as it was, if it is one."""
    changes: list[Change] = field(default_factory=list)

    def summary(self) -> str:
        """Return how many changes of each kind there are."""
        counts = {kind: sum(change.kind == kind for change in self.changes) for kind in KINDS}
        return ", ".join(f"{count} {kind}" for kind, count in counts.items() if count) or "nothing changed"

    def report(self) -> str:
        """Return the changes, one a line, those that are the same together, with their places."""
        places: dict[tuple[str, str], list[str]] = {}
        for change in self.changes:
            places.setdefault((change.kind, change.text), []).append(change.place)
        return "\n".join(f"{kind}: {text} ({', '.join(dict.fromkeys(at))})" for (kind, text), at in places.items())


def upgrade(path: str | os.PathLike, *, lenient: bool = False, folder: str | os.PathLike | None = None,
            **parameters: Any) -> Upgraded:  # fmt: skip
    """Return a scene file of Mitsuba 0.2 to 0.6 as one of Mitsuba 3; one of Mitsuba 3 as it is.

    It gives the values that 0.6 gave: colours as linear sRGB, BSDFs scaled down where they would gain energy, emitters
    whose channels are equal. What has no successor is approximated or dropped, and the report says so.

    Args:
        path: the file.
        lenient: put stand-ins in the place of meshes, textures and volumes that are missing: cubes and grey.
        folder: where the new scene will lie, to which its file names are relative; by default where the old one does.
        parameters: the values of its ``<default>`` parameters, which are written out.

    Raises:
        ValueError: in a sentence with file and line, if the file is no scene or files are missing.
        OSError: if a file cannot be read.
    """
    path = Path(path)
    if is_new(path):
        try:
            text = path.read_text(encoding="utf-8")
            tree = ET.fromstring(text.encode())
        except (ET.ParseError, LookupError, ValueError) as error:
            raise ValueError(f"{path}: no well-formed XML in UTF-8: {error}.") from None
        version = tree.get("version", "").strip()
        if tree.tag != "scene" or not re.fullmatch(r"[\d.]+", version):
            raise ValueError(f"{path}: the file has a <{tree.tag}> of version {version!r}, no scene of Mitsuba.")
        return Upgraded("3", text)
    reader = Reader(path, {name: str(value) for name, value in parameters.items()}, lenient)
    root = reader.read(path)
    if unused := [name for name in parameters if name not in reader.used]:
        raise ValueError(f"{path}: the scene has no parameter {unused[0]}.")
    is_old = any(it.tag in ("camera", "luminaire") for it in root.walk())
    version = root.attributes.get("version", "0.2.0" if is_old else "0.6.0").strip()
    if not (found := re.fullmatch(r"0\.([0-6])(\.\d+)*", version)):
        raise ValueError(f"{path}: version {version} is none of 0.2 to 0.6.")
    work = Work(path, lenient, Path(folder) if folder is not None else path.parent)
    for include in reader.missing:
        work.dropped(include, f"the include {include.attributes.get('filename', '')}, which is missing")
    scene = work.scene(root, int(found[1]))
    return Upgraded(version, scene.to_xml(), work.changes)


def is_new(path: Path) -> bool:
    """Return whether a file is a scene of Mitsuba 2 or 3, or none, of which Mitsuba knows what to say."""
    tag, attributes = root_of(path)
    return tag != "scene" or attributes.get("version", "0").strip()[:1] not in "01"


class Work:
    """The upgrade of one scene, from the parts to the whole."""

    def __init__(self, path: Path, lenient: bool, folder: Path) -> None:
        self.path, self.lenient, self.folder = path, lenient, folder
        self.changes: list[Change] = []
        self.ids: dict[str, Element | None] = {}
        """What became of the elements with an id; None of those that were left out."""
        self.missing: list[str] = []
        self.has_media = False

    def said(self, kind: Kind, element: Element, text: str) -> None:
        self.changes.append(Change(element.place or self.path.name, kind, text))

    changed = partialmethod(said, "changed")
    approximated = partialmethod(said, "approximated")
    dropped = partialmethod(said, "dropped")

    def resolved(self, element: Element) -> Element:
        """Return what a reference refers to, or the element itself."""
        return (element.tag == "ref" and self.ids.get(element.attributes.get("id", ""))) or element

    def scene(self, root: Element, minor: int) -> Element:
        modernize(root, minor, self.changed)
        self._complete(root)
        self.has_media = any(it.tag == "medium" for it in root.walk())
        scene = Element("scene", {"version": "3.0.0"}, self._parts(root))
        used = {it.attributes.get("id") for it in scene.walk() if it.tag == "ref"}
        for texture in scene.of("texture"):
            if texture.type == "checkerboard" and texture.attributes.get("id") not in used:
                scene.children.remove(texture)  # whose colours may be above 1
                self.changed(texture, "a checkerboard is written where it is used, if it is")
        for extra in scene.of(*PROPERTIES):
            scene.children.remove(extra)
            self.dropped(extra, f"{extra.name} of the scene, which Mitsuba 3 does not have")
        if len(sensors := scene.of("sensor")) > 1:
            scene.children.remove(sensors[-1])
            scene.children.insert(scene.children.index(sensors[0]), sensors[-1])
            self.changed(root, "of several sensors the last, which 0.6 uses, is the first")
        if self.missing:
            first = self.missing[0] + f", and {len(self.missing) - 1} more" * (len(self.missing) > 1)
            raise ValueError(f"{first}; put the files there, or let stand-ins take their place (--lenient).")
        return scene

    def _complete(self, root: Element) -> None:
        """Add what 0.6 supplies by itself."""
        if not root.of("integrator"):
            root.children.insert(0, plugin("integrator", "direct"))
            self.changed(root, "a scene without an integrator has direct")
        for extra in root.of("integrator")[:-1]:
            root.children.remove(extra)
            self.dropped(extra, "an integrator before another one")
        if not root.of("sensor"):
            self.dropped(root, "a scene without a sensor has none: 0.6 sees all of it along z")
        if not any(it.tag == "emitter" for it in root.walk()):
            turn = Element("transform", {"name": "to_world"}, [Element("rotate", {"y": "1", "angle": "-120"})])
            root.children.append(plugin("emitter", "sunsky", turn, scale=2.0))
            self.changed(root, "a scene without an emitter has sun and sky")

    def _parts(self, element: Element) -> list[Element]:
        return [it for child in element.children if (it := self._part(child)) is not None]

    def _part(self, element: Element) -> Element | None:
        id, name = element.attributes.get("id", ""), element.name
        if element.tag in ("null", "alias"):
            self.ids[element.attributes.get("as", id)] = self.ids.get(id)
            return None
        if element.tag == "ref":
            return self._reference(element)
        if element.tag in COLOURS:
            if element.tag != "rgb" or element.value.strip().startswith("#"):
                self.changed(element, f"<{element.tag}> is written as linear <rgb>, as 0.6 reads it")
            return replace(prop(name, rgb_of(element, self.path.parent)), place=element.place)
        if element.tag == "animation":
            self.approximated(element, "an animated transform is its first one")
            return next((replace(it, attributes={"name": name}) for it in element.of("transform")), None)
        if element.tag in ("float", "integer"):
            element.numbers(1)
            element.value = element.value.strip(", \t\n")
        for it in element.walk() if element.tag in PLACES else ():
            for name in it.attributes.keys() & COUNTS.keys():
                it.numbers(*((16,) if (it.tag, name) == ("matrix", "value") else COUNTS[name]), name=name)
        if element.tag in PROPERTIES:
            return element
        if element.tag not in PLUGINS:
            self.dropped(element, f"<{element.tag}>, which Mitsuba does not have")
            return None
        result = self._object(element)
        if result is not element:  # which may be in it
            element.attributes.pop("id", None)
            element.attributes.pop("name", None)
        if id:
            self.ids[id] = result and self.resolved(result)
        if result is None or (result.tag in COLOURS and not name):  # a colour that only references need
            return None
        if id and result.tag in OBJECTS:
            result.attributes.setdefault("id", id)
        if name:
            result.name = name
        return result

    def _reference(self, element: Element) -> Element | None:
        id = element.attributes.get("id", "")
        if id not in self.ids:
            raise element.error(f"there is no {id!r} before this reference")
        target = self.ids[id]
        if target is None:
            self.dropped(element, "references to what has no successor")
            return None
        # What became a colour has no id, and what is scaled differs from what others refer to.
        if target.tag not in OBJECTS or target.scale != [1.0]:
            return target.copy(element.name)
        name = {"name": element.name} if element.name else {}
        element.attributes = {"id": target.attributes["id"]} | name
        return element

    def _object(self, element: Element) -> Element | None:
        """Return what a plugin becomes, or None."""
        was = element.type
        element.children = self._parts(element)
        self._sort_names(element)
        if self._is_missing(element):
            if element.tag == "texture":
                return prop(element.name, [0.5])
            element.type = STAND_INS[element.tag]
        if (element.tag, element.type) not in RULES and (succeeded := self._succeeded(element)) is not element:
            return succeeded
        rule = RULES.get((element.tag, element.type))
        result = (rule(self, element) if rule else None) or element
        entries = [PLUGINS[element.tag].get(type) for type in (was, element.type)]
        supplied = next((it.supplied for it in entries if it and it.type == element.type), {})
        for name in [name for name in supplied if name not in element]:
            element.set(name, supplied[name])
        held = {self.resolved(it).tag for it in element.children}
        if element.tag == "shape" and "medium" in held and not held & {"bsdf", "emitter"}:
            element.children.append(plugin("bsdf", "null"))
        if element.tag == "sensor" and "to_world" in element:
            _normalize(element.to_world())
        for it in result.walk():
            self._clean(it, was)
        return result

    def _sort_names(self, element: Element) -> None:
        """Give properties their names in Mitsuba 3, and leave out those that a later one of the same name replaces, or
        a texture at any place."""
        entry = PLUGINS[element.tag].get(element.type)
        names = entry.renamed if entry else {}
        for child in element.of(*PROPERTIES, *COLOURS, "texture", "ref", "volume"):
            if child.name in names:
                self.changed(child, f"{child.name} of {element.type} is {names[child.name]}")
                if names[child.name] in element and child.tag not in ("texture", "ref"):  # which counts, in any order
                    element.children.remove(child)
                    element.children.insert(0, child)
                child.name = names[child.name]
        named = [it for it in element.children if it.name and self.resolved(it).tag in (*PROPERTIES, "rgb", "texture")]
        last = {it.name: it for it in sorted(named, key=lambda it: it.tag in ("texture", "ref"))}
        for extra in (it for it in named if it is not last[it.name]):
            element.children.remove(extra)
            self.dropped(extra, f"{extra.name} of {element.type}, which is given twice")
        for child in last.values():
            checks = colours(self.resolved(child))
            if child.name in NUMBERS and len(checks) == 2:
                # Mitsuba 3 swaps the two where it reads a checkerboard as a number, up to 3.9 at least.
                swapped = self.resolved(child).copy(child.name)
                for name, it in zip(("color1", "color0"), checks, strict=True):
                    swapped.set(name, float(np.mean(it.numbers())))
                element.put(swapped)

    def _succeeded(self, element: Element) -> Element | None:
        """Return a plugin under its name in Mitsuba 3, or what is nearest to it."""
        kind, was = element.tag, element.type
        new = PLUGINS[kind].get(was) or PLUGINS[kind].get("")
        if new and new.type == was:
            return element
        inner, text = next((it for it in element.children if self.resolved(it).tag == kind), None), "the one in it"
        if inner is None and new is None and kind == "texture":
            inner, text = next(iter(element.of("rgb")), prop("", [0.5])), "a constant colour; it has no successor"
        if inner:
            self.approximated(element, f"the {kind} {was} is {text}")
            for child in element.children:
                if child is not inner:
                    self.dropped(child, f"{child.label} of {was}")
            return inner
        if new is None:
            self.dropped(element, f"the {kind} {was} has no successor")
            return None
        element.type = "volpath" if kind == "integrator" and self.has_media else new.type
        self.approximated(element, f"the {kind} {was} is {element.type}")
        return element

    def _clean(self, element: Element, was: str) -> None:
        """Leave out the properties that a plugin does not have in Mitsuba 3."""
        entry = PLUGINS.get(element.tag, {}).get(element.type)
        for child in [*element.children] if entry else ():
            if entry and not {child.name, f"<{self.resolved(child).tag}>"} & entry.known:
                element.children.remove(child)
                if child.name != "ensure_energy_conservation":
                    self.dropped(child, f"{child.label} of {was}, which Mitsuba 3 does not have")
            elif child.scale != [1.0]:
                self.approximated(child, "the texture scale of a bitmap has no successor; it is left out")
                element.children[element.children.index(child)] = replace(child, scale=[1.0])

    def _is_missing(self, element: Element) -> bool:
        """Write the name of a plugin's file as Mitsuba 3 finds it, or leave out what a stand-in has not."""
        given = element["filename"]
        if given is None or element.tag not in STAND_INS:
            return False
        names = (given.value, given.value.replace("\\", "/"))  # which may have been written on Windows
        if found := next((it for name in names if os.path.isfile(it := self.path.parent / name)), None):
            given.value = str(found) if os.path.isabs(given.value) else os.path.relpath(found, self.folder)
            return False
        if not self.lenient:
            self.missing.append(f"{element.place}: there is no file {given.value}")
        self.said("replaced", element, f"{given.value} is missing")
        kept = "to_world" if element.tag == "shape" else ""
        element.children = [it for it in element.children if it.tag not in PROPERTIES or it.name == kept]
        return True

    def maxima(self, texture: Element) -> np.ndarray:
        """Return the largest value in each channel, as 0.6 knows it."""
        if constants := colours(texture):
            return np.max([np.broadcast_to(it.numbers(1, 3), 3) for it in constants], axis=0)
        most: Any = 1.0
        if texture.type == "bitmap" and (name := texture["filename"]):
            try:
                bitmap = mi.Bitmap(str(self.folder / name.value))
            except RuntimeError as error:
                raise texture.error(f"{name.value} cannot be read: {error}") from None
            raw = texture.text("raw") == "true"
            linear = bitmap.convert(component_format=mi.Struct.Type.Float32, srgb_gamma=bitmap.srgb_gamma() and raw)
            most = np.maximum(np.array(linear)[..., :3].max(axis=(0, 1)), 0)
        return np.broadcast_to(most * np.array(texture.scale), 3)


def _normalize(transform: Element) -> None:
    """Take the scale out of the transform of a sensor, in place, which Mitsuba 3 refuses."""
    if not transform.of("scale", "matrix"):
        return
    importlib.import_module("mitsuba.scalar_rgb")  # which knows what a transform is
    text = Element("scene", {"version": "3.0.0"}, [plugin("shape", "sphere", transform)]).to_xml()
    try:
        parsed = mi.parser.parse_string(mi.parser.ParserConfig("scalar_rgb"), text)
        matrix = np.array(parsed.nodes[1].props["to_world"].matrix)
        u, _, v = np.linalg.svd(matrix[:3, :3])
    except (RuntimeError, np.linalg.LinAlgError):
        raise transform.error("it is no transform, or looks nowhere") from None
    matrix[:3, :3] = u @ v
    transform.children = [Element("matrix", {"value": " ".join(f"{v:.9g}" for v in matrix.ravel())})]
