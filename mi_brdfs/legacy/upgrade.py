"""Scenes of Mitsuba 0.2 to 0.6 as scenes of Mitsuba 3, with a report of what changed."""

from __future__ import annotations

import importlib
import os
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import mitsuba as mi
import numpy as np

from ..names import check_name
from .document import OBJECTS, Element, read_document, root_of
from .rules import CHECKS, KNOWN, NEAREST, NUMBERS, RENAMED, RULES, SUCCESSORS, channels, colour, number
from .sheets import modernize
from .spectra import rgb_of

PROPERTIES = ("float", "integer", "boolean", "string", "point", "vector", "transform")
LOOK_AT = ("origin", "target", "up")
COLOURS = ("rgb", "srgb", "spectrum", "blackbody")
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
            return Upgraded("3", path.read_text(encoding="utf-8"))
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: the file is no UTF-8: {error}.") from None
    root, without = read_document(path, {name: str(value) for name, value in parameters.items()}, lenient)
    is_old = any(it.tag in ("camera", "luminaire") for it in root.walk())
    version = root.attributes.get("version", "0.2.0" if is_old else "0.6.0").strip()
    if not (found := re.fullmatch(r"0\.([0-6])(\.\d+)*", version)):
        raise ValueError(f"{path}: version {version} is none of 0.2 to 0.6.")
    work = Work(path, lenient, Path(folder) if folder is not None else path.parent)
    for place, name in without:
        work.changes.append(Change(place, "dropped", f"the include {name}, which is missing"))
    scene = work.scene(root, int(found[1]))
    return Upgraded(version, scene.to_xml(), work.changes)


def load_legacy(path: str | os.PathLike, *, lenient: bool = False, **parameters: Any) -> Any:
    """Load a scene file of Mitsuba 0.2 to 0.6 as :func:`upgrade` changes it, or one of Mitsuba 3 as it is. A warning
    counts the changes, if there are any.

    Raises:
        ValueError: as :func:`upgrade`.
        RuntimeError: what Mitsuba says where it cannot load the scene.
    """
    return load(Path(path), {name: str(value) for name, value in parameters.items()}, lenient)


def load(path: Path, parameters: Mapping[str, str], lenient: bool = False) -> Any:
    """Load a scene file, old or new."""
    with looking_in(path.parent):
        config = mi.parser.ParserConfig(mi.variant())
        state, upgraded = parsed(config, path, lenient, parameters)
        try:
            mi.parser.transform_all(config, state)
            return mi.parser.instantiate(config, state)
        except RuntimeError as error:  # of a file that was given a version
            place = "string" if upgraded else str(path)
            raise RuntimeError(
                str(error).replace("loading string (line", f"loading {place} (line")
            ) from error.__cause__


def parsed(config: Any, path: Path, lenient: bool, parameters: Mapping[str, str]) -> tuple[Any, str | None]:
    """Return a scene file as Mitsuba's parser has it, and the text of an upgraded one."""
    check_name(str(path))
    if is_new(path):
        tag, attributes = root_of(path)
        if not tag or "version" in attributes:
            return mi.parser.parse_file(config, str(path), **parameters), None
        return mi.parser.parse_string(config, versioned(path.read_text(encoding="utf-8-sig")), **parameters), None
    new = upgrade(path, lenient=lenient, **parameters)
    warnings.warn(
        f"{path} is a scene of Mitsuba {new.version} ({new.summary()}); mi-brdfs upgrade says what.", stacklevel=3
    )
    return mi.parser.parse_string(config, new.xml), new.xml


def versioned(text: str) -> str:
    """Return XML with a version in its root, as Mitsuba 3 demands; as it is if it has one."""
    root = re.match(r"\s*(<[?!].*?>\s*)*<[\w:]+", text, re.DOTALL)
    if not root or "version=" in text[root.end() :].partition(">")[0]:
        return text
    return f'{text[: root.end()]} version="3.0.0"{text[root.end() :]}'


