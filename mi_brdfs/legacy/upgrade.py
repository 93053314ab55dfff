"""Scenes of Mitsuba 0.2 to 0.6 as scenes of Mitsuba 3, with a report of what changed."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partialmethod
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import mitsuba as mi
import numpy as np

from . import scenery  # noqa: F401, which fills RULES, as surfaces does
from .document import Element, Reader, floats, plugin, prop, rgb_of, root_of, written
from .older import modernize
from .surfaces import colours
from .tables import PLUGINS, RULES

PROPERTIES = ("float", "integer", "boolean", "string", "point", "vector", "transform")
COUNTS: dict[str, tuple[int, ...]] = {"matrix": (16,), **dict.fromkeys(("origin", "target", "up"), (3,))}
COUNTS |= dict.fromkeys(("float", "integer", "x", "y", "z", "angle"), (1,))
COUNTS |= dict.fromkeys(("point", "vector", "scale", "translate", "rotate"), ())
"""How many numbers the values of these elements have, if it is fixed, and attributes of these names."""
COLOURS = ("rgb", "srgb", "spectrum", "blackbody")
NUMBERS = ("alpha", "alpha_u", "alpha_v", "exponent", "opacity", "weight")
"""Properties that Mitsuba 3 reads of a texture as numbers."""
STAND_INS = {"shape": "cube", "emitter": "constant", "volume": "constvolume", "texture": "grey"}
"""What takes the place of plugins whose files are missing."""
Kind = Literal["changed", "approximated", "dropped", "replaced"]


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
        counts = [(sum(change.kind == kind for change in self.changes), kind) for kind in get_args(Kind)]
        return ", ".join(f"{count} {kind}" for count, kind in counts if count) or "nothing changed"

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
            new = ET.fromstring(text.encode())
        except (ET.ParseError, LookupError, ValueError) as error:
            raise ValueError(f"{path}: no well-formed XML in UTF-8: {error}.") from None
        if not re.fullmatch(r"\s*[\d.]+\s*", version := new.get("version", "")) or new.tag != "scene":
            raise ValueError(f"{path}: the file has a <{new.tag}> of version {version!r}, no scene of Mitsuba.")
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
    return Upgraded(version, work.scene(root, int(found[1])).to_xml(), work.changes)


def _complete_look_at(element: Element) -> None:
    """Say which way is up where that is not given, as 0.6 finds it."""
    given = [floats(element.attributes.get(name) or "0 0 0") for name in ("origin", "target", "up")]
    origin, target, up = (np.array(it) for it in given)
    if up.any() or not (target - origin).any():
        return
    x, y, z = towards = (target - origin) / np.linalg.norm(target - origin)
    aside = (z, 0, -x) if abs(x) > abs(y) else (0, z, -y)
    found = np.cross(aside, towards) / np.linalg.norm(aside)
    element.attributes["up"] = written(found.tolist())


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
        self.lifted: list[Element] = []
        """What stands in the scene itself, and was inside something else."""
        self.missing: list[str] = []

    def said(self, kind: Kind, element: Element, text: str) -> None:
        self.changes.append(Change(element.place or self.path.name, kind, text))

    changed = partialmethod(said, "changed")
    approximated = partialmethod(said, "approximated")
    dropped = partialmethod(said, "dropped")

    def resolved(self, element: Element) -> Element:
        """Return what a reference refers to, or the element itself."""
        return (element.tag == "ref" and self.ids.get(element.id)) or element

    def reached(self, element: Element) -> Iterator[Element]:
        """Yield all that is in an element, also by reference."""
        for it in element.children:
            yield (target := self.resolved(it))
            yield from self.reached(target)

    def scene(self, root: Element, minor: int) -> Element:
        modernize(root, minor, self.changed)
        self._complete(root)
        self.has_media = any(it.tag == "medium" for it in root.walk())
        scene = Element("scene", {"version": "3.0.0"}, self._parts(root))
        scene.children += self.lifted
        self._unite_sun_and_sky(scene)
        if self.missing:
            first = self.missing[0] + f", and {len(self.missing) - 1} more" * (len(self.missing) > 1)
            raise ValueError(f"{first}; put the files there, or let stand-ins take their place (--lenient).")
        self._leave_out(scene, scene.of(*PROPERTIES), "of the scene, which Mitsuba 3 does not have")
        scene.children = [it for it in scene.children if not colours(it)]  # which are written where they are used
        if len(sensors := scene.of("sensor")) > 1:
            scene.children.sort(key=lambda it: it is not sensors[-1])
            self.changed(root, "of several sensors the last, which 0.6 uses, is the first")
        return scene

    def _unite_sun_and_sky(self, scene: Element) -> None:
        """Put a sun of radius 0, which is no environment in 0.6, into the sky, or leave it out beside another one."""
        around = [it for it in scene.of("emitter") if it.type in ("constant", "envmap", "sunsky")]
        suns = [it for it in around if it["sky_scale"] and it.number("sky_scale", 1) == 0]
        others = [it for it in around if it not in suns]
        for sun in suns if others else []:
            if others[0].type == "sunsky":
                for name in ("sun_scale", "sun_aperture"):
                    others[0].pop(name)
                    others[0].children += [it for it in sun.children if it.name == name]
                self.approximated(sun, "the sun of radius 0 is in the sky, and where that has it")
            else:
                self.dropped(sun, f"the sun of radius 0, beside {others[0].type}: Mitsuba 3 takes one environment")
            scene.children.remove(sun)

    def _leave_out(self, parent: Element, children: list[Element], why: str) -> None:
        left_out = set(children)
        parent.children = [it for it in parent.children if it not in left_out]
        for child in children:
            self.dropped(child, f"{child.name or child.type or child.tag} {why}")

    def _complete(self, root: Element) -> None:
        """Add what 0.6 supplies by itself."""
        if not root.of("integrator"):
            root.children.insert(0, plugin("integrator", "direct"))
            self.changed(root, "a scene without an integrator has direct")
        self._leave_out(root, root.of("integrator")[:-1], "before another integrator")
        if not root.of("sensor"):
            self.dropped(root, "a scene without a sensor has none: 0.6 sees all of it along z")
        if not any(it.tag == "emitter" for it in root.walk()):
            root.children.append(sky := plugin("emitter", "sunsky", scale=2.0))
            sky.to_world().children.append(Element("rotate", {"y": "1", "angle": "-120"}))
            self.changed(root, "a scene without an emitter has sun and sky")

    def _parts(self, element: Element) -> list[Element]:
        return [it for child in element.children if (it := self._part(child)) is not None]

    def _part(self, element: Element) -> Element | None:
        id, name = element.id, element.name
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
            return next((replace(it, name=name, attributes={}) for it in element.of("transform")), None)
        if element.tag in PROPERTIES:
            for it in element.walk():
                for kind, text in ((it.tag, it.value), *it.attributes.items()):
                    if kind in COUNTS and (text or COUNTS[kind]):
                        it.numbers(*COUNTS[kind], text=text)
                if it.tag == "lookat":
                    _complete_look_at(it)
            element.value = element.value.strip(", \t\n")
            if element.tag == "boolean":
                element.value = element.value.lower()
                if element.value not in ("true", "false"):
                    raise element.error(f"{element.value!r} is neither true nor false")
            return element
        if element.tag not in PLUGINS:
            shown = " ".join([element.tag, *element.attributes.values()])
            self.dropped(element, f"<{shown}>, which is missing or unknown")
            return None
        result = self._object(element)
        if result is not element:  # which may be in it
            element.id = element.name = ""
        if id:
            self.ids[id] = result and self.resolved(result)
        if result:
            result.id = result.id or (id if not colours(result) else "")
            result.name = name or result.name
        return result

    def _reference(self, element: Element) -> Element | None:
        if element.id not in self.ids:
            raise element.error(f"there is no {element.id!r} before this reference")
        if (target := self.ids[element.id]) is None:
            self.dropped(element, "references to what has no successor")
            return None
        # Colours have no id, and what is scaled differs from what others refer to.
        if colours(target) or target.scale != [1.0]:
            return target.copy(element.name)
        element.id = target.id
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
        supplied = element.entry.supplied
        if (element.tag, element.type) not in RULES and (succeeded := self._succeeded(element)) is not element:
            return succeeded
        rule = RULES.get((element.tag, element.type)) or RULES.get(("", element.tag))
        result = (rule(self, element) if rule else None) or element
        for name, value in (supplied | element.entry.supplied).items():
            if not element[name]:
                element.set(name, value)
        held = {self.resolved(it).tag for it in element.children}
        if element.tag == "shape" and "medium" in held and not held & {"bsdf", "emitter"}:
            element.children.append(plugin("bsdf", "null"))
        for it in result.walk():
            self._fit(it, was)
        return result

    def _sort_names(self, element: Element) -> None:
        """Give properties their names in Mitsuba 3, and leave out those for which 0.6 takes another of the same name: a
        texture at any place, a colour under the name that is still used, or else a later one."""
        names = element.entry.renamed
        kinds = (*PROPERTIES, "rgb", "texture", "volume")
        named = [it for it in element.children if it.name and self.resolved(it).tag in kinds]
        named.sort(key=lambda it: 2 if it.tag in ("texture", "ref") else it.name not in names)
        last = {names.get(it.name, it.name): it for it in named}
        for child in named:
            if new := names.get(child.name):
                self.changed(child, f"{child.name} of {element.type} is {new}")
                child.name = new
            if child is not last[child.name]:
                self._leave_out(element, [child], f"of {element.type}, which is given twice")
            elif child.name in NUMBERS and child.type == "checkerboard":
                # Mitsuba 3 swaps the two colours where it reads a checkerboard as a number, up to 3.9 at least.
                swapped = child.copy(child.name)
                for it in colours(child):
                    swapped.set({"color0": "color1", "color1": "color0"}[it.name], float(np.mean(it.numbers())))
                element.put(swapped)
            elif child.name in NUMBERS:
                self.tell_of_colours(self.resolved(child), f"{child.name} of {element.type}")

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
            self._leave_out(element, [it for it in element.children if it is not inner], f"of {was}")
            return inner
        if new is None:
            self.dropped(element, f"the {kind} {was} has no successor")
            return None
        element.type = "volpath" if kind == "integrator" and self.has_media else new.type
        self.approximated(element, f"the {kind} {was} is {element.type}")
        return element

    def _fit(self, element: Element, was: str) -> None:
        """Leave out the properties that a plugin does not have in Mitsuba 3, and limit the values of the others."""
        if not (entry := element.entry).type:
            return
        pair = [name for name in ("alpha_u", "alpha_v") if name in entry.known]
        missing = [name for name in pair if not element[name]]
        if len(missing) < len(pair) and (missing or element["alpha"]):
            alpha = element.pop("alpha") or prop("alpha", 0.1)
            element.children += [alpha.copy(name) for name in missing]
            self.changed(element, f"alpha of {element.type} is what alphaU and alphaV are where they are not given")
        element.pop("ensure_energy_conservation")
        unknown = [it for it in element.children if not {it.name, f"<{self.resolved(it).tag}>"} & entry.known]
        self._leave_out(element, unknown, f"of {was}, which Mitsuba 3 does not have")
        for child in [*element.children]:
            if child.scale != [1.0]:
                self.approximated(child, "the texture scale of a bitmap has no successor; it is left out")
                element.children[element.children.index(child)] = replace(child, scale=[1.0])
            elif limits := entry.limits.get(child.name):
                for it in colours(self.resolved(child)):
                    if (limited := np.clip(it.numbers(), *limits).tolist()) != it.numbers():
                        self.approximated(it, f"{child.name} of {was} is {written(limited)} in place of {it.value}")
                        it.value = written(limited)
            elif child.name in entry.words:
                words = {it.replace("_", ""): it for it in entry.words[child.name]}  # luminanceAlpha: luminance_alpha
                old, word = child.value, child.value.strip().lower().replace("_", "")
                child.value = words.get(word.split(",")[0], entry.words[child.name][-1])
                if word not in words:
                    self.approximated(child, f"{child.name} of {was} is {child.value} in place of {old}")

    def _is_missing(self, element: Element) -> bool:
        """Write the name of a plugin's file as Mitsuba 3 finds it, and return whether there is none."""
        given = element["filename"]
        if given is None or element.tag not in STAND_INS:
            return False
        names = (given.value, given.value.replace("\\", "/"))  # which may have been written on Windows
        here, there = map(os.path.realpath, (self.path.parent, self.folder))  # ".." goes up from where a link leads to
        if found := next((it for name in names if os.path.isfile(it := os.path.join(here, name))), None):
            given.value = found if os.path.isabs(given.value) else os.path.relpath(found, there)
            return False
        if not self.lenient:
            self.missing.append(f"{element.place}: there is no file {given.value}")
        self.said("replaced", element, f"{given.value} is missing")
        kept = "to_world" if element.tag == "shape" else ""
        element.children = [it for it in element.children if it.tag not in PROPERTIES or it.name == kept]
        return True

    def maxima(self, texture: Element) -> np.ndarray:
        """Return the largest value in each channel, as 0.6 knows it."""
        values, scale = self.values(texture), np.array(self.resolved(texture).scale)
        return np.broadcast_to(np.maximum(values.max(axis=0), 0) * scale, 3)

    def is_grey(self, texture: Element) -> bool:
        """Return whether its channels are the same, but for the noise of compressed files."""
        return bool(np.ptp(self.values(texture), axis=1).max() < 0.02)

    def tell_of_colours(self, texture: Element, what: str) -> None:
        """Report a bitmap of colours that is read as numbers."""
        if texture.type == "bitmap" and texture.text("raw") != "true" and self.values(texture).shape[1] > 1:
            told = "is decoded, as in 0.6; spectral variants of Mitsuba 3 take grey or raw ones only"
            self.changed(texture, f"the bitmap of {what} {told}")

    def values(self, texture: Element) -> np.ndarray:
        """Return what it is made of before it is scaled: constants or pixels, shape (n, 1) or (n, 3)."""
        if constants := colours(texture := self.resolved(texture)):
            return np.array([np.broadcast_to(it.numbers(1, 3), 3) for it in constants])
        if texture.type != "bitmap" or not (name := texture["filename"]):
            return np.ones((1, 1))
        try:
            bitmap = mi.Bitmap(str(self.folder / name.value))
        except RuntimeError as error:
            raise texture.error(f"{name.value} cannot be read: {error}") from None
        raw = texture.text("raw") == "true"
        linear = bitmap.convert(component_format=mi.Struct.Type.Float32, srgb_gamma=bitmap.srgb_gamma() and raw)
        pixels = np.array(linear)
        return pixels.reshape(-1, pixels.shape[-1] if pixels.ndim > 2 else 1)[:, :3]
