"""What becomes of the plugins of Mitsuba 0.6 that take more than another name."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..math import gauss_legendre
from .document import Element, plugin, prop, written
from .tables import PLUGINS

if TYPE_CHECKING:
    from .upgrade import Work

Rule = Callable[["Work", Element], Element | None]
RULES: dict[tuple[str, str], Rule] = {}
"""The functions that change a plugin, whose parts are those of Mitsuba 3, in place, or return what replaces it."""


def rule(kind: str, *types: str) -> Callable[[Rule], Rule]:
    def declare(function: Rule) -> Rule:
        RULES.update({(kind, type): function for type in types})
        return function

    return declare


def colours(texture: Element) -> list[Element]:
    """Return the constants that a texture is made of: itself, or those of a checkerboard."""
    if texture.type == "checkerboard":
        return [it for it in texture.children if it.name in ("color0", "color1")]
    return [] if texture.tag == "texture" else [texture]


def times(texture: Element, factor: list[float]) -> Element:
    """Return a constant or a texture, multiplied by one number, or one in each channel."""
    if texture.tag != "texture":
        return prop(texture.name, np.multiply(texture.numbers(1, 3), factor).tolist())
    result = texture.copy(texture.name)
    if constants := colours(texture):
        for it in constants:
            result.put(times(it, factor))
    else:
        result.scale = np.multiply(texture.scale, factor).tolist()
    return result


def scaled_down(work: Work, element: Element, *names: str) -> Element:
    """Return a BSDF whose reflectances of these names, which have maxima in each channel, add up to at most 1: where
    they do not, 0.6 scales all by .99 over the largest sum."""
    defaults = {"specular_reflectance": 0.2 if element.type in ("phong", "ward") else 1.0}
    parts = [work.resolved(element[name] or prop(name, [defaults.get(name, 0.5)])).copy(name) for name in names]
    largest = np.max(np.sum([work.maxima(it) for it in parts], axis=0))
    factor = 1.0
    # In single precision .7 + .3 is 1.
    if largest > 1 + 1e-6 and element.text("ensure_energy_conservation") != "false":
        factor = float(0.99 / largest)
        work.changed(element, f"{' + '.join(names)} of {element.type} is above 1, which 0.6 scales down to .99")
    # Bitmaps cannot be multiplied, but the BSDF can, if the constants make up for what is not to be.
    bitmaps = [it for part in parts if not colours(part) and (it := element[part.name])]
    share = factor if bitmaps else 1.0
    scales = {scale for it in bitmaps for scale in it.scale}
    if len(scales) == 1 and (scale := scales.pop()) > 0 and not element.type.endswith(("plastic", "electric")):
        constants = [it for part in parts for colour in colours(part) for it in colour.numbers()]
        if max([factor * scale, *(it / scale for it in constants)]) <= 1:
            share = factor * scale
            element.children = [replace(it, scale=[1.0]) if it in bitmaps else it for it in element.children]
    for part in parts:
        multiplied = times(part, [factor / share])
        for colour in colours(multiplied):
            if (limited := np.clip(colour.numbers(), 0, 1).tolist()) != colour.numbers():
                work.approximated(element, f"{part.name} of {element.type} is limited to 0 … 1")
                colour.value = written(limited)
        if colours(part) and [it.value for it in colours(part)] != [it.value for it in colours(multiplied)]:
            element.put(multiplied)
    if share == 1:
        return element
    return plugin("bsdf", "blendbsdf", plugin("bsdf", "diffuse", reflectance=[0.0]), element, weight=share)


@rule("bsdf", "phong", "ward", "roughdiffuse", "diffuse")
def _classical(work: Work, element: Element) -> Element:
    entry = PLUGINS["bsdf"][element.type]
    if variant := element["variant"]:
        variant.value = variant.value.strip().lower()
    if element.type == "ward":
        pair_of_alpha(work, element)
    for child in element.of("float"):
        low, high = entry.limits.get(child.name, (-math.inf, math.inf))
        if not low <= float(child.value) <= high:
            work.approximated(child, f"{child.name} of {element.type} is limited to {low:g} … {high:g}")
            child.value = written(min(max(float(child.value), low), high))
    return scaled_down(work, element, *sorted(name for name in entry.known if "reflectance" in name))


@rule("bsdf", "plastic", "roughplastic", "dielectric", "thindielectric", "roughdielectric")
def _dielectric(work: Work, element: Element) -> Element | None:
    rough_alpha(work, element)
    if element.type == "roughplastic" and (alpha := element["alpha"]) and alpha.tag not in ("float", "integer"):
        element.set("alpha", 0.1)
        work.approximated(element, "alpha of roughplastic cannot be a texture; it is .1")
    for name in ("diffuse_reflectance", "specular_reflectance", "specular_transmittance"):
        if name in element and (result := scaled_down(work, element, name)) is not element:
            return result
    return None


@rule("bsdf", "conductor", "roughconductor")
def _conductor(work: Work, element: Element) -> Element:
    if exterior := element.pop("ext_eta"):
        named = {"air": 1.000277, "vacuum": 1.0, "water": 1.333}
        index = float(exterior.value) if exterior.tag == "float" else named.get(exterior.value.strip().lower(), 0.0)
        for name in ("eta", "k"):
            if (value := element[name]) and value.tag in ("rgb", "float") and index:
                element.put(times(value, [1 / index]))
                work.changed(element, f"{name} of {element.type} is divided by extEta")
        if not ("eta" in element and index):
            work.approximated(element, f"{element.type} is as in air: extEta has no successor")
    if "material" not in element and "eta" not in element:
        element.set("material", "Cu")
        work.changed(element, f"{element.type} without a material is copper, as in 0.6")
    if element.text("distribution") in ("phong", "as"):
        return _blinn(work, element)
    rough_alpha(work, element)
    return scaled_down(work, element, *["specular_reflectance"] * ("specular_reflectance" in element))


def _blinn(work: Work, element: Element) -> Element:
    """0.6 converts α to the exponent of the cosine: n = 2/α² - 2."""
    work.changed(element, f"distribution {element.text('distribution')} of roughconductor is blinn of microfacet")
    alpha = element.number("alpha", 0.1)
    u, v = (element.number(name, alpha) for name in ("alpha_u", "alpha_v"))
    if u != v:
        work.approximated(element, "anisotropic roughness of that distribution is its geometric mean")
    element.type = "microfacet"
    element.pop("alpha", "alpha_u", "alpha_v")
    element.set("distribution", "blinn")
    element.set("exponent", max(2 / max(u * v, 1e-8) - 2, 0.1))
    element.set("diffuse_reflectance", [0.0])
    return element


def rough_alpha(work: Work, element: Element) -> None:
    """Change the roughness of a BSDF to what Mitsuba 3 takes."""
    if (distribution := element.text("distribution")) and distribution != "ggx":
        element.set("distribution", "beckmann")
        if distribution != "beckmann":
            work.approximated(element, f"distribution {distribution} of {element.type} is beckmann of the same alpha")
    pair_of_alpha(work, element)


def pair_of_alpha(work: Work, element: Element) -> None:
    """0.6 takes alpha for what is not given of the pair beside it."""
    missing = [name for name in ("alpha_u", "alpha_v") if name not in element]
    if len(missing) < 2 and (alpha := element.pop("alpha")):
        element.children += [alpha.copy(name) for name in missing]
        work.changed(element, f"alpha of {element.type} is what alphaU and alphaV are where they are not given")


@rule("bsdf", "bumpmap", "normalmap")
def _map(work: Work, element: Element) -> Element | None:
    textures = [it for it in element.children if work.resolved(it).tag == "texture"]
    inner = [it for it in element.children if work.resolved(it).tag == "bsdf"]
    if not textures and inner:
        work.dropped(element, f"a {element.type} without a texture")
        return inner[0]
    for texture in textures:
        if element.type == "normalmap":
            texture.name = "normalmap"
        target = work.resolved(texture)
        if target.scale != [1.0] and element.type == "bumpmap":
            element.set("scale", sum(target.scale) / len(target.scale))
            target.scale = [1.0]
            work.changed(element, "the texture scale in bumpmap is its parameter scale")
        if target.type == "bitmap" and "raw" not in target:
            target.set("raw", True)
            work.changed(target, f"the bitmap of {element.type} is read as linear numbers")
    return None


@rule("bsdf", "mixturebsdf")
@rule("phase", "mixturephase")
def _mixture(work: Work, element: Element) -> Element:
    parts, given = element.of(element.tag, "ref"), element.pop("weights")
    weights = given.numbers() if given else []
    if len(weights) != len(parts) or not parts or min(weights) < 0:
        raise element.error(f"there are {len(parts)} parts and {len(weights)} weights")
    if element.tag == "bsdf" and sum(weights) < 1 - 1e-6:  # the rest absorbs
        parts.append(plugin("bsdf", "diffuse", reflectance=[0.0]))
        weights.append(1 - sum(weights))
    blend = {"bsdf": "blendbsdf", "phase": "blendphase"}[element.tag]
    work.changed(element, f"{element.type} is {blend}, nested for more than two")
    result, total = parts.pop(), weights.pop()
    while parts:
        weight = weights.pop()
        total += weight
        share = 1 - weight / total if total > 0 else 0.5
        result = plugin(element.tag, blend, parts.pop(), result, weight=share)
    return result


@rule("bsdf", "coating", "roughcoating")
def _coating(work: Work, element: Element) -> Element | None:
    base = next((it for it in element.children if work.resolved(it).tag == "bsdf"), None)
    if base is None:
        raise element.error("there is no BSDF in it")
    element.children.remove(base)
    inner, was = work.resolved(base), element.type
    rough = was.removesuffix("coating")
    if inner.type in ("diffuse", "roughdiffuse"):
        # The coat of a diffuse base is what plastic is.
        work.approximated(element, f"{was} over {inner.type} is plastic, without absorption in the coat")
        element.type = f"{rough}plastic"
        element.set("nonlinear", True)
        if reflectance := inner["reflectance"]:
            element.put(reflectance.copy("diffuse_reflectance"))
        rough_alpha(work, element)
        return None
    index = element.number("int_ior", 1.5046) / (element.number("ext_ior", 1.000277) or 1.0)  # glass in air, as in 0.6
    element.pop(*(it.name for it in element.of("float") if it.name in ("int_ior", "ext_ior")))
    fresnel = importlib.import_module("mitsuba.scalar_rgb").fresnel
    share = sum(2 * weight * cos * fresnel(cos, index)[0] for cos, weight in gauss_legendre(8))
    work.approximated(element, f"{was} is a mixture with a mirror, of the coat's mean reflectance, at all angles")
    element.type = f"{rough}conductor"
    element.set("material", "none")
    rough_alpha(work, element)
    return plugin("bsdf", "blendbsdf", base, element, weight=round(share, 4))


@rule("texture", "bitmap", "checkerboard")
def _texture(work: Work, element: Element) -> None:
    """0.6 scales the coordinates before it adds the offsets."""
    both = element.number("uvscale", 1)
    scale = {axis: written(element.number(f"{uv}scale", both)) for axis, uv in ("xu", "yv")}
    offset = {axis: written(element.number(f"{uv}offset", 0)) for axis, uv in ("xu", "yv")}
    if element.pop("uvscale", "uscale", "vscale", "uoffset", "voffset"):
        steps = [Element("scale", scale), Element("translate", offset)]
        element.children.append(Element("transform", {"name": "to_uv"}, steps))
    if element.type == "checkerboard":
        return
    gamma = element.pop("gamma", "srgb")
    if gamma and gamma.tag == "float" and float(gamma.value) == 1:
        element.set("raw", True)
        work.changed(element, "gamma 1 of bitmap is raw")
    elif gamma and gamma.tag == "float" and float(gamma.value) > 0 and float(gamma.value) != 2.2:
        work.approximated(element, f"gamma {gamma.value} of bitmap is that of its file, as a rule sRGB")
    if element.text("filter_type") not in ("", "nearest"):
        element.set("filter_type", "bilinear")
    if wrap := element.pop("wrap_mode_u", "wrap_mode_v") or element["wrap_mode"]:
        mode = wrap.value.strip().lower()
        element.set("wrap_mode", mode if mode in ("repeat", "mirror", "clamp") else "clamp")
        if mode in ("zero", "one"):
            work.approximated(element, f"wrapMode {mode} of bitmap is clamp")


@rule("texture", "scale")
def _scale(work: Work, element: Element) -> Element:
    factor = element.pop("scale") or prop("scale", 1.0)
    inner = next((work.resolved(it) for it in element.of("rgb", "float", "texture", "ref")), prop("", [1.0]))
    if inner.tag != "texture":
        work.changed(element, "the texture scale of a colour is the product")
    return times(inner.copy(element.name), factor.numbers())


@rule("emitter", "sun", "sky", "sunsky")
def _sunsky(work: Work, element: Element) -> None:
    work.approximated(element, f"{element.type} is sunsky, turned to where Y is up; it has other data")
    scale = element.pop("scale")
    for part in ("sun", "sky"):
        if part not in element.type:
            element.set(f"{part}_scale", 0.0)
        elif scale and f"{part}_scale" not in element:
            element.set(f"{part}_scale", scale.numbers()[0])
    if radius := element.pop("sun_radius_scale"):
        element.set("sun_aperture", 0.5358 * radius.numbers()[0])
    element.type = "sunsky"
    # Z is up there, and Y in 0.6.
    element.to_world().children.insert(0, Element("rotate", {"x": "1", "angle": "-90"}))


@rule("film", "hdrfilm", "ldrfilm", "mfilm", "tiledhdrfilm")
def _film(work: Work, element: Element) -> None:
    if element.type != "hdrfilm":
        element.pop("file_format")
        work.changed(element, f"{element.type} is hdrfilm, whose values are linear; mi-brdfs render writes a PNG, too")
    element.type = "hdrfilm"
    if given := element.pop("pixel_format"):
        word = given.value.lower().split(",")[0].strip().replace("spectrum", "rgb").replace("rgbalpha", "rgba")
        element.set("pixel_format", word.replace("ealpha", "e_alpha"))
        if word != given.value.strip().lower():
            work.approximated(element, f"pixelFormat {given.value} is {word}")


@rule("sensor", "perspective", "thinlens")
def _perspective(work: Work, element: Element) -> None:
    if not ("fov" in element or "focal_length" in element):
        element.pop("fov_axis")
        element.set("focal_length", "50mm")


@rule("medium", "homogeneous")
def _homogeneous(work: Work, element: Element) -> None:
    values = {
        name: it.numbers(1, 3) for name in ("sigma_s", "sigma_a", "sigma_t", "albedo") if (it := element.pop(name))
    }
    if "material" in element or not values:
        work.approximated(element, f"the medium {element.text('material')} has the coefficients of skin")
        element.pop("material")
        # In 1/mm: H. W. Jensen et al., A practical model for subsurface light transport, SIGGRAPH 2001.
        values = values or {"sigma_s": [0.74, 0.88, 1.01], "sigma_a": [0.032, 0.17, 0.48]}
    if "sigma_t" not in values:
        scattered, absorbed = (np.array(values.get(name, [0.0])) for name in ("sigma_s", "sigma_a"))
        extinct = scattered + absorbed
        albedo = np.divide(scattered, extinct, np.zeros_like(extinct), where=extinct != 0)
        values = {"sigma_t": extinct.tolist(), "albedo": albedo.tolist()}
        work.changed(element, "sigmaS and sigmaA of a medium are sigma_t and albedo")
    # Colours are at most 1 there; the scale carries the rest.
    most = max(1.0, *values["sigma_t"])
    element.set("sigma_t", [v / most for v in values["sigma_t"]])
    element.set("albedo", values.get("albedo", [0.75]))
    element.set("scale", element.number("scale", 1) * most)
