"""What becomes of BSDFs and textures of Mitsuba 0.6."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..parameters.fresnel import conductors, indices
from .document import Element, plugin, prop, written
from .tables import PLUGINS, rule

if TYPE_CHECKING:
    from .upgrade import Work


def colours(texture: Element) -> list[Element]:
    """Return the constants that a texture is made of: itself, or those of a checkerboard."""
    if texture.type == "checkerboard":
        return [it for it in texture.children if it.name in ("color0", "color1")]
    return [] if texture.tag in PLUGINS else [texture]


def times(texture: Element, factor: list[float]) -> Element:
    """Return a constant or a texture, multiplied by one number, or one in each channel."""
    result = texture.copy(texture.name)
    if texture.tag != "texture":
        result.tag, result.value = "rgb", written(np.multiply(texture.numbers(1, 3), factor).tolist())
    elif constants := colours(texture):
        for it in constants:
            result.put(times(it, factor))
    else:
        result.scale = np.multiply(texture.scale, factor).tolist()
    return result


@rule("", "bsdf")
def _bounded(work: Work, element: Element) -> Element:
    """Return a BSDF whose reflectances are at most 1 in each channel, in phong and ward their sum: 0.6 scales what is
    larger by .99 over the largest value."""
    if element.type == "roughplastic" and (alpha := element["alpha"]) and alpha.tag not in ("float", "integer"):
        element.set("alpha", 0.1)
        work.approximated(element, "alpha of roughplastic cannot be a texture; it is .1")
    names = sorted(
        name for name in element.entry.known if name.endswith(("reflectance", "transmittance", "base_color"))
    )
    defaults = {"diffuse_reflectance": 0.5, "specular_reflectance": 0.2}
    bitmaps: dict[Element, list[float]] = {}
    for group in [names] if element.type in ("phong", "ward") else [[name] for name in names if element[name]]:
        parts = [element[name] or prop(name, [defaults[name]]) for name in group]
        largest = np.max(np.sum([work.maxima(it) for it in parts], axis=0))
        # In single precision .7 + .3 is 1.
        excessive = largest > 1 + 1e-6 and element.text("ensure_energy_conservation") != "false"
        factor = float(0.99 / largest) if excessive else 1.0
        if excessive:
            work.changed(element, f"{' + '.join(group)} of {element.type} is above 1, which 0.6 scales down to .99")
        for part in parts:
            if not colours(work.resolved(part)):
                bitmaps[part] = np.multiply(part.scale, factor).tolist()
            elif excessive:
                element.put(times(part, [factor]))
    # Bitmaps cannot be multiplied, but values can, which most are linear in: by a mixture with a BSDF without bitmaps.
    bitmaps = {part: scale for part, scale in bitmaps.items() if scale != [1.0]}
    if not bitmaps:
        return element
    scales = {it for scale in bitmaps.values() for it in scale}
    share = float(np.clip(np.mean([*scales]), 0, 1))
    linear = element.type != "roughdiffuse" and element.text("nonlinear") != "true"
    say = work.changed if linear and scales == {share} else work.approximated
    say(element, f"the bitmaps of {element.type} are scaled by a mixture of weight {share:.3g}")
    others = [it for name in names if (it := element[name]) not in bitmaps]
    dark = plugin("bsdf", "diffuse", reflectance=[0.0])
    if any(it is None or work.maxima(it).any() for it in others):
        children = [prop(it.name, [0.0]) if it in bitmaps else it.copy(it.name) for it in element.children]
        dark = plugin("bsdf", element.type, *children)
    element.children = [replace(it, scale=[1.0]) if it in bitmaps else it for it in element.children]
    return plugin("bsdf", "blendbsdf", dark, element, weight=share)


@rule("bsdf", "conductor", "roughconductor")
def _conductor(work: Work, element: Element) -> Element:
    if material := element["material"]:  # whose file some systems find in any case
        material.value = {it.lower(): it for it in conductors()}.get(material.value.lower(), material.value)
    exterior = element.pop("ext_eta")
    outside = _index(exterior) if exterior else 1.0
    if np.isclose(outside, 1, atol=1e-3):
        outside = 1.0
    if outside != 1 or element["eta"] or element["k"]:
        _eta_and_k(work, element, outside)
    for it in (it for it in element.of("rgb") if it.name in ("eta", "k")):
        if len(it.numbers()) == 1:
            it.tag = "float"
        elif max(it.numbers()) > 1:
            told = "a colour, of which spectral variants clip what is above 1"
            work.approximated(element, f"{it.name} of {element.type} is {told}")
    if not element["material"] and not element["eta"]:
        element.set("material", "Cu")
        work.changed(element, f"{element.type} without a material is copper, as in 0.6")
    alpha = element.number("alpha", 0.1)
    alphas = {element.number(name, alpha) for name in ("alpha_u", "alpha_v")}
    textured = any(it.name.startswith("alpha") and it.tag not in ("float", "integer") for it in element.children)
    isotropic = len(alphas) == 1 and not textured
    if element.type == "roughconductor" and isotropic and element.text("distribution") in ("phong", "as"):
        work.changed(element, f"distribution {element.text('distribution')} of roughconductor is blinn of microfacet")
        element.pop("alpha", "alpha_u", "alpha_v")
        element.set("distribution", "blinn")
        element.set("exponent", max(2 / max(alphas.pop() ** 2, 1e-8) - 2, 0.1))  # as 0.6 converts α
        element.type = "microfacet"
    return _bounded(work, element)


def _eta_and_k(work: Work, element: Element, outside: float) -> None:
    """Give a conductor eta and k, over the index outside, and no material, which in 0.6 has what is not given."""
    material = element.pop("material")
    if element["eta"] and element["k"] and material and material.value.lower() != "none":
        work.changed(element, f"material of {element.type} goes, as 0.6 takes eta and k before it")
    material = material or prop("material", "Cu")
    for name in ("eta", "k"):
        it = element[name]
        if not it:
            it = prop(name, _of_material(material, name))
            work.changed(element, f"{name} of {element.type} is that of material {material.value}, as a colour")
        element.put(times(it, [1 / outside]))
    if outside != 1:
        work.changed(element, f"eta and k of {element.type} are divided by extEta")


def _of_material(material: Element, name: str) -> list[float]:
    """Return eta or k of a conductor's material, in linear RGB."""
    if material.value.lower() == "none":
        return [0.0 if name == "eta" else 1.0]
    if material.value not in conductors():
        raise material.error(f"{material.value!r} is no metal that Mitsuba knows")
    scalar = importlib.import_module("mitsuba.scalar_rgb")
    spectrum = scalar.spectrum_from_file(str(indices() / f"{material.value}.{name}.spd"))
    return [float(v) for v in scalar.spectrum_list_to_srgb(*spectrum, bounded=False, d65=False)]