@contextmanager
def looking_in(*folders: Path) -> Iterator[None]:
    """Look for files in these folders first, and forget these and those that a scene adds."""
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    for folder in reversed(folders):
        resolver.prepend("" if folder == Path(".") else str(folder))  # messages show it in front of names
    mi.set_file_resolver(resolver)
    try:
        yield
    finally:
        mi.set_file_resolver(before)


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

    def changed(self, element: Element, text: str, kind: Kind = "changed") -> None:
        self.changes.append(Change(element.place or self.path.name, kind, text))

    def approximated(self, element: Element, text: str) -> None:
        self.changed(element, text, "approximated")

    def dropped(self, element: Element, text: str) -> None:
        self.changed(element, text, "dropped")

    def resolved(self, element: Element) -> Element:
        """Return what a reference refers to, or the element itself."""
        if element.tag != "ref":
            return element
        return self.ids.get(element.attributes.get("id", "")) or element

    # --- The scene ---------------------------------------------------------------------------------------------------

    def scene(self, root: Element, minor: int) -> Element:
        modernize(root, minor, self.changed)
        self.has_media = any(it.tag == "medium" for it in root.walk())
        parts = self._parts(root)
        for extra in (it for it in parts if it.tag in PROPERTIES):
            self.dropped(extra, f"{extra.name} of the scene, which Mitsuba 3 does not have")
        scene = Element("scene", {"version": "3.0.0"}, [it for it in parts if it.tag not in PROPERTIES])
        self._complete(root, scene)
        if self.missing:
            more = f", and {len(self.missing) - 1} more" if len(self.missing) > 1 else ""
            raise ValueError(
                f"{self.missing[0]}{more}; put the files there, or let stand-ins take their place (--lenient)."
            )
        return scene

    def _complete(self, root: Element, scene: Element) -> None:
        """Write out what 0.6 supplies by itself."""
        root = Element("scene", place=root.place)
        if not scene.of("integrator"):
            scene.children.insert(0, Element("integrator", {"type": "direct"}))
            self.changed(root, "a scene without an integrator has direct")
        for extra in scene.of("integrator")[:-1]:
            scene.children.remove(extra)
            self.dropped(extra, "an integrator before another one")
        sensors = scene.of("sensor")
        if not sensors:
            self.dropped(root, "a scene without a sensor has none: 0.6 sees all of it along z")
        elif len(sensors) > 1:
            scene.children = [it for it in scene.children if it is not sensors[-1]]
            scene.children.insert(scene.children.index(sensors[0]), sensors[-1])
            self.changed(root, "of several sensors the last, which 0.6 uses, is the first")
        lights = [it for it in scene.walk() if it.tag == "emitter"]
        if not lights:
            sun = Element(
                "emitter", {"type": "sunsky"}, [number("float", "sun_scale", "2"), number("float", "sky_scale", "2")]
            )
            turn = Element("transform", {"name": "to_world"}, [Element("rotate", {"y": "1", "angle": "-120"})])
            sun.children.append(turn)
            RULES["emitter", "sunsky"](self, sun)
            scene.children.append(sun)
            self.changed(root, "a scene without an emitter has sun and sky")

    # --- Elements ----------------------------------------------------------------------------------------------------

    def _parts(self, element: Element) -> list[Element]:
        return [it for child in element.children if (it := self._part(child, element)) is not None]

    def _part(self, element: Element, parent: Element) -> Element | None:
        id = element.attributes.get("id", "")
        if element.tag == "null":
            self.ids[id] = None
            return None
        if element.tag == "alias":
            self.ids[element.attributes.get("as", "")] = self.ids.get(id)
            return None
        if element.tag == "ref":
            return self._reference(element, parent)
        if element.tag in COLOURS:
            return self._colour(element)
        if element.tag == "animation":
            return self._animation(element)
        if element.tag in PROPERTIES:
            if element.tag in ("float", "integer"):
                try:
                    float(element.value)
                except ValueError:
                    said = f"{element.place}: <{element.tag}> {element.name} = {element.value!r} is no number."
                    raise ValueError(said) from None
            if element.name == "to_world" and parent.tag == "sensor":
                _normalize(element)
            return element
        if element.tag not in (*KNOWN, "subsurface"):
            self.dropped(element, f"<{element.tag}>, which Mitsuba does not have")
            return None
        name = element.name
        try:
            result = self._object(element)
        except ValueError as error:
            said = str(error)
            raise ValueError(
                said if ".xml:" in said else f"{element.place}: {element.tag} {element.type}: {said}."
            ) from None
        if result is not element:
            element.attributes.pop("id", None)
            element.attributes.pop("name", None)
        if id:
            self.ids[id] = result
        if result is None or (result.tag not in OBJECTS and not name):  # a colour that only references need
            return None
        result.attributes |= ({"id": id} if id and result.tag in OBJECTS else {}) | ({"name": name} if name else {})
        return result

    def _reference(self, element: Element, parent: Element) -> Element | None:
        id = element.attributes.get("id", "")
        if id not in self.ids:
            raise ValueError(f"{element.place}: there is no {id!r} before this reference.")
        target = self.ids[id]
        if target is None:
            self.dropped(element, "references to what has no successor")
            return None
        # What became a colour has no id, and what is scaled differs from what others refer to.
        checks = target.type == "checkerboard" and element.name in NUMBERS
        if target.tag not in OBJECTS or target.scale or checks:
            attributes = {name: value for name, value in target.attributes.items() if name != "id"}
            named = {"name": element.name} if element.name else {}
            copy = Element(target.tag, attributes | named, target.children, element.place, target.scale)
            return RULES["texture", "checkerboard"](self, copy) if checks else copy
        return Element(
            "ref",
            {"id": target.attributes["id"]} | ({"name": element.name} if element.name else {}),
            place=element.place,
        )

    def _colour(self, element: Element) -> Element:
        rgb = rgb_of(element, self.path.parent)
        if element.tag != "rgb" or element.value.strip().startswith("#"):
            self.changed(element, f"<{element.tag}> is written as linear <rgb>, as 0.6 reads it")
        return Element("rgb", {"name": element.name, "value": ", ".join(f"{v:.9g}" for v in rgb)}, place=element.place)

    def _animation(self, element: Element) -> Element | None:
        self.approximated(element, "an animated transform is its first one")
        first = next(iter(element.of("transform")), None)
        return first and Element("transform", {"name": element.name}, first.children, element.place)

    def _object(self, element: Element) -> Element | None:
        """Return what a plugin becomes, or None."""
        element.children = self._parts(element)
        self._last_of_each_name(element)
        kind, was = element.tag, element.type
        for child in element.children:
            if new := RENAMED.get((was, child.name)):
                child.attributes["name"] = new
                self.changed(child, f"a property of {was} is {new}")
        if kind == "subsurface":
            self.dropped(element, f"the subsurface {was} has no successor")
            return None
        if (stand_in := self._without_files(element)) is not element:
            return stand_in
        media = [it for it in element.children if it.name in ("interior", "exterior")]
        if (
            kind == "shape"
            and media
            and not element.of("bsdf", "emitter")
            and len(element.of("ref", "medium")) == len(media)
        ):
            element.children.append(Element("bsdf", {"type": "null"}))
        rule = RULES.get((kind, was))
        result = rule(self, element) if rule else self._succeeded(element)
        if result is None:
            return None
        if was != "scale":
            self._left_out(element, result)
        if result.tag != kind:
            return result
        if result is not element:
            result.place = element.place
        return self._cleaned(result)

    def _left_out(self, element: Element, result: Element) -> None:
        """Say which properties of a plugin are not in what it has become."""
        there = list(result.walk())
        used = {"ensure_energy_conservation", *(text for it in there for text in (it.name, it.value) if text)}
        for child in element.children:
            if child.tag not in ("bsdf", "ref") and child not in there and not {child.name, child.value} & used:
                self.dropped(child, f"{child.name or child.type} of {element.type}")

    def _last_of_each_name(self, element: Element) -> None:
        """Leave out the properties that a later one of the same name replaces, or a texture at any place."""
        named = [it for it in element.children if it.name and self.resolved(it).tag in (*PROPERTIES, "rgb", "texture")]
        last = {it.name: it for it in sorted(named, key=lambda it: it.tag in ("texture", "ref"))}
        for extra in (it for it in named if it is not last[it.name]):
            element.children.remove(extra)
            self.dropped(extra, f"{extra.name} of {element.type}, which is given twice")

    def _succeeded(self, element: Element) -> Element | None:
        """Return a plugin under its name in Mitsuba 3, or what is nearest to it."""
        kind, was = element.tag, element.type
        new = SUCCESSORS.get(kind, {}).get(was, was)
        if not new:
            self.changed(element, f"the {kind} {was} is the one in it")
            return next(iter(element.of(kind)), None) or Element(kind, {"type": NEAREST.get(kind, "constvolume")})
        if new in KNOWN[kind]:
            if new != was:
                self.approximated(element, f"the {kind} {was} is {new}")
            element.type = new
            return element
        if kind == "texture":
            self.approximated(element, f"the texture {was} has no successor; it is a constant colour")
            given = next(iter(element.of("rgb")), colour("", 0.5))
            return Element("rgb", {"name": element.name, "value": given.value})
        if kind not in NEAREST:
            self.dropped(element, f"the {kind} {was} has no successor")
            return None
        nearest = "volpath" if kind == "integrator" and self.has_media else NEAREST[kind]
        self.approximated(element, f"the {kind} {was} is {nearest}")
        if kind == "bsdf":
            return Element(kind, {"type": nearest}, [it for it in element.children if it.name == "reflectance"])
        element.type = nearest
        return element

    def _cleaned(self, element: Element) -> Element:
        """Return a plugin without the properties that it does not have in Mitsuba 3, all the way down."""
        if element.tag not in OBJECTS or element.type not in KNOWN.get(element.tag, {}):
            return element
        known = KNOWN[element.tag][element.type].split()
        kept = []
        for child in element.children:
            is_object = child.tag in OBJECTS or child.tag == "ref"
            free = is_object and (
                not child.name or child.tag in ("medium", "bsdf", "film", "sampler", "shape", "emitter")
            )
            inside = child.name in ("interior", "exterior") or (is_object and "*" in known)
            if child.name in known or free or inside:
                if child.scale and child.tag == "texture":
                    self.approximated(child, "the texture scale of a bitmap has no successor; it is left out")
                    child.scale = None
                kept.append(child)
            elif child.name != "ensure_energy_conservation":
                self.dropped(child, f"{child.name or child.tag} of {element.type}, which Mitsuba 3 does not have")
        element.children = [self._cleaned(child) for child in kept]
        return element

    # --- Files -------------------------------------------------------------------------------------------------------

    def _without_files(self, element: Element) -> Element | None:
        """Return a plugin with the names of its files as Mitsuba 3 finds them, or a stand-in where one is missing."""
        given = element["filename"]
        if not given or element.tag not in ("shape", "texture", "emitter", "volume"):
            return element
        name = given.value
        found = self._file(name)
        if found is not None:
            given.attributes["value"] = os.path.relpath(found, self.folder) if not os.path.isabs(name) else str(found)
            return element
        where = f"{element.place}: there is no file {name}"
        if not self.lenient:
            self.missing.append(where)
        self.changed(element, f"{name} is missing", "replaced")
        if element.tag == "texture":
            return colour(element.name, 0.5)
        if element.tag == "emitter":
            return Element("emitter", {"type": "constant"}, place=element.place)
        if element.tag == "volume":
            return Element("volume", {"type": "constvolume"}, [number("float", "value", "1")], element.place)
        kept = [
            it for it in element.children if it.name == "to_world" or it.tag in ("bsdf", "emitter", "ref", "medium")
        ]
        return Element("shape", {"type": "cube"}, kept, element.place)

    def _file(self, name: str) -> Path | None:
        """Return the file of a name, which may have been written on Windows."""
        return next(
            (it for text in (name, name.replace("\\", "/")) if os.path.isfile(it := self.path.parent / text)), None
        )

    def maxima(self, texture: Element | None, default: float) -> list[float]:
        """Return the largest value in each channel, as 0.6 knows it."""
        if texture is None:
            return [default]
        texture = self.resolved(texture)
        if texture.tag in ("rgb", "float"):
            return channels(texture)
        if texture.type == "bitmap" and (name := texture["filename"]):
            try:
                bitmap = mi.Bitmap(str(self.folder / name.value))
            except RuntimeError as error:
                raise ValueError(f"{name.value} cannot be read: {error}") from None
            raw = texture.text("raw") == "true"
            linear = bitmap.convert(component_format=mi.Struct.Type.Float32, srgb_gamma=bitmap.srgb_gamma() and raw)
            pixels = np.array(linear)[..., :3]
            most = np.maximum(pixels.reshape(-1, pixels.shape[-1]).max(axis=0), 0).tolist()
        elif texture.type == "checkerboard":
            both = [self.maxima(texture[name], given) for name, given in CHECKS.items()]
            most = [max(one[k % len(one)] for one in both) for k in range(3)]
        else:
            most = [1.0]
        scale = texture.scale or [1.0]
        return [most[k % len(most)] * scale[k % len(scale)] for k in range(max(len(most), len(scale)))]


