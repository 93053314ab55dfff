"""What becomes of emitters, sensors, integrators, shapes and media of Mitsuba 0.6."""

from __future__ import annotations

import importlib
import re
import struct
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from .document import Element, prop, written
from .tables import rule

if TYPE_CHECKING:
    from .upgrade import Work

SMALLEST_SUN = 0.05
"""What Mitsuba 3 draws of a sun without width, in degrees."""
HEAD = 1 << 16
"""The bytes of a mesh in which an OBJ's library of materials is named, and a PLY says what is in it."""


@rule("emitter", "sun", "sky", "sunsky")
def _sunsky(work: Work, element: Element) -> None:
    work.approximated(element, f"{element.type} is sunsky, turned to where Y is up; it has other data")
    scale = element.pop("scale")
    for part in ("sun", "sky"):
        if part not in element.type:
            element.set(f"{part}_scale", 0.0)
        elif scale and not element[f"{part}_scale"]:
            element.set(f"{part}_scale", scale.numbers()[0])
    if radius := element.pop("sun_radius_scale"):
        aperture = 0.5358 * radius.numbers()[0]
        element.set("sun_aperture", max(aperture, SMALLEST_SUN))
        if aperture < SMALLEST_SUN:
            work.approximated(element, f"the sun is {SMALLEST_SUN}° wide")
    element.type = "sunsky"
    # Z is up there, north -X and east -Y, as in a mirror; in 0.6 Y is up, north -Z and east X.
    turn = Element("matrix", value="0 -1 0 0 0 0 1 0 1 0 0 0 0 0 0 1")
    element.to_world().children.insert(0, turn)


@rule("sensor", "perspective", "thinlens")
def _perspective(work: Work, element: Element) -> None:
    if not element["fov"]:
        element.pop("fov_axis")  # a focal length, by default 50 mm, is that of the diagonal
    if (transform := element["to_world"]) and transform.of("scale", "matrix"):  # which Mitsuba 3 refuses
        matrix = _matrix(transform)
        u, _, v = np.linalg.svd(matrix[:3, :3])
        matrix[:3, :3] = u @ v
        transform.children = [Element("matrix", value=" ".join(f"{v:.9g}" for v in matrix.ravel()))]


def _matrix(transform: Element) -> Any:
    """Return the matrix of a transform, shape (4, 4)."""
    importlib.import_module("mitsuba.scalar_rgb")  # which knows what a transform is
    text = Element("sensor", {"version": "3.0.0"}, [transform], "perspective").to_xml()
    refusal = transform.error("it is no transform, or looks nowhere")
    try:
        parsed = mi.parser.parse_string(mi.parser.ParserConfig("scalar_rgb"), text)
    except RuntimeError:
        raise refusal from None
    matrix = np.array(parsed.nodes[0].props["to_world"].matrix)
    if not np.isfinite(matrix).all():
        raise refusal
    return matrix


@rule("integrator", "direct")
def _direct(work: Work, element: Element) -> None:
    kinds = "emitter_samples", "bsdf_samples"
    if any(element[name] for name in kinds) and (both := element.pop("shading_samples")):
        for name in kinds:
            element.put(element[name] or both.copy(name))


@rule("shape", "sphere", "cylinder")
def _round(work: Work, element: Element) -> None:
    if not (transform := element["to_world"]):
        return
    matrix = _matrix(transform)
    # In 0.6 a mirrored sphere does not turn inside out, and a mirrored cylinder does: the other way round than here.
    if np.linalg.det(matrix[:3, :3]) < 0:
        element.set("flip_normals", element.text("flip_normals") != "true")
    # What scales a sphere does not move its centre.
    if element["center"] and (scale := float(np.linalg.norm(matrix[:3, 0]))) > 0:
        transform.children.insert(0, Element("scale", value=written(1 / scale)))
        element.set("radius", scale * element.number("radius", 1))


@rule("shape", "rectangle", "cube", "serialized")
def _mirrored(work: Work, element: Element) -> None:
    """Keep the inside of a mirrored shape inside: 0.6 turns the faces of serialized meshes, and finds the exterior
    medium on that side of a face on which its vertex normals are."""
    transform, others = element["to_world"], {"interior": "exterior", "exterior": "interior"}
    media = [it for it in element.children if it.name in others]
    if not transform or not (media or element.type == "serialized"):
        return
    if np.linalg.det(_matrix(transform)[:3, :3]) >= 0:
        return
    if element.text("face_normals") != "true" and _has_vertex_normals(work, element):
        for it in media:
            it.name = others[it.name]
            work.changed(element, f"the {it.name} of a mirrored {element.type} was the other one")
    elif element.type == "serialized":
        element.set("flip_normals", element.text("flip_normals") != "true")
        work.changed(element, "a mirrored serialized mesh has flip_normals")