def _index(element: Element) -> float:
    """Return an index of refraction, which is a number or the name of a substance."""
    if element.tag != "string":
        return max(element.numbers(1)[0], 1e-6)
    # No variant needs to be set.
    scalar, properties = (importlib.import_module(f"mitsuba.{name}") for name in ("scalar_rgb", "mitsuba_ext"))
    props = properties.Properties()
    props["index"] = element.value
    try:
        return scalar.lookup_ior(props, "index", 1.0)
    except RuntimeError:
        raise element.error(f"{element.value!r} is no index of refraction") from None


@rule("bsdf", "bumpmap", "normalmap")
def _map(work: Work, element: Element) -> Element | None:
    textures = [it for it in element.children if work.resolved(it).tag == "texture"]
    inner = [it for it in element.children if work.resolved(it).tag == "bsdf"]
    if not textures and inner:
        work.dropped(element, f"a {element.type} without a texture")
        return inner[0]
    if element.type == "bumpmap" and inner and any(work.resolved(it).type != "bitmap" for it in textures):
        work.dropped(element, "a bumpmap whose texture is no bitmap, of which Mitsuba 3 knows no slopes")
        return inner[0]
    for texture in textures:
        if element.type == "normalmap":
            texture.name = "normalmap"
        target = work.resolved(texture)
        own = target.copy(texture.name)  # others may refer to it for colours
        if target.scale != [1.0]:
            if element.type == "bumpmap":
                element.set("scale", sum(target.scale) / len(target.scale))
                own.scale = [1.0]
                element.children[element.children.index(texture)] = own
                work.changed(element, "the texture scale in bumpmap is its parameter scale")
        elif target.type == "bitmap" and not target["raw"]:
            own.set("raw", True)  # 0.6 asks for its gamma, as a rule 1
            element.children[element.children.index(texture)] = own
            work.changed(target, f"the bitmap of {element.type} is read as linear numbers")
            continue
        work.tell_of_colours(target, element.type)
    return None


@rule("bsdf", "mask")
def _mask(work: Work, element: Element) -> None:
    if (opacity := element["opacity"]) and not work.is_grey(opacity):
        work.approximated(element, "the opacity of mask is the same in all channels")


