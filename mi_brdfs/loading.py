"""Scenes of any version of Mitsuba, loaded."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

from .legacy import is_new, root_of, upgrade
from .mentioned import mentioned
from .names import check_name

MESHES = ("ply", "serialized")
"""The shapes whose faces Mitsuba takes as they are."""
NEEDED = {"bitmap": ("filename", "bitmap", "data", "texture"), "blendbsdf": ("weight",), "volume": ("volume",)}
"""Of plugins whose absence ends the process: properties of which they need one."""
DEEPEST = 16
"""How many BSDFs may be in one another: each with two sides doubles what Mitsuba visits."""


def load_legacy(path: str | os.PathLike, *, lenient: bool = False, **parameters: Any) -> Any:
    """Load a scene file of Mitsuba 0.2 to 0.6 as :func:`upgrade` changes it, or one of Mitsuba 3 as it is. A warning
    counts the changes, if there are any.

    Raises:
        ValueError: as :func:`upgrade`.
        RuntimeError: what Mitsuba says where it cannot load the scene, as without a variant.
    """
    if mi.variant() is None:
        raise RuntimeError("No variant is set; first call mi.set_variant, as with llvm_ad_rgb.")
    return load(Path(path), {name: str(value) for name, value in parameters.items()}, lenient, merge=True)


def load(
    path: Path,
    parameters: Mapping[str, str],
    lenient: bool = False,
    merge: bool = False,
    only: str | None = None,
    change: Callable[[Any], None] = lambda state: None,
) -> Any:
    """Load a scene file, old or new, or ``only`` the BSDF in it with an id, and ``change`` it once it is parsed. With
    ``merge``, as Mitsuba does it, BSDFs that are alike become one: it is faster, and ids are lost."""
    with looking_in(path.parent):
        state, upgraded = parsed(path, lenient, parameters)
        config = mi.parser.ParserConfig(mi.variant())
        config.merge_equivalent = merge
        # Meshes would be merged in another order in each process: with lights among them, the noise differs.
        config.merge_meshes = False
        try:
            mi.parser.transform_all(config, state)
            change(state)
            if only is not None:
                state.nodes[0] = state.nodes[_bsdfs(state)[only]]
            return _instantiated(config, state)
        except RuntimeError as error:  # which calls a file that was upgraded, or given a version, a string
            place = f"{path}, upgraded" if upgraded else str(path)
            text = re.sub(r"\b(At|loading) string \(line", lambda found: f"{found[1]} {place} (line", str(error))
            raise RuntimeError(text) from error.__cause__


def ids_of_bsdfs(path: Path, parameters: Mapping[str, str]) -> list[str]:
    """Return the ids of all BSDFs of a scene file, whether or not a shape has them."""
    with looking_in(path.parent):
        return list(_bsdfs(parsed(path, False, parameters)[0]))


def _bsdfs(state: Any) -> dict[str, int]:
    """Return where the BSDFs with ids are in a parsed scene."""
    return {it.props.id(): k for k, it in enumerate(state.nodes) if it.type == mi.ObjectType.BSDF and it.props.id()}


def load_text(text: str, parameters: Mapping[str, str]) -> Any:
    """Load what XML of Mitsuba 3 describes, with a version or without."""
    config = mi.parser.ParserConfig(mi.variant())
    state = mi.parser.parse_string(config, versioned(text), **parameters)
    config.merge_equivalent = False
    mi.parser.transform_all(config, state)
    return _instantiated(config, state)


def parsed(path: Path, lenient: bool, parameters: Mapping[str, str]) -> tuple[Any, str | None]:
    """Return a scene file as Mitsuba's parser has it, and the text of an upgraded one."""
    config = mi.parser.ParserConfig(mi.variant())
    check_name(str(path))
    for it in mentioned([str(path)], values=parameters).values():
        if not os.path.isfile(it):  # Mitsuba would wait for it
            raise ValueError(f"{it}: it is a pipe or a device; name a file.")
    if is_new(path):
        tag, attributes = root_of(path)
        if not tag or "version" in attributes:
            state = mi.parser.parse_file(config, str(path), **parameters)
        else:
            state = mi.parser.parse_string(config, versioned(path.read_text(encoding="utf-8-sig")), **parameters)
        return state, None
    new = upgrade(path, lenient=lenient, **parameters)
    warnings.warn(
        f"{path} is a scene of Mitsuba {new.version} ({new.summary()}); mi-brdfs upgrade says what.", stacklevel=3
    )
    return mi.parser.parse_string(config, new.xml), new.xml


def _instantiated(config: Any, state: Any) -> Any:
    """Return what a parsed scene describes. Raise a ValueError where that would end the process or never end: as
    :func:`check_plugin` and :func:`checked_mesh` do, and for BSDFs that are nested too deeply."""
    bsdfs = dict[int, list[int]]()
    for k, node in enumerate(state.nodes):
        props = mi.Properties(node.props)  # a copy: Mitsuba complains of what was never read in its own
        with suppress(RuntimeError, UnicodeError):  # Mitsuba says it again, with the line
            kind, values = props.plugin_name(), {key: props[key] for key in props.keys()}
            check_plugin(kind, values)
            if node.type == mi.ObjectType.BSDF:
                bsdfs[k] = referred(props)
            if kind in MESHES:
                given = {key: values[key] for key in ("filename", "shape_index") if key in values}
                checked_mesh({"type": kind, **given})
    inner = set(bsdfs)
    for _ in range(DEEPEST):
        inner = {it for outer in inner for it in bsdfs[outer] if it in bsdfs}
    if inner:
        raise ValueError(f"More than {DEEPEST} BSDFs are in one another; nest fewer.")
    return mi.parser.instantiate(config, state)


def referred(props: mi.Properties) -> list[int]:
    """Return the nodes of a parsed scene to which the properties of one refer."""
    values = [props[key] for key in props.keys()]
    return [it.index() for it in values if isinstance(it, mi.Properties.ResolvedReference)]


def check_plugin(kind: str, given: Iterable[str]) -> None:
    """Raise a ValueError unless one of the properties is given without which Mitsuba would end the process."""
    needed = NEEDED.get(kind, ())
    if needed and not set(needed) & set(given):
        raise ValueError(f"{kind}: give it a {needed[0]}.")


def checked_mesh(shape: Mapping[str, Any]) -> mi.Shape:
    """Return a shape, a mesh without normals at its vertices. Raise a ValueError if one of its faces has a vertex that
    is not there: computing normals, and the scene, would end the process."""
    mesh = mi.load_dict({**shape, "face_normals": True} if shape["type"] in MESHES else shape)
    if isinstance(mesh, mi.Mesh) and mesh.face_count():
        wrong = dr.compress(mesh.faces_buffer() >= mesh.vertex_count())
        if len(wrong):
            raise ValueError(
                f"{shape['filename']}: face {wrong[0] // 3 + 1:,} has a vertex that is not among the "
                f"{mesh.vertex_count():,} of the mesh; export it again."
            )
    return mesh


def file_names(state: Any) -> list[tuple[mi.Properties, str]]:
    """Return where a parsed scene names files: the strings of properties that are called so."""
    properties = [(node.props, key) for node in state.nodes for key in node.props.keys() if "file" in key]
    return [(props, key) for props, key in properties if isinstance(props[key], str)]


def versioned(text: str) -> str:
    """Return XML with a version in its root, as Mitsuba 3 demands; as it is if it has one."""
    root = re.match(r"\s*((<!--(?:(?!-->).)*-->|<[?!](?!--)[^>]*>)\s*)*<[\w:]+", text, re.DOTALL)
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
