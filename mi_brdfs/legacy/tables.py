"""The plugins that are written, and what those of Mitsuba 0.2 to 0.6 and their properties are called now."""

from __future__ import annotations

from typing import Any

DIELECTRIC = "int_ior ext_ior specular_reflectance specular_transmittance"
PLASTIC = "int_ior ext_ior diffuse_reflectance specular_reflectance nonlinear"
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
        "plastic": PLASTIC, "roughplastic": f"{PLASTIC} distribution alpha", "bumpmap": "scale <texture>",
        "normalmap": "normalmap", "mask": "opacity", "twosided": "", "blendbsdf": "weight", "null": "",
        "phong": "diffuse_reflectance specular_reflectance exponent",
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
        "directional": "direction to_world irradiance sampling_weight",
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
    "medium": dict.fromkeys(("homogeneous", "heterogeneous"), "sigma_t albedo scale"),
    "volume": {"constvolume": "value", "gridvolume": "filename to_world use_grid_bbox"},
    "phase": {"isotropic": "", "hg": "g", "rayleigh": "", "blendphase": "weight"},
    "sensor": {
        "perspective": f"{CAMERA} fov fov_axis focal_length", "orthographic": CAMERA, "irradiancemeter": "",
        "thinlens": f"{CAMERA} fov fov_axis focal_length aperture_radius",
        "radiancemeter": "origin direction to_world",
    },
    "subsurface": {},
}  # fmt: skip
"""The properties of the plugins that are written, by kind and type."""

HELD = {
    "bsdf": "<bsdf>", "integrator": "<integrator>", "film": "<rfilter>", "sensor": "<film> <sampler> <medium>",
    "medium": "<phase>", "phase": "<phase>", "shape": "<bsdf> <emitter> <medium> <sensor> <shape>",
}  # fmt: skip
"""The kinds of plugins that those of a kind hold, whatever their names."""

SUCCESSORS = {
    "sampler": dict.fromkeys(("halton", "hammersley", "sobol", "faure"), "multijitter"),
    "sensor": {"telecentric": "orthographic"}, "emitter": {"collimated": "spot"},
    "bsdf": {"difftrans": "principledthin"}, "texture": {"vertexcolors": "mesh_attribute"},
}  # fmt: skip
"""The types that another one replaces."""

NEAREST = {
    "integrator": "path", "sampler": "independent", "film": "hdrfilm", "rfilter": "gaussian", "sensor": "perspective",
    "phase": "isotropic", "bsdf": "diffuse",
}  # fmt: skip
"""What replaces a plugin that is not known; of the other kinds it is left out."""

RENAMED = {
    "heterogeneous": {"density": "sigma_t"}, "mitchell": {"b": "B", "c": "C"}, "normalmap": {"": "normalmap"},
    **{key: {"high_quality_edges": "sample_border"} for key in ("hdrfilm", "ldrfilm")},
    "difftrans": {"transmittance": "base_color", "diffuse_transmittance": "base_color"},
    **{key: {"diffuse_reflectance": "reflectance"} for key in ("diffuse", "roughdiffuse")},
}  # fmt: skip
"""Properties with another name, by the type of the plugin in 0.6."""

SUPPLIED: dict[str, dict[str, Any]] = {
    "blendbsdf": {"weight": 0.5}, "gridvolume": {"use_grid_bbox": True}, "sunsky": {"albedo": [0.2]},
    "principledthin": {"base_color": [0.5], "diff_trans": 2.0}, "mesh_attribute": {"name": "vertex_color"},
    "checkerboard": {"color0": [0.4], "color1": [0.2]}, "mfilm": {"width": 1, "height": 1},
    "constvolume": {"value": 1.0},
}  # fmt: skip
"""What is written where it is not given, as Mitsuba 3 has other defaults or none."""

LIMITS = {
    "phong": {"exponent": (0.0, 1e6)}, "roughdiffuse": {"alpha": (0.0, 2.2)},
    "ward": dict.fromkeys(("alpha", "alpha_u", "alpha_v"), (1e-4, 2.0)),
}  # fmt: skip
"""The ranges of numbers here; 0.6 had none."""

OLD_TYPES = {
    "bsdf": {
        "lambertian": "diffuse", "microfacet": "roughplastic", "mirror": "conductor", "roughmetal": "roughconductor",
        "roughglass": "roughdielectric", "composite": "mixturebsdf",
    },
    "texture": {"exrtexture": "bitmap", "ldrtexture": "bitmap"},
    "film": {"exrfilm": "hdrfilm", "pngfilm": "ldrfilm"},
}  # fmt: skip
"""What the types of 0.2 and 0.3 were called after."""

OLD_NAMES = {
    "sphere": {"inverted": "flip_normals"}, "cylinder": {"p1": "p0", "p2": "p1"},
    **{key: {"bright_color": "color0", "dark_color": "color1"} for key in ("checkerboard", "gridtexture")},
    "ward": {"alpha_x": "alpha_u", "alpha_y": "alpha_v"}, "roughconductor": {"alpha_b": "alpha", "ior": "eta"},
    **{key: {"alpha_b": "alpha"} for key in ("roughplastic", "roughdielectric")},
    **{key: {"intensity": "radiance"} for key in ("area", "constant")}, "directional": {"intensity": "irradiance"},
    "": {
        "luminaire_samples": "emitter_samples", "focus_depth": "focus_distance", "intensity_scale": "scale",
        "size_multiplier": "scale", "density_multiplier": "scale",
    },
}  # fmt: skip
"""What properties of 0.2 and 0.3 were called after, by the later type of the plugin, if it matters."""
