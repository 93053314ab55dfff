"""What becomes of the plugins of Mitsuba 0.6 in Mitsuba 3: their names and properties there, and what is nearest to
those without a successor."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from .document import Element

if TYPE_CHECKING:
    from .upgrade import Work

DIELECTRIC = "int_ior ext_ior specular_reflectance specular_transmittance"
METAL = "material eta k specular_reflectance"
ROUGH = "distribution alpha alpha_u alpha_v"
MESH = "filename face_normals flip_normals to_world"
CAMERA = "to_world near_clip far_clip focus_distance shutter_open shutter_close"
PATH = "max_depth rr_depth hide_emitters"
SKY = """turbidity albedo sun_direction latitude longitude timezone year month day hour minute second sun_scale
    sky_scale sun_aperture to_world sampling_weight"""

KNOWN: dict[str, dict[str, str]] = {
    "bsdf": {
        "diffuse": "reflectance", "dielectric": DIELECTRIC, "thindielectric": DIELECTRIC,
        "roughdielectric": f"{DIELECTRIC} {ROUGH}", "conductor": METAL, "roughconductor": f"{METAL} {ROUGH}",
        "plastic": "int_ior ext_ior diffuse_reflectance specular_reflectance nonlinear",
        "roughplastic": "int_ior ext_ior diffuse_reflectance specular_reflectance nonlinear distribution alpha",
        "bumpmap": "scale *", "normalmap": "normalmap", "mask": "opacity", "twosided": "", "blendbsdf": "weight",
        "null": "", "phong": "diffuse_reflectance specular_reflectance exponent",
        "ward": "variant alpha alpha_u alpha_v diffuse_reflectance specular_reflectance",
        "roughdiffuse": "reflectance alpha use_fast_approx", "principledthin": "base_color diff_trans",
        "microfacet": f"{METAL} distribution exponent diffuse_reflectance",
    },
    "texture": {
        "bitmap": "filename filter_type wrap_mode raw to_uv", "checkerboard": "color0 color1 to_uv",
        "mesh_attribute": "name",
    },
    "emitter": {
        "area": "radiance", "constant": "radiance sampling_weight", "envmap": "filename scale to_world sampling_weight",
        "point": "position intensity to_world sampling_weight", "sunsky": SKY,
        "spot": "to_world intensity cutoff_angle beam_width texture sampling_weight",
        "directional": "direction to_world irradiance sampling_weight", "directionalarea": "radiance",
    },
    "integrator": {
        "direct": "shading_samples emitter_samples bsdf_samples hide_emitters", "path": PATH, "volpath": PATH,
        "ptracer": PATH, "aov": "aovs",
    },
    "sampler": dict.fromkeys(("independent", "stratified", "multijitter", "ldsampler"), "sample_count seed"),
    "film": {
        "hdrfilm": "width height file_format pixel_format component_format crop_offset_x crop_offset_y crop_width "
        "crop_height sample_border",
    },
    "rfilter": {"box": "", "tent": "radius", "gaussian": "stddev", "mitchell": "B C", "catmullrom": "",
                "lanczos": "lobes"},
    "shape": {
        "obj": f"{MESH} flip_tex_coords", "ply": f"{MESH} flip_tex_coords", "serialized": f"{MESH} shape_index",
        "sphere": "center radius to_world flip_normals", "cylinder": "p0 p1 radius to_world flip_normals",
        "disk": "to_world flip_normals", "rectangle": "to_world flip_normals", "cube": "to_world flip_normals",
        "shapegroup": "", "instance": "to_world",
    },
    "medium": {"homogeneous": "sigma_t albedo scale", "heterogeneous": "sigma_t albedo scale"},
    "volume": {"constvolume": "value", "gridvolume": "filename to_world use_grid_bbox"},
    "phase": {"isotropic": "", "hg": "g", "rayleigh": "", "blendphase": "weight"},
    "sensor": {
        "perspective": f"{CAMERA} fov fov_axis focal_length", "orthographic": CAMERA, "irradiancemeter": "",
        "thinlens": f"{CAMERA} fov fov_axis focal_length aperture_radius",
        "radiancemeter": "origin direction to_world",
    },
}  # fmt: skip
"""The properties of the plugins that are written, by kind and type; * stands for textures of any name."""

SUCCESSORS = {
    "integrator": {"volpath_simple": "volpath", "adaptive": "", "irrcache": ""},
    "sampler": dict.fromkeys(("halton", "hammersley", "sobol", "faure"), "multijitter"),
    "film": dict.fromkeys(("ldrfilm", "mfilm", "tiledhdrfilm"), "hdrfilm"),
    "emitter": dict.fromkeys(("sky", "sun"), "sunsky"),
    "sensor": {"telecentric": "orthographic"},
    "volume": {"volcache": ""},
}
"""The types that another one replaces; an empty one the plugin nested in it."""

RENAMED = {
    ("heterogeneous", "density"): "sigma_t", ("mitchell", "b"): "B", ("mitchell", "c"): "C",
    ("hdrfilm", "high_quality_edges"): "sample_border", ("ldrfilm", "high_quality_edges"): "sample_border",
    ("difftrans", "transmittance"): "base_color", ("difftrans", "diffuse_transmittance"): "base_color",
    ("normalmap", ""): "normalmap",
}  # fmt: skip
"""Properties with another name, by the type of the plugin."""

NEAREST = {
    "integrator": "path", "sampler": "independent", "film": "hdrfilm", "rfilter": "gaussian", "sensor": "perspective",
    "phase": "isotropic", "bsdf": "diffuse",
}  # fmt: skip
"""What replaces a plugin that is not known; of the other kinds it is left out."""


Rule = Callable[["Work", Element], Element | None]
RULES: dict[tuple[str, str], Rule] = {}
"""The functions that change a plugin, whose parts are those of Mitsuba 3, and return it, what replaces it, or None."""


def rule(kind: str, *types: str) -> Callable[[Rule], Rule]:
    def declare(function: Rule) -> Rule:
        RULES.update({(kind, type): function for type in types})
        return function

    return declare


def number(tag: str, name: str, value: str) -> Element:
    return Element(tag, {"name": name, "value": value})


def colour(name: str, *rgb: float) -> Element:
    return number("rgb", name, ", ".join(f"{v:.9g}" for v in rgb))


def bsdf(type: str, *children: Element) -> Element:
    return Element("bsdf", {"type": type}, list(children))


def channels(element: Element) -> list[float]:
    try:
        if values := [float(v) for v in element.value.replace(",", " ").split()]:
            return values
    except ValueError:
        pass
    raise ValueError(f"{element.name or element.tag} = {element.value!r} has something else than numbers")


# --- BSDFs ------------------------------------------------------------------------------------------------------


def scaled_down(work: Work, element: Element, *names: str) -> Element:
    """Return a BSDF whose reflectances of these names, which have maxima in each channel, add up to at most 1: where
    they do not, 0.6 scales all by .99 over the largest sum."""
    kept = (given := element.pop("ensure_energy_conservation")) and given.value.strip().lower() == "false"
    each = [work.maxima(element[name], DEFAULTS.get((element.type, name), 1.0)) for name in names]
    most = max((sum(one[k % len(one)] for one in each) for k in range(3)), default=0)
    factor = 1.0
    if most > 1 + 1e-6 and not kept:  # as in single precision, where .7 + .3 is 1
        factor = 0.99 / most
        work.changed(element, f"{' + '.join(names)} of {element.type} is above 1, which 0.6 scales down to .99")
    textures = [it for name in names if (it := element[name]) and it.tag not in ("rgb", "float")]
    constants = {
        name: channels(it) if (it := element[name]) else [DEFAULTS.get((element.type, name), 1.0)]
        for name in names
        if element[name] not in textures
    }
    # Textures cannot be scaled, but the BSDF can, if its constants make up for what is not to be.
    share = factor if textures else 1.0
    scales = {tuple(it.scale or [1.0]) for it in textures}
    if len(scales) == 1 and len(set(scale := scales.pop())) == 1 and not element.type.endswith(("plastic", "electric")):
        most = max([factor * scale[0], *(v / scale[0] if scale[0] > 0 else 2 for it in constants.values() for v in it)])
        if most <= 1:
            share = factor * scale[0]
            element.children = [replace(it, scale=None) if it in textures else it for it in element.children]
    for name, rgb in constants.items():
        if factor != share:
            element.set("rgb", name, [v * factor / share for v in rgb])
        if max(rgb) * factor / share > 1 or min(rgb) < 0:
            work.approximated(element, f"{name} of {element.type} is limited to 0 … 1")
            element.set("rgb", name, [min(max(v * factor / share, 0.0), 1.0) for v in rgb])
    return dimmed(element, share) if share < 1 else element


def dimmed(element: Element, factor: float) -> Element:
    """Return a BSDF times a factor below 1: mixed with a black one."""
    black = bsdf("diffuse", colour("reflectance", 0))
    return bsdf("blendbsdf", number("float", "weight", f"{factor:.9g}"), black, element)


DEFAULTS = {
    ("phong", "diffuse_reflectance"): 0.5, ("phong", "specular_reflectance"): 0.2,
    ("ward", "diffuse_reflectance"): 0.5, ("ward", "specular_reflectance"): 0.2,
    ("roughdiffuse", "reflectance"): 0.5, ("diffuse", "reflectance"): 0.5,
    ("plastic", "diffuse_reflectance"): 0.5, ("roughplastic", "diffuse_reflectance"): 0.5,
}  # fmt: skip
"""The default reflectances that are not 1."""


LIMITS = {
    ("phong", "exponent"): (0.0, 1e6), ("roughdiffuse", "alpha"): (0.0, 2.2),
    **{("ward", name): (1e-4, 2.0) for name in ("alpha", "alpha_u", "alpha_v")},
}  # fmt: skip
"""The ranges of numbers here; 0.6 had none."""


def limited(work: Work, element: Element) -> None:
    """Bring the numbers of a BSDF into their ranges."""
    for child in element.of("float"):
        low, high = LIMITS.get((element.type, child.name), (-math.inf, math.inf))
        if not low <= float(child.value) <= high:
            work.approximated(child, f"{child.name} of {element.type} is limited to {low:g} … {high:g}")
            child.attributes["value"] = f"{min(max(float(child.value), low), high):g}"


@rule("bsdf", "phong", "ward")
def _phong_or_ward(work: Work, element: Element) -> Element:
    if variant := element["variant"]:
        variant.attributes["value"] = variant.value.strip().lower()
    pair_of_alpha(work, element)
    limited(work, element)
    return scaled_down(work, element, "diffuse_reflectance", "specular_reflectance")


@rule("bsdf", "roughdiffuse", "diffuse")
def _diffuse(work: Work, element: Element) -> Element:
    limited(work, element)
    other = element.pop("diffuse_reflectance")
    if other and ("reflectance" not in element or other.tag in ("texture", "ref")):
        element.pop("reflectance")
        other.attributes["name"] = "reflectance"
        element.children.append(other)
        work.changed(element, f"diffuseReflectance of {element.type} is reflectance")
    return scaled_down(work, element, "reflectance")


@rule("bsdf", "plastic", "roughplastic", "dielectric", "thindielectric", "roughdielectric")
def _dielectric(work: Work, element: Element) -> Element:
    rough_alpha(work, element)
    if element.type == "roughplastic" and (alpha := element["alpha"]) and alpha.tag not in ("float", "integer"):
        element.set("float", "alpha", 0.1)
        work.approximated(element, "alpha of roughplastic cannot be a texture; it is .1")
    names = [name for name in KNOWN["bsdf"][element.type].split() if "_reflectance" in name or "_trans" in name]
    for name in names:
        if name in element:
            element = scaled_down(work, element, name)
            if element.type == "blendbsdf":
                return element
    return element


@rule("bsdf", "conductor", "roughconductor")
def _conductor(work: Work, element: Element) -> Element:
    exterior = element.pop("ext_eta")
    index = {"air": 1.000277, "vacuum": 1.0, "water": 1.333}.get(exterior.value.strip().lower()) if exterior else None
    if exterior and index is None and exterior.tag == "float":
        index = float(exterior.value)
    if exterior:
        for name in ("eta", "k"):
            if (value := element[name]) and value.tag in ("rgb", "float") and index:
                element.set("rgb", name, [v / index for v in channels(value)])
                work.changed(element, f"{name} of {element.type} is divided by extEta")
    if exterior and not ("eta" in element and index):
        work.approximated(element, f"{element.type} is as in air: extEta has no successor")
    if not {"material", "eta"} & {child.name for child in element.children}:
        element.set("string", "material", "Cu")
        work.changed(element, f"{element.type} without a material is copper, as in 0.6")
    if element.text("distribution") in ("phong", "as"):
        return _blinn(work, element)
    rough_alpha(work, element)
    return scaled_down(work, element, *["specular_reflectance"] * ("specular_reflectance" in element))


def _blinn(work: Work, element: Element) -> Element:
    """0.6 converts α to the exponent of the cosine: n = 2/α² - 2."""
    given, alone = element.text("distribution"), element.number("alpha", 0.1)
    pair = [element.number(name, alone) for name in ("alpha_u", "alpha_v")]
    work.changed(element, f"distribution {given} of roughconductor is blinn of microfacet")
    if pair[0] != pair[1]:
        work.approximated(element, "anisotropic roughness of that distribution is its geometric mean")
    element.type = "microfacet"
    element.pop("distribution", "alpha", "alpha_u", "alpha_v")
    element.set("string", "distribution", "blinn")
    element.set("float", "exponent", max(2 / max(pair[0] * pair[1], 1e-8) - 2, 0.1))
    element.set("rgb", "diffuse_reflectance", 0)
    return element


def rough_alpha(work: Work, element: Element) -> None:
    """Change the roughness of a BSDF to what Mitsuba 3 takes."""
    if (given := element.text("distribution")) and given != "ggx":
        element.set("string", "distribution", "beckmann")
        if given != "beckmann":
            work.approximated(element, f"distribution {given} of {element.type} is beckmann of the same alpha")
    pair_of_alpha(work, element)


def pair_of_alpha(work: Work, element: Element) -> None:
    """0.6 takes alpha for what is not given of the pair beside it."""
    alpha = element["alpha"]
    if alpha is None or not ("alpha_u" in element or "alpha_v" in element):
        return
    element.pop("alpha")
    for name in ("alpha_u", "alpha_v"):
        if name not in element:
            element.set(alpha.tag, name, alpha.value)
    work.changed(element, f"alpha of {element.type} is what alphaU and alphaV are where they are not given")


@rule("bsdf", "bumpmap")
def _bumpmap(work: Work, element: Element) -> Element:
    textures = [it for it in element.of("texture", "ref") if work.resolved(it).tag == "texture"]
    inner = [it for it in element.of("bsdf", "ref") if it not in textures]
    if not textures and inner:
        work.dropped(element, "a bumpmap without a texture")
        return inner[0]
    for texture in textures:
        target = work.resolved(texture)
        if target.scale:
            element.set("float", "scale", sum(target.scale) / len(target.scale))
            target.scale = None
            work.changed(element, "the texture scale in bumpmap is its parameter scale")
        if target.type == "bitmap" and "raw" not in target:
            target.set("boolean", "raw", True)
            work.changed(target, "the bitmap of bumpmap is read as linear numbers")
    return element


@rule("bsdf", "normalmap")
def _normalmap(work: Work, element: Element) -> Element:
    for texture in element.of("texture"):
        texture.set("boolean", "raw", True)
    return element


@rule("bsdf", "mixturebsdf")
@rule("phase", "mixturephase")
def _mixture(work: Work, element: Element) -> Element:
    parts, given = element.of(element.tag, "ref"), element.pop("weights")
    weights = channels(given) if given else []
    if len(weights) != len(parts) or not parts or min(weights) < 0:
        raise ValueError(f"there are {len(parts)} parts and {len(weights)} weights")
    total = sum(weights)
    if element.tag == "bsdf" and total < 1 - 1e-6:  # the rest absorbs
        parts, weights = [*parts, bsdf("diffuse", colour("reflectance", 0))], [*weights, 1 - total]
    blend = {"bsdf": "blendbsdf", "phase": "blendphase"}[element.tag]
    work.changed(element, f"{element.type} is {blend}, nested for more than two")
    result, total = parts[-1], weights[-1]
    for part, weight in zip(parts[-2::-1], weights[-2::-1], strict=True):
        total += weight
        share = 1 - weight / total if total > 0 else 0.5
        result = Element(element.tag, {"type": blend}, [number("float", "weight", f"{share:.9g}"), part, result])
    return result


@rule("bsdf", "blendbsdf")
def _blend(_: Work, element: Element) -> Element:
    if "weight" not in element:  # which Mitsuba 3 asks for
        element.set("float", "weight", 0.5)
    return element


@rule("bsdf", "coating", "roughcoating")
def _coating(work: Work, element: Element) -> Element:
    parts = element.of("bsdf", "ref")
    if not parts:
        raise ValueError("there is no BSDF in it")
    rough = element.type == "roughcoating"
    inner = work.resolved(parts[0])
    kept = [
        it for name in ("int_ior", "ext_ior", "specular_reflectance", "alpha", "distribution") if (it := element[name])
    ]
    if inner.type in ("diffuse", "roughdiffuse"):
        # The coat of a diffuse base is what plastic is.
        work.approximated(element, f"{element.type} over {inner.type} is plastic, without absorption in the coat")
        plastic = bsdf("roughplastic" if rough else "plastic", *kept, number("boolean", "nonlinear", "true"))
        if reflectance := inner["reflectance"]:
            under = Element(
                reflectance.tag, {**reflectance.attributes, "name": "diffuse_reflectance"}, reflectance.children
            )
            under.attributes.pop("id", None)
            plastic.children.append(under)
        if not rough:
            plastic.pop("alpha", "distribution")
        rough_alpha(work, plastic)
        return plastic
    index = element.number("int_ior", 1.5) / element.number("ext_ior", 1.0)
    share = min(max(0.5 * ((index - 1) / (index + 1)) ** 2 + 0.05, 0.02), 0.5)
    work.approximated(
        element, f"{element.type} is a mixture with a mirror, of the coat's mean reflectance, at all angles"
    )
    mirror = bsdf("roughconductor" if rough else "conductor", number("string", "material", "none"))
    mirror.children += [it for it in kept if rough and it.name in ("alpha", "distribution")]
    rough_alpha(work, mirror)
    return bsdf("blendbsdf", number("float", "weight", f"{share:.4g}"), parts[0], mirror)


@rule("bsdf", "difftrans")
def _difftrans(work: Work, element: Element) -> Element:
    work.approximated(element, "difftrans is principledthin, which transmits only")
    given = element["base_color"] or colour("base_color", 0.5)
    return bsdf("principledthin", number("float", "diff_trans", "2"), given)


# --- Textures ----------------------------------------------------------------------------------------------------


@rule("texture", "bitmap")
def _bitmap(work: Work, element: Element) -> Element:
    _to_uv(element)
    gamma = element.pop("gamma", "srgb")
    if gamma and gamma.tag == "float" and float(gamma.value) == 1:
        element.set("boolean", "raw", True)
        work.changed(element, "gamma 1 of bitmap is raw")
    elif gamma and gamma.tag == "float" and float(gamma.value) > 0 and float(gamma.value) != 2.2:
        work.approximated(element, f"gamma {gamma.value} of bitmap is that of its file, as a rule sRGB")
    if element.text("filter_type") and element.text("filter_type") != "nearest":
        element.set("string", "filter_type", "bilinear")
    wrap = element.pop("wrap_mode_u", "wrap_mode_v") or element["wrap_mode"]
    if wrap:
        mode = wrap.value.strip().lower()
        element.set("string", "wrap_mode", mode if mode in ("repeat", "mirror", "clamp") else "clamp")
        if mode in ("zero", "one"):
            work.approximated(element, f"wrapMode {mode} of bitmap is clamp")
    return element


CHECKS = {"color0": 0.4, "color1": 0.2}
"""The default colours of a checkerboard."""
NUMBERS = "alpha", "alpha_u", "alpha_v", "exponent", "opacity", "weight"
"""Properties that Mitsuba 3 reads of a texture as numbers."""


@rule("texture", "checkerboard")
def _checkerboard(work: Work, element: Element) -> Element:
    _to_uv(element)
    if element.name in NUMBERS:
        # Mitsuba 3 swaps the two where it reads a checkerboard as a number, up to 3.9 at least.
        values = [channels(it) if (it := element.pop(name)) else [grey] for name, grey in CHECKS.items()]
        for name, rgb in zip(CHECKS, reversed(values), strict=True):
            element.set("float", name, sum(rgb) / len(rgb))
    return element


def _to_uv(element: Element) -> None:
    """0.6 scales the coordinates before it adds the offsets."""
    both = element.number("uvscale", 1)
    scale = [element.number("uscale", both), element.number("vscale", both)]
    offset = [element.number("uoffset", 0), element.number("voffset", 0)]
    element.pop("uvscale", "uscale", "vscale", "uoffset", "voffset")
    if scale != [1, 1] or offset != [0, 0]:
        steps = [
            Element("scale", {"x": f"{scale[0]:.9g}", "y": f"{scale[1]:.9g}"}),
            Element("translate", {"x": f"{offset[0]:.9g}", "y": f"{offset[1]:.9g}"}),
        ]
        element.children.append(Element("transform", {"name": "to_uv"}, steps))


@rule("texture", "scale")
def _scale(work: Work, element: Element) -> Element:
    factor = element.pop("scale")
    by = channels(factor) if factor else [1.0]
    rest = [child for child in element.children if child.tag in ("rgb", "float", "texture", "ref")]
    if not rest:
        return colour(element.name, *by)
    inner = work.resolved(rest[0])
    if inner.tag in ("rgb", "float"):
        value = channels(inner)
        work.changed(element, "the texture scale of a colour is the product")
        return colour(element.name, *[value[k % len(value)] * by[k % len(by)] for k in range(max(len(value), len(by)))])
    before = inner.scale or [1.0]
    scale = [before[k % len(before)] * by[k % len(by)] for k in range(max(len(before), len(by)))]
    return Element(inner.tag, dict(inner.attributes), list(inner.children), element.place, scale)


@rule("texture", "vertexcolors")
def _vertex_colors(work: Work, element: Element) -> Element:
    work.changed(element, "vertexcolors is mesh_attribute, of vertex_color")
    name = element.name
    element.type, element.children = "mesh_attribute", []
    element.attributes["name"] = name
    element.set("string", "name", "vertex_color")
    return element


# --- Light -------------------------------------------------------------------------------------------------------


@rule("emitter", "sun", "sky", "sunsky")
def _sunsky(work: Work, element: Element) -> Element:
    kind = element.type
    element.type = "sunsky"
    scale = element.pop("scale")
    for part in ("sun", "sky"):
        if kind not in (part, "sunsky"):
            element.set("float", f"{part}_scale", 0.0)
        elif scale and f"{part}_scale" not in element:
            element.set("float", f"{part}_scale", float(scale.value))
    if radius := element.pop("sun_radius_scale"):
        element.set("float", "sun_aperture", 0.5358 * float(radius.value))
    if "albedo" not in element:
        element.children.append(colour("albedo", 0.2))
    turned = element["to_world"]
    if turned is None:
        turned = Element("transform", {"name": "to_world"})
        element.children.append(turned)
    # Z is up there, and Y in 0.6.
    turned.children.insert(0, Element("rotate", {"x": "1", "angle": "-90"}))
    work.approximated(element, f"{kind} is sunsky, turned to where Y is up; it has other data")
    return element


@rule("emitter", "collimated")
def _collimated(work: Work, element: Element) -> Element:
    work.approximated(element, "collimated is a disk of radius .001 that shines straight on")
    radius = 1e-3
    power = element.pop("power")
    light = [v / (math.pi * radius**2) for v in (channels(power) if power and power.tag == "rgb" else [1.0])]
    world = element["to_world"] or Element("transform", {"name": "to_world"})
    world.children.insert(0, Element("scale", {"value": f"{radius:g}"}))
    return Element(
        "shape",
        {"type": "disk"},
        [world, Element("emitter", {"type": "directionalarea"}, [colour("radiance", *light)])],
    )


# --- Integrators, films, sensors ----------------------------------------------------------------------------------


@rule("film", "hdrfilm", "ldrfilm", "mfilm", "tiledhdrfilm")
def _film(work: Work, element: Element) -> Element:
    if element.type != "hdrfilm":
        element.pop("file_format")
        work.changed(element, f"{element.type} is hdrfilm, whose values are linear; mi-brdfs render writes a PNG, too")
    for name in ("width", "height"):
        if element.type == "mfilm" and name not in element:
            element.set("integer", name, 1)
    element.type = "hdrfilm"
    if given := element.pop("pixel_format"):
        word = given.value.split(",")[0].strip().lower()
        word = {"luminancealpha": "luminance_alpha", "spectrum": "rgb", "spectrumalpha": "rgba"}.get(word, word)
        element.set("string", "pixel_format", word)
        if word.replace("_", "") != given.value.strip().lower():
            work.approximated(element, f"pixelFormat {given.value} is {word}")
    return element


@rule("sensor", "perspective", "thinlens", "perspective_rdist")
def _perspective(work: Work, element: Element) -> Element:
    if element.type == "perspective_rdist":
        work.approximated(element, "perspective_rdist is perspective, without distortion")
        element.type = "perspective"
    if "fov" not in element and "focal_length" not in element:
        element.pop("fov_axis")
        element.set("string", "focal_length", "50mm")
    return element


@rule("phase", "hg")
def _hg(work: Work, element: Element) -> Element:
    if (g := element["g"]) and g.tag != "float":
        work.approximated(element, "g of hg cannot vary; it is 0.8")
        element.pop("g")
    return element


@rule("volume", "gridvolume")
def _grid_volume(work: Work, element: Element) -> Element:
    element.set("boolean", "use_grid_bbox", True)  # as 0.6 always does
    return element


# --- Media -------------------------------------------------------------------------------------------------------

SKIN = [0.74, 0.88, 1.01], [0.032, 0.17, 0.48]
"""σs and σa of skin in 1/mm (H. W. Jensen et al., A practical model for subsurface light transport, SIGGRAPH 2001),
the default of 0.6."""


@rule("medium", "homogeneous")
def _homogeneous(work: Work, element: Element) -> Element:
    given = {name: channels(it) for name in ("sigma_s", "sigma_a", "sigma_t", "albedo") if (it := element.pop(name))}
    material = element.pop("material")
    if "sigma_t" not in given:
        if material or not given:
            work.approximated(element, f"the medium {material.value if material else ''} has the coefficients of skin")
        scattered, absorbed = (
            given.get(name, skin if not given else [0.0])
            for name, skin in zip(("sigma_s", "sigma_a"), SKIN, strict=True)
        )
        scattered, absorbed = ((it * 3)[:3] if len(it) == 1 else it for it in (scattered, absorbed))
        extinct = [s + a for s, a in zip(scattered, absorbed, strict=True)]
        given = {"sigma_t": extinct, "albedo": [s / t if t else 0.0 for s, t in zip(scattered, extinct, strict=True)]}
        work.changed(element, "sigmaS and sigmaA of a medium are sigma_t and albedo")
    # Colours are at most 1 there; the scale carries the rest.
    most = max(*given["sigma_t"], 1e-9) if max(given["sigma_t"]) > 1 else 1.0
    element.set("rgb", "sigma_t", [v / most for v in given["sigma_t"]])
    element.set("rgb", "albedo", given.get("albedo", [0.75]))
    element.set("float", "scale", element.number("scale", 1) * most)
    return element