@rule("bsdf", "mixturebsdf")
@rule("phase", "mixturephase")
def _mixture(work: Work, element: Element) -> Element:
    parts, given = element.of(element.tag, "ref"), element.pop("weights")
    weights = given.numbers() if given else []
    if len(weights) != len(parts) or not parts:
        raise element.error(f"there are {len(parts)} parts and {len(weights)} weights")
    if min(weights) < 0:
        raise element.error(f"the weight {min(weights):g} is negative")
    if element.tag == "bsdf" and sum(weights) < 1 - 1e-6:  # the rest absorbs
        parts.append(plugin("bsdf", "diffuse", reflectance=[0.0]))
        weights.append(1 - sum(weights))
    elif sum(weights) < 1 - 1e-6:
        work.approximated(element, f"the weights of {element.type} add up to 1: what the rest absorbs is scattered")
    if sum(weights) > 1 + 1e-6 and element.text("ensure_energy_conservation") == "false":
        work.approximated(element, f"the weights of {element.type} are scaled to add up to 1, not {sum(weights):g}")
    work.changed(element, f"{element.type} is blend{element.tag}, nested for more than two")
    return _blend(element.tag, parts, weights)


def _blend(tag: str, parts: list[Element], weights: list[float]) -> Element:
    """Return mixtures of two, as few in one another as can be."""
    if len(parts) == 1:
        return parts[0]
    half, total = len(parts) // 2, sum(weights)
    share = sum(weights[half:]) / total if total > 0 else 0.5
    ends = (_blend(tag, parts[k], weights[k]) for k in (slice(half), slice(half, None)))
    return plugin(tag, f"blend{tag}", *ends, weight=share)


@rule("bsdf", "coating", "roughcoating")
def _coating(work: Work, element: Element) -> Element:
    base = next((it for it in element.children if work.resolved(it).tag == "bsdf"), None)
    if base is None:
        raise element.error("there is no BSDF in it")
    element.children.remove(base)
    inner, was = work.resolved(base), element.type
    glass, air = element["int_ior"] or prop("int_ior", 1.5046), element["ext_ior"] or prop("ext_ior", 1.000277)
    rough, index = was.removesuffix("coating"), _index(glass) / _index(air)
    mean_reflectance = importlib.import_module("mitsuba.scalar_rgb").fresnel_diffuse_reflectance
    if inner.type in ("diffuse", "roughdiffuse"):
        # The coat of a diffuse base is what plastic is, but that light is not sent back and forth between them.
        work.approximated(element, f"{was} over {inner.type} is plastic, without absorption in the coat")
        element.type = f"{rough}plastic"
        element.put(glass)
        reflectance = work.resolved(inner["reflectance"] or prop("reflectance", [0.5]))
        element.put(times(reflectance.copy("diffuse_reflectance"), [1 - mean_reflectance(1 / index)]))
        return _bounded(work, element)
    element.pop("int_ior", "ext_ior")
    share = mean_reflectance(index)
    work.approximated(element, f"{was} is a mixture with a mirror, of the coat's mean reflectance, at all angles")
    element.type = f"{rough}conductor"
    element.set("material", "none")
    return plugin("bsdf", "blendbsdf", base, element, weight=round(share, 4))


@rule("texture", "bitmap", "checkerboard")
def _texture(work: Work, element: Element) -> None:
    """0.6 scales the coordinates before it adds the offsets."""
    both = element.number("uvscale", 1)
    scale = {axis: written(element.number(f"{uv}scale", both)) for axis, uv in ("xu", "yv")}
    offset = {axis: written(element.number(f"{uv}offset", 0)) for axis, uv in ("xu", "yv")}
    if element.pop("uvscale", "uscale", "vscale", "uoffset", "voffset"):
        element.put(Element("transform", {}, [Element("scale", scale), Element("translate", offset)], name="to_uv"))
    modes = [element.text(f"wrap_mode_{axis}") or element.text("wrap_mode") or "repeat" for axis in "uv"]
    if element.pop("wrap_mode_u", "wrap_mode_v"):
        element.set("wrap_mode", "repeat" if "repeat" in modes else modes[0])
        say = work.changed if len({*modes}) == 1 else work.approximated
        say(element, f"wrap_mode_u and wrap_mode_v of bitmap are wrap_mode {element.text('wrap_mode')}")
    gamma = element.number("gamma", 0)
    if element.pop("gamma", "srgb"):
        element.set("raw", gamma == 1)
    if gamma == 1:
        work.changed(element, "gamma 1 of bitmap is raw")
    elif gamma > 0 and gamma != 2.2:
        work.approximated(element, f"gamma {gamma:g} of bitmap is that of its file, as a rule sRGB")


@rule("texture", "scale")
def _scale(work: Work, element: Element) -> Element:
    factor = element.pop("scale") or prop("scale", 1.0)
    inner = next((work.resolved(it) for it in element.of("rgb", "float", "texture", "ref")), prop("", [1.0]))
    if inner.tag != "texture":
        work.changed(element, "the texture scale of a colour is the product")
    return times(inner.copy(element.name), factor.numbers())
