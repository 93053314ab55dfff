"""A scene file, with all that decides what a sensor sees of it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import indent
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import mitsuba as mi

from ..legacy import upgrade
from ..loading import looking_in, parsed, versioned
from ..probe.sources import BSDFSource

RESERVED = ("config", "filename")
"""Names that no parameter of a scene can have: those of ``mi.parser.parse_file``."""


@dataclass(frozen=True)
class SceneFile:
    """A scene file and its parameters, or its copy for another machine."""

    path: str
    parameters: dict[str, str] = field(default_factory=dict)
    """The values of its ``<default>`` parameters."""
    box_filter: bool = False
    """Whether films get box filters: a denoiser expects pixels that share no samples."""
    lenient: bool = False
    """Whether stand-ins take the place of files that a scene of Mitsuba 0.6 lacks."""
    replaced: dict[str, BSDFSource] = field(default_factory=dict)
    """What takes the place of BSDFs, or of those of shapes, by their ids."""
    contents: dict[str, bytes] | None = None
    """In a copy, the files by their paths, without the root."""
    names: dict[str, str] = field(default_factory=dict)
    """In a copy, the path of each file by the name that the scene gives it."""
    folder: str = "."
    """In a copy, the folder relative to which names may be, besides the scene's."""

    def load(self) -> Any:
        """Return the scene. The files named in it are looked for as by ``mi.load_file``."""
        if self.contents is None:
            return self._load(Path(self.path), {})
        # The scene has read its files when it is loaded.
        with TemporaryDirectory(prefix="mi_brdfs-", ignore_cleanup_errors=True) as root:
            for path, content in self.contents.items():
                Path(root, path).parent.mkdir(parents=True, exist_ok=True)
                Path(root, path).write_bytes(content)
            folder = Path(root, self.folder)
            folder.mkdir(parents=True, exist_ok=True)
            names = {name: os.path.join(root, path) for name, path in self.names.items()}
            return self._load(Path(root, self.path), names, folder)

    def copied(self) -> SceneFile:
        """Return a copy with all files that the scene includes and names, for a machine that has none of them."""
        with looking_in(Path(self.path).parent):
            config = mi.parser.ParserConfig(mi.variant())
            state, text = parsed(config, Path(self.path), self.lenient, self.parameters)
            named = {props[key]: str(mi.file_resolver().resolve(props[key])) for props, key in _file_names(state)}
        names = {name: _rootless(path) for name, path in named.items() if os.path.isfile(path)}
        paths = [self.path, *map(str, state.files), *(path for path in named.values() if os.path.isfile(path))]
        contents = {_rootless(path): Path(path).read_bytes() for path in paths}
        parameters = self.parameters
        if text is not None:
            contents[_rootless(self.path)], parameters = text.encode(), {}
        return replace(self, path=_rootless(self.path), parameters=parameters, lenient=False, contents=contents,
                       names=names, folder=_rootless("."))  # fmt: skip

    def _load(self, path: Path, names: dict[str, str], *folders: Path) -> Any:
        config = mi.parser.ParserConfig(mi.variant())
        with looking_in(path.parent, *folders):
            state, _ = parsed(config, path, self.lenient, self.parameters)
            for props, key in _file_names(state):
                props[key] = names.get(props[key], props[key])
            mi.parser.transform_all(config, state)
            _check_films(state)
            for id, source in self.replaced.items():
                bsdf = source.load()
                _replace(state, id, mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf)
            if self.box_filter:
                _set_box_filters(state)
            return mi.parser.instantiate(config, state)


def _file_names(state: Any) -> list[tuple[mi.Properties, str]]:
    """Return where a parsed scene names files: the strings of properties that are called so."""
    properties = [(node.props, key) for node in state.nodes for key in node.props.keys() if "file" in key]
    return [(props, key) for props, key in properties if isinstance(props[key], str)]


def _check_films(state: Any) -> None:
    """Raise a ValueError if a film has no pixels, where Mitsuba would complain about the sensor."""
    for node in state.nodes:
        for name in ("width", "height") if node.type == mi.ObjectType.Film else ():
            if name in node.props and not node.props[name] > 0:
                raise ValueError(f"the film's {name} is {node.props[name]}; give it at least 1 pixel")


