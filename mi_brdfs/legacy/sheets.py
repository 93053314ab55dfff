"""What changed between versions 0.2 and 0.6 of Mitsuba, as its own upgrades did."""

from __future__ import annotations

from collections.abc import Callable

from .document import Element

TYPES = {
    ("bsdf", "lambertian"): "diffuse",
    ("bsdf", "microfacet"): "roughplastic",
    ("bsdf", "mirror"): "conductor",
    ("bsdf", "roughmetal"): "roughconductor",
    ("bsdf", "roughglass"): "roughdielectric",
    ("bsdf", "composite"): "mixturebsdf",
    ("texture", "exrtexture"): "bitmap",
    ("texture", "ldrtexture"): "bitmap",
    ("film", "exrfilm"): "hdrfilm",
    ("film", "pngfilm"): "ldrfilm",
}
"""The types of 0.2 and 0.3, and what they were called after."""

NAMES = {
    ("sphere", "inverted"): "flip_normals",
    ("cylinder", "p2"): "p1",
    ("cylinder", "p1"): "p0",
    ("checkerboard", "bright_color"): "color0",
    ("checkerboard", "dark_color"): "color1",
    ("gridtexture", "bright_color"): "color0",
    ("gridtexture", "dark_color"): "color1",
    ("ward", "alpha_x"): "alpha_u",
    ("ward", "alpha_y"): "alpha_v",
    ("roughplastic", "alpha_b"): "alpha",
    ("roughconductor", "alpha_b"): "alpha",
    ("roughconductor", "ior"): "eta",
    ("roughdielectric", "alpha_b"): "alpha",
    ("area", "intensity"): "radiance",
    ("constant", "intensity"): "radiance",
    ("directional", "intensity"): "irradiance",
    ("", "luminaire_samples"): "emitter_samples",
    ("", "focus_depth"): "focus_distance",
    ("", "intensity_scale"): "scale",
    ("", "size_multiplier"): "scale",
    ("", "density_multiplier"): "scale",
}
"""Properties that were renamed, by the type, if it matters."""


def modernize(scene: Element, minor: int, say: Callable[[Element, str], None]) -> None:
    """Change a scene of version 0.2 to 0.5 in place to one of 0.6."""
    for element in list(scene.walk()):
        if minor < 3:
            _from_2(element)
        if minor < 4:
            _from_3(element, say)
        if element.tag == "bsdf" and element.type == "bump":
            element.type = "bumpmap"


def _from_2(element: Element) -> None:
    if element.tag == "transform":
        element.children = [it for child in element.children for it in _look_at(child)]
    if element.tag == "shape" and element.type == "obj":
        element.set("boolean", "flip_tex_coords", False)
    if element.tag == "bsdf" and element.type in ("microfacet", "phong", "ward"):
        for colour, default in (("diffuse", 0.5), ("specular", 0.2)):
            if element.type == "microfacet":
                default = {"diffuse": 0.0, "specular": 1.0}[colour]
            amount = element.number(f"{colour}_amount", 1)
            element.pop(f"{colour}_amount")
            name = f"{colour}_reflectance"
            inner = element.pop(name)
            if inner is None:
                element.set("spectrum", name, amount * default)
            else:
                scaled = Element("texture", {"type": "scale", "name": name}, [inner], element.place)
                inner.attributes["name"] = "value"
                scaled.set("float", "scale", amount)
                element.children.append(scaled)
    if element.tag == "bsdf" and element.type == "mirror":
        element.set("string", "material", "Cr")


def _look_at(element: Element) -> list[Element]:
    """Return a <lookAt> of 0.2, of numbers apart, as the one after, whose handedness is another."""
    if element.tag != "lookat" or "ox" not in element.attributes:
        return [element]
    given = element.attributes
    points = {
        name: [given.get(k + axis, "0") for axis in "xyz"]
        for name, k in (("origin", "o"), ("target", "t"), ("up", "u"))
    }
    mirror = Element("scale", {"x": "-1"})
    return [mirror, Element("lookat", {name: ", ".join(it) for name, it in points.items()}, place=element.place)]


def _from_3(element: Element, say: Callable[[Element, str], None]) -> None:
    old = element.tag, element.type
    element.tag = {"camera": "sensor", "luminaire": "emitter"}.get(element.tag, element.tag)
    if now := TYPES.get((element.tag, element.type)):
        element.type = now
    for child in element.children:
        if new := NAMES.get((element.type, child.name)) or NAMES.get(("", child.name)):
            child.attributes["name"] = new
    if old[0] == "camera":
        smaller = element.pop("map_smaller_side")
        if element.type == "perspective":
            element.set("string", "fov_axis", "larger" if smaller and smaller.value == "false" else "smaller")
        if (world := element["to_world"]) is None:
            world = Element("transform", {"name": "to_world"})
            element.children.append(world)
        world.children.insert(0, Element("scale", {"x": "-1"}))
    if element.tag == "film" and (alpha := element.pop("alpha")):
        element.set("string", "pixel_format", "rgba" if alpha.value == "true" else "rgb")
    if old != (element.tag, element.type):
        say(element, f"{old[0]} {old[1]} of 0.3 is {element.tag} {element.type}")
