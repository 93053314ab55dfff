"""What becomes of scenes of Mitsuba 0.2 to 0.5, and of plugins of 0.6 that take more than another name."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from ..parameters.fresnel import conductors, indices
from .document import Element, plugin, prop, written
from .tables import PLUGINS

if TYPE_CHECKING:
    from .upgrade import Work

RULES: dict[tuple[str, str], Callable[[Work, Element], Element | None]] = {}
"""The functions that change a plugin of a kind and a type, whose parts are those of Mitsuba 3, in place, or return what
replaces it. Under "" and a kind is the one for all its other types."""
DEFAULTS: dict[str, list[tuple[str, Any]]] = {
    "obj": [("flip_tex_coords", False)], "mirror": [("material", "Cr")], "roughmetal": [("ior", 0.37), ("k", 2.82)],
}  # fmt: skip
"""What 0.2 has where it is not given, by the type of a plugin."""
SMALLEST_SUN = 0.05
"""What Mitsuba 3 draws of a sun without width, in degrees."""
HEAD = 1 << 16
"""The bytes of an OBJ file in which its library of materials is named."""


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
    if element.tag == "film" and (alpha := element.pop("alpha")):
        element.set("pixel_format", "rgba" if alpha.value == "true" else "rgb")
    if old != (element.tag, element.type):
        say(element, f"{old[0]} {old[1]} of 0.3 is {element.tag} {element.type}")


def rule(kind: str, *types: str) -> Callable:
    def declare(function: Any) -> Any:
        RULES.update({(kind, type): function for type in types})
        return function

    return declare


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
    if element["eta"] or element["k"]:
        _eta_and_k(work, element)
    exterior, given = element.pop("ext_eta"), [it for it in element.of("rgb", "float") if it.name in ("eta", "k")]
    if exterior and given:
        for it in given:
            element.put(times(it, [1 / _index(exterior)]))
        work.changed(element, f"eta and k of {element.type} are divided by extEta")
    elif exterior and not np.isclose(_index(exterior), 1, atol=1e-3):
        work.dropped(element, "extEta beside the spectra of a metal, which are not divided by it: they are as in air")
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


def _eta_and_k(work: Work, element: Element) -> None:
    """Give a conductor that has eta or k both, and no material, which in 0.6 has the one that is not given."""
    material = element.pop("material")
    if missing := next((name for name in ("eta", "k") if not element[name]), ""):
        material = material or prop("material", "Cu")
        element.put(prop(missing, _of_material(material, missing)))
        work.changed(element, f"{missing} of {element.type} is that of material {material.value}, as a colour")
    elif material and material.value.lower() != "none":
        work.changed(element, f"material of {element.type} goes, as 0.6 takes eta and k before it")


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
        if target.type == "bitmap" and target.text("raw") != "true" and work.values(target).shape[1] > 1:
            told = "is decoded, as in 0.6; spectral variants of Mitsuba 3 take grey or raw ones only"
            work.changed(target, f"the bitmap of {element.type} {told}")
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


@rule("shape", "obj")
def _obj(work: Work, element: Element) -> None:
    bsdfs = [it for it in element.children if work.resolved(it).tag == "bsdf"]
    if len(bsdfs) > 1:
        element.children = [it for it in element.children if it not in bsdfs[1:]]
        work.approximated(element, f"the obj has the first of its {len(bsdfs)} BSDFs; split its file by usemtl")
    elif not bsdfs and (name := element["filename"]):
        with (work.folder / name.value).open("rb") as file:
            if re.search(rb"^\s*mtllib\s", file.read(HEAD), re.MULTILINE):
                work.dropped(element, f"the materials of {name.value}; split it by usemtl, and give each part a BSDF")


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


def _coefficient(element: Element, name: str, default: Any) -> Any:
    """Take a coefficient of a medium out, for each channel."""
    found = element.pop(name)
    return np.array(found.numbers(1, 3)) if found else default
