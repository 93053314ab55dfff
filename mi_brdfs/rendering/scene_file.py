"""A scene file, with all that decides what a sensor sees of it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import indent
from typing import Any
from xml.dom import minidom
from xml.parsers.expat import ExpatError

import mitsuba as mi

from ..legacy import upgrade
from ..loading import file_names, load, load_text, looking_in, parsed, referred
from ..probe.sources import BSDFSource

RESERVED = ("config", "filename")
"""Names that no parameter of a scene can have: those of ``mi.parser.parse_file``."""
GROUPS = "merge", "shapegroup", "instance"
"""Shapes that have no BSDF of their own, but others in them."""


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
    keeps_ids: bool = False
    """Whether BSDFs that are alike stay apart though nothing is replaced."""
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
            state, text = parsed(Path(self.path), self.lenient, self.parameters)
            found = {props[key]: str(mi.file_resolver().resolve(props[key])) for props, key in file_names(state)}
        named = {name: path for name, path in found.items() if os.path.isfile(path)}
        names = {name: _rootless(path) for name, path in named.items()}
        contents = {_rootless(it): Path(it).read_bytes() for it in (self.path, *map(str, state.files), *named.values())}
        parameters = self.parameters
        if text is not None:
            contents[_rootless(self.path)], parameters = text.encode(), {}
        path, folder = _rootless(self.path), _rootless(".")
        return replace(
            self, path=path, parameters=parameters, lenient=False, contents=contents, names=names, folder=folder
        )

    def _load(self, path: Path, names: dict[str, str], *folders: Path) -> Any:
        def change(state: Any) -> None:
            for props, key in file_names(state):
                props[key] = names.get(props[key], props[key])
            _check_counts(state)
            shapes = {node.props.id() for node in state.nodes if node.type == mi.ObjectType.Shape}
            for id, source in sorted(self.replaced.items(), key=lambda it: it[0] in shapes):
                bsdf = source.load()
                _replace(state, id, mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf)
            if self.box_filter:
                _set_box_filters(state)

        merge = not (self.keeps_ids or self.replaced)
        with looking_in(*folders):
            return load(path, self.parameters, self.lenient, merge, change=change)


def _check_counts(state: Any) -> None:
    """Raise a ValueError if a film has no pixels, where Mitsuba would complain about the sensor, or no samples."""
    kinds = {mi.ObjectType.Film: ("width", "height"), mi.ObjectType.Sampler: ("sample_count",)}
    for node in state.nodes:
        for name in kinds.get(node.type, ()):
            if name in node.props and not node.props[name] > 0:
                raise ValueError(f"the {node.type.name.lower()}'s {name} is {node.props[name]}; give it at least 1")


def _replace(state: Any, id: str, bsdf: mi.BSDF) -> None:
    """Put a BSDF in the place of the one with an id, wherever it is referred to, or of that of the shape with it; on
    both sides, in place of ``twosided``. Raise a ValueError if there is none."""
    kinds = mi.ObjectType.BSDF, mi.ObjectType.Shape
    nodes = [(k, it) for k, it in enumerate(state.nodes) if it.type in kinds and it.props.plugin_name() not in GROUPS]
    ids = {node.props.id(): k for k, node in nodes if node.props.id()}
    if id not in ids:
        raise ValueError(f"no BSDF or shape has the id {id}; there are {', '.join(sorted(ids)) or 'none with one'}")
    is_shape = state.nodes[ids[id]].type == mi.ObjectType.Shape
    found = False
    for node in [state.nodes[ids[id]]] if is_shape else _used(state):
        for name in node.props.keys():
            value = node.props[name]
            if isinstance(value, mi.Properties.ResolvedReference):
                usual = state.nodes[value.index()]
                if usual.type == mi.ObjectType.BSDF if is_shape else value.index() == ids[id]:
                    node.props[name] = on_both_sides(bsdf) if usual.props.plugin_name() == "twosided" else bsdf
                    found = True
            elif is_shape and isinstance(value, mi.BSDF):  # which took the place of another one
                node.props[name], found = bsdf, True
    if is_shape and not found:
        state.nodes[ids[id]].props["bsdf"] = bsdf
    elif not found:
        raise ValueError(f"nothing in the scene has the BSDF {id}; name another one, or a shape")


def _used(state: Any) -> list[Any]:
    """Return the nodes of a scene without itself and without BSDFs that nothing else has."""
    used = [k for k, it in enumerate(state.nodes) if it.type not in (mi.ObjectType.Scene, mi.ObjectType.BSDF)]
    for k in used:  # which grows
        used += [it for it in referred(state.nodes[k].props) if it not in used]
    return [state.nodes[k] for k in used]


def on_both_sides(bsdf: mi.BSDF) -> mi.BSDF:
    """Return a BSDF that is seen from behind, too."""
    if _is_seen_from_behind(bsdf):
        return bsdf
    id = bsdf.id()  # which becomes that in the dict
    both = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    bsdf.set_id(id)
    return both


def _is_seen_from_behind(bsdf: mi.BSDF) -> bool:
    return mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)


def with_material(path: Path, id: str, xml: str) -> str:
    """Return the text of a scene file with a ``<bsdf>`` in the place of the BSDF with an id, or of that of the shape
    with it, on both sides in place of ``twosided``; a scene of Mitsuba 0.6 is upgraded. Raise a ValueError if the file
    itself has none, or is no scene."""
    try:
        document = minidom.parseString(upgrade(path).xml.encode())
    except ExpatError as error:
        raise ValueError(f"{path}: {error}") from None
    bsdfs, shapes = (document.getElementsByTagName(tag) for tag in ("bsdf", "shape"))
    by_id = {it.getAttribute("id"): it for it in bsdfs}
    place: Any = next((it for it in (*bsdfs, *shapes) if id and it.getAttribute("id") == id), None)
    if place is None:
        raise ValueError(f"{path} itself has no BSDF or shape with the id {id or 'of this material'}; give it one.")
    if place in shapes:
        refs = [it for it in place.getElementsByTagName("ref") if it.getAttribute("id") in by_id]
        inside = [it for it in place.childNodes if it in bsdfs or it in refs]
        if not inside:
            raise ValueError(f"{path}: the shape {id} has no BSDF to be replaced; give it one.")
        place = inside[0]
    usual = by_id[place.getAttribute("id")] if place.nodeName == "ref" else place
    if usual.getAttribute("type") == "twosided" and not _is_seen_from_behind(load_text(xml, {})):
        xml = f'<bsdf type="twosided">\n{indent(xml, "    ")}\n</bsdf>'
    margin = getattr(place.previousSibling, "data", "").rpartition("\n")[2]
    indented = xml.replace("\n", f"\n{margin if margin.isspace() else ''}")
    given: Any = minidom.parseString(indented).documentElement
    new = document.importNode(given, deep=True)
    referred = {it.getAttribute("id") for it in document.getElementsByTagName("ref")}
    # What a shape has in itself may be that of others, too, who keep it; so is what is in it.
    own = place is usual and (id == place.getAttribute("id") or place.getAttribute("id") not in referred)
    for name in ("name", "id") if own else ("name",):
        if place.hasAttribute(name):
            new.setAttribute(name, place.getAttribute(name))
    place.parentNode.replaceChild(new, place)
    for lost in (place, *place.getElementsByTagName("*")):
        defined = {it.getAttribute("id") for it in document.getElementsByTagName("*") if it.tagName != "ref"}
        if lost.tagName != "ref" and lost.getAttribute("id") in referred - defined:
            root: Any = document.documentElement
            root.appendChild(lost.cloneNode(True))
    return "\n".join(node.toxml() for node in document.childNodes) + "\n"


def _rootless(path: str) -> str:
    absolute = Path(os.path.abspath(path))
    return absolute.relative_to(absolute.anchor).as_posix()


def _set_box_filters(state: Any) -> None:
    for node in state.nodes:
        if node.type == mi.ObjectType.ReconstructionFilter:
            node.props = mi.Properties("box")
    for node in state.nodes:
        filtered = any(state.nodes[place].type == mi.ObjectType.ReconstructionFilter for place in referred(node.props))
        if node.type == mi.ObjectType.Film and not filtered:
            node.props["rfilter"] = mi.load_dict({"type": "box"})