def _replace(state: Any, id: str, bsdf: mi.BSDF) -> None:
    """Put a BSDF in the place of the one with an id, wherever it is referred to, or of that of the shape with it; on
    both sides, in place of ``twosided``. Raise a ValueError if there is none."""
    kinds = mi.ObjectType.BSDF, mi.ObjectType.Shape
    ids = {node.props.id(): k for k, node in enumerate(state.nodes) if node.type in kinds and node.props.id()}
    if id not in ids:
        raise ValueError(f"no BSDF or shape has the id {id}; there are {', '.join(sorted(ids)) or 'none with one'}")
    is_shape = state.nodes[ids[id]].type == mi.ObjectType.Shape
    found = False
    for node in [state.nodes[ids[id]]] if is_shape else state.nodes:
        for name in node.props.keys():
            value = node.props[name]
            if isinstance(value, mi.Properties.ResolvedReference):
                usual = state.nodes[value.index()]
                if usual.type == mi.ObjectType.BSDF if is_shape else value.index() == ids[id]:
                    wrapped = usual.props.plugin_name() == "twosided"
                    node.props[name] = _on_both_sides(bsdf) if wrapped else bsdf
                    found = True
    if is_shape and not found:
        state.nodes[ids[id]].props["bsdf"] = bsdf


def _on_both_sides(bsdf: mi.BSDF) -> mi.BSDF:
    return bsdf if _is_seen_from_behind(bsdf) else mi.load_dict({"type": "twosided", "bsdf": bsdf})


def _is_seen_from_behind(bsdf: mi.BSDF) -> bool:
    return mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)


def with_material(path: Path, id: str, xml: str) -> str:
    """Return the text of a scene file with a ``<bsdf>`` in the place of the BSDF with an id, or of that of the shape
    with it, on both sides in place of ``twosided``, and all else as it is; a scene of Mitsuba 0.6 is upgraded. Raise a
    ValueError if the file itself has none, or is no scene."""
    data = upgrade(path).xml.encode()
    found: list[_Written] = []
    inside: list[_Written] = []
    parser = expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        inside.append(_Written(tag, attributes, parser.CurrentByteIndex, parent=inside[-1] if inside else None))
        found.append(inside[-1])

    def end(tag: str) -> None:
        element, at = inside.pop(), parser.CurrentByteIndex
        is_empty = found[-1] is element and data[at - 2 : at] == b"/>"
        element.end = at if is_empty else data.index(b">", at) + 1

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ValueError(f"{path}: {error}") from None
    bsdfs = {it.attributes.get("id") for it in found if it.tag == "bsdf"}
    own = [it for it in found if it.tag in ("bsdf", "shape") and id and it.attributes.get("id") == id]
    if not own:
        raise ValueError(f"{path} itself has no BSDF or shape with the id {id or 'of this material'}; give it one.")
    if own[0].tag == "shape":
        children = [it for it in found if it.parent is own[0]]
        own = [it for it in children if it.tag == "bsdf" or (it.tag == "ref" and it.attributes.get("id") in bsdfs)]
        if not own:
            raise ValueError(f"{path}: the shape {id} has no BSDF to be replaced; give it one.")
    place = own[0]
    usual = [it for it in found if place.tag == "ref" and it.attributes.get("id") == place.attributes["id"]] or [place]
    if usual[0].attributes.get("type") == "twosided" and not _is_seen_from_behind(mi.load_string(versioned(xml))):
        xml = f'<bsdf type="twosided">\n{indent(xml, "    ")}\n</bsdf>'
    kept = [name for name in ("name", "id") if name in place.attributes and (name, place.tag) != ("id", "ref")]
    named = "".join(f" {name}={quoteattr(place.attributes[name])}" for name in kept)
    before = data[data.rfind(b"\n", 0, place.start) + 1 : place.start].decode()
    margin = before[: len(before) - len(before.lstrip())]
    lines = xml.replace("<bsdf", f"<bsdf{named}", 1).replace("\n", "\n" + margin)
    return (data[: place.start] + lines.encode() + data[place.end :]).decode()


@dataclass(eq=False)
class _Written:
    """An element of a file, and where its text is."""

    tag: str
    attributes: dict[str, str]
    start: int
    end: int = 0
    parent: _Written | None = None


def _rootless(path: str) -> str:
    absolute = Path(os.path.abspath(path))
    return absolute.relative_to(absolute.anchor).as_posix()


def _set_box_filters(state: Any) -> None:
    for node in state.nodes:
        if node.type == mi.ObjectType.ReconstructionFilter:
            node.props = mi.Properties("box")
    for node in state.nodes:
        children = [node.props[name] for name in node.props.keys()]
        places = [it.index() for it in children if isinstance(it, mi.Properties.ResolvedReference)]
        filtered = any(state.nodes[place].type == mi.ObjectType.ReconstructionFilter for place in places)
        if node.type == mi.ObjectType.Film and not filtered:
            node.props["rfilter"] = mi.load_dict({"type": "box"})