def _normalize(transform: Element) -> None:
    """Take the scale out of the transform of a sensor, in place, which Mitsuba 3 refuses."""
    if not any(step.tag in ("scale", "matrix") for step in transform.children):
        return
    transforms = importlib.import_module("mitsuba.scalar_rgb").ScalarTransform4f  # which needs no variant
    matrix = np.eye(4)
    for step in transform.children:
        matrix = np.array(_matrix(transforms(), step)) @ matrix
    if not np.isfinite(matrix).all():
        raise ValueError("its transform is not finite, or looks nowhere")
    u, _, v = np.linalg.svd(matrix[:3, :3])
    matrix[:3, :3] = u @ v
    transform.children = [Element("matrix", {"value": " ".join(f"{v:.9g}" for v in matrix.ravel())})]


def _matrix(identity: Any, step: Element) -> Any:
    """Return the matrix of one step of a transform."""
    given = step.attributes
    if step.tag == "matrix":
        return np.reshape(channels(step), (4, 4))
    if step.tag == "lookat":
        points = {name: channels(Element("", {"value": given.get(name, "0, 1, 0")})) for name in LOOK_AT}
        return identity.look_at(**points).matrix
    default = (channels(step) if step.value else [1.0 if step.tag == "scale" else 0.0]) * 3
    triple = [float(given.get(axis, default[k])) for k, axis in enumerate("xyz")]
    if step.tag == "rotate":
        return identity.rotate(triple, float(given.get("angle", 0))).matrix
    return (identity.scale if step.tag == "scale" else identity.translate)(triple).matrix