def _has_vertex_normals(work: Work, element: Element) -> bool:
    if element.type in ("rectangle", "cube"):
        return True
    if not (name := element["filename"]):  # of a file that is missing
        return False
    content = (work.folder / name.value).read_bytes()
    if element.type == "obj":
        return re.search(rb"^\s*vn\s", content, re.MULTILINE) is not None
    if element.type == "ply":
        return re.search(rb"^property\s+\w+\s+nx\s*$", content[:HEAD], re.MULTILINE) is not None
    with suppress(struct.error, zlib.error, IndexError):
        # The offsets of the meshes stand at the end, and each begins with flags, compressed.
        (version,), (count,) = struct.unpack_from("<H", content, 2), struct.unpack_from("<I", content, len(content) - 4)
        offsets = struct.Struct(f"<{count}{'Q' if version > 3 else 'I'}")
        index = int(element.number("shape_index", 0))
        start = offsets.unpack_from(content, len(content) - 4 - offsets.size)[index] + 4
        return zlib.decompressobj().decompress(content[start:], 4)[0] & 1 > 0
    return False


@rule("shape", "obj")
def _obj(work: Work, element: Element) -> None:
    _mirrored(work, element)
    bsdfs = [it for it in element.children if work.resolved(it).tag == "bsdf"]
    if len(bsdfs) > 1:
        element.children = [it for it in element.children if it not in bsdfs[1:]]
        work.approximated(element, f"the obj has the first of its {len(bsdfs)} BSDFs; split its file by usemtl")
    elif not bsdfs and (name := element["filename"]):
        with (work.folder / name.value).open("rb") as file:
            if re.search(rb"^\s*mtllib\s", file.read(HEAD), re.MULTILINE):
                work.dropped(element, f"the materials of {name.value}; split it by usemtl, and give each part a BSDF")


@rule("shape", "ply")
def _ply(work: Work, element: Element) -> None:
    _mirrored(work, element)
    encoded, name = not (srgb := element.pop("srgb")) or srgb.value == "true", element["filename"]
    attributes = [it for it in work.reached(element) if it.type == "mesh_attribute"]
    if not attributes or name is None:
        return
    with (work.folder / name.value).open("rb") as file:
        bytes_ = re.search(rb"^property\s+(uchar|uint8)\s+(red|r)\s*$", file.read(HEAD), re.MULTILINE)
    if bytes_:  # which 0.6 divides by the largest
        for it in attributes:
            it.set("scale", 1 / 255)
    if encoded:
        work.approximated(element, f"the colours in {name.value} are read as linear, which 0.6 decodes from sRGB")


@rule("shape", "instance")
def _instance(work: Work, element: Element) -> None:
    """Put shape groups beside the instances that they are in: Mitsuba 3 takes references alone."""
    for k, group in enumerate(element.children):
        if group.type == "shapegroup":
            group.id = group.id or f"shapegroup_{len(work.lifted)}"
            work.ids[group.id] = group
            work.lifted.append(group)
            element.children[k] = Element("ref", id=group.id)
            work.changed(group, "the shapegroup in an instance stands beside it")


SKIN = np.array([74.0, 88.0, 101.0]), np.array([3.2, 17.0, 48.0])
"""σs and σa of 0.6's preset skin1, from which it takes what a medium does not give: 100 times those in 1/mm of H. W.
Jensen et al., A practical model for subsurface light transport, SIGGRAPH 2001."""


@rule("medium", "homogeneous")
def _homogeneous(work: Work, element: Element) -> None:
    scattered, absorbed = _coefficient(element, "sigma_s", SKIN[0]), _coefficient(element, "sigma_a", SKIN[1])
    extinct = scattered + absorbed
    albedo = _coefficient(element, "albedo", scattered / np.maximum(extinct, 1e-30))
    extinct = _coefficient(element, "sigma_t", extinct)
    if (preset := element.text("material") or "skin1") != "skin1":
        work.approximated(element, f"the medium {preset} has the coefficients of skin1")
    # Colours are at most 1 there; the scale carries the rest.
    most = max(1.0, *extinct.tolist())
    element.set("sigma_t", (extinct / most).tolist())
    element.set("albedo", albedo.tolist())
    element.set("scale", element.number("scale", 1) * most)
    work.changed(element, "the coefficients of a medium are sigma_t and albedo; those not given are of skin1")


@rule("medium", "heterogeneous")
def _heterogeneous(work: Work, element: Element) -> None:
    density = element["sigma_t"] and work.resolved(element["sigma_t"])
    if density and density.type == "constvolume":
        element.type = "homogeneous"
        element.set("sigma_t", float(np.mean((density["value"] or prop("value", 1.0)).numbers())))
        work.changed(element, "a heterogeneous medium of one density is homogeneous; the other is in a unit cube alone")


def _coefficient(element: Element, name: str, default: Any) -> Any:
    """Take a coefficient of a medium out, for each channel."""
    found = element.pop(name)
    return np.array(found.numbers(1, 3)) if found else default
