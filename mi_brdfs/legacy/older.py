"""Scenes of Mitsuba 0.2 to 0.5 as scenes of 0.6."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from .document import Element, plugin, prop
from .tables import PLUGINS

DEFAULTS: dict[str, list[tuple[str, Any]]] = {
    "obj": [("flip_tex_coords", False)], "mirror": [("material", "Cr")], "roughmetal": [("ior", 0.37), ("k", 2.82)],
}  # fmt: skip
"""What 0.2 has where it is not given, by the type of a plugin."""


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
    if element.tag == "shape" and element.of("luminaire") and not element.of("bsdf", "ref", "subsurface"):
        element.children.append(plugin("bsdf", "diffuse"))  # since 0.3 it is black
    for look_at in (it for it in element.of("lookat") if "ox" in it.attributes):
        # The handedness is another, and the numbers stand apart.
        numbers = look_at.attributes
        look_at.attributes = {
            name: ", ".join(numbers.get(name[0] + axis, "0") for axis in "xyz") for name in ("origin", "target", "up")
        }
        element.children.insert(element.children.index(look_at), Element("scale", {"x": "-1"}))
    if element.tag == "bsdf" and element.type in ("microfacet", "phong", "ward"):
        defaults = (0.0, 1.0) if element.type == "microfacet" else (0.5, 0.2)
        for colour, default in zip(("diffuse", "specular"), defaults, strict=True):
            name, amount = f"{colour}_reflectance", element.number(f"{colour}_amount", 1)
            element.pop(f"{colour}_amount")
            inner = element.pop(name) or prop(name, [default])
            inner.name = "value"
            scaled = plugin("texture", "scale", inner, scale=amount)
            element.put(replace(scaled, name=name, place=element.place))
    if element.type == "cylinder" and element["p2"]:
        for child in element.children:
            child.name = {"p1": "p0", "p2": "p1"}.get(child.name, child.name)
    for name, value in DEFAULTS.get(element.type, []):
        if not element[name]:
            element.set(name, value)


def _from_3(element: Element, say: Callable[[Element, str], None]) -> None:
    old = element.tag, element.type
    element.tag = {"camera": "sensor", "luminaire": "emitter"}.get(element.tag, element.tag)
    if new := PLUGINS.get(element.tag, {}).get(f"{element.type}*"):
        element.type = new.type
    for child in element.children:
        child.name = element.entry.renamed.get(f"{child.name}*", child.name)
    if old[0] == "camera":
        smaller = element.pop("map_smaller_side")
        if element.type == "perspective":
            element.set("fov_axis", "larger" if smaller and smaller.value == "false" else "smaller")
        element.to_world().children.insert(0, Element("scale", {"x": "-1"}))
    if element.tag == "blackbody" and "multiplier" in element.attributes:
        element.attributes["scale"] = element.attributes.pop("multiplier")
    if element.tag == "film" and (alpha := element.pop("alpha")):
        element.set("pixel_format", "rgba" if alpha.value == "true" else "rgb")
    if old != (element.tag, element.type):
        say(element, f"{old[0]} {old[1]} of 0.3 is {element.tag} {element.type}")
