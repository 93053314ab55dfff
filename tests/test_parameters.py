"""Bad input gives one sentence that names plugin, parameter, value and what is allowed; good input works in any form."""

import mitsuba as mi
import numpy as np
import pytest
from support import call, direction

from mi_brdfs.mitsuba.errors import one_line

# What values of a wrong kind, or out of range, are told is drawn in test_malformed.
# ruff: noqa: E501
REJECTED = [
    ("ward", {"alpha": 2.7}, "ward: alpha = 2.7 is not allowed; it must be a number in [0.0001, 2] or a texture."),
    ("ward", {"alpha": True}, "ward: alpha = True is a boolean; it must be a number in"),
    ("ward", {"alpha": 0.1, "alpha_u": 0.1}, "ward: alpha excludes alpha_u; give either alpha or alpha_u and alpha_v."),
    ("walter", {"alpha_u": 0.1}, "walter: alpha_u needs alpha_v beside it; give both, or alpha alone."),
    ("ward", {"variant": "wrad"}, 'ward: variant = "wrad" is unknown; it must be one of "balanced", "ward", "ward-duer" or'),
    ("lambert", {"reflectance": 1.5}, "lambert: reflectance = 1.5 is not allowed; it must be a number, rgb or spectrum within [0, 1]"),
    ("lambert", {"reflectance": {"type": "spectrum", "value": [(400, 0.1), (700, 1.9)]}}, "lambert: reflectance = "),
    ("ward", {"roughness": 0.1}, "ward: unknown parameter roughness; did you mean alpha?"),
    ("ward", {"alphaU": 0.1}, "ward: unknown parameter alphaU; did you mean alpha_u?"),
    ("walter", {"alphaV": 0.1}, "walter: unknown parameter alphaV; did you mean alpha_v?"),
    ("walter", {"extIOR": 1.3}, "walter: unknown parameter extIOR; did you mean ext_ior?"),
    ("kurt", {"alphaV_1": 0.1}, "kurt: unknown parameter alphaV_1; did you mean alpha_v_1?"),
    ("walter", {"f0": 0.04, "int_ior": 1.5}, "walter: f0 excludes int_ior; give one of eta and k, material, f0, int_ior and"),
    ("walter", {"material": "Au", "eta": 1.5, "k": 1.0}, "walter: eta excludes material; give one of"),
    ("walter", {"eta": 1.5}, "walter: eta needs k beside it."),
    ("walter", {"material": "gold"}, 'walter: material = "gold" is unknown; did you mean "Au"? It must be "none", for F = 1, or one of Mitsuba\'s'),
    ("walter", {"int_ior": "glas"}, 'walter: int_ior = "glas" is unknown; it must be a number or one of vacuum, helium'),
    ("kurt", {"alpha_1": 0.1, "alpha_3": 0.1}, "kurt: alpha_3 leaves a gap; number the lobes from 1, so that this one is 2."),
    ("kurt", {"alpha": 0.1, "f0_1": 0.1}, "kurt: alpha excludes f0_1; number the names of all lobes, or of none."),
    ("kurt", {"alpha_u_1": 0.1}, "kurt: alpha_u_1 needs alpha_v_1 beside it; give both, or alpha_1 alone."),
    ("lafortune", {"cx_9": 1.0}, "lafortune: unknown parameter cx_9; did you mean cx_"),
    ("orennayar", {"sigma": 0.3, "alpha": 0.3}, "orennayar: sigma excludes alpha; give either sigma or alpha."),
    ("microfacet", {"gamma": 2}, 'microfacet: gamma does not belong to distribution = "beckmann", which has alpha, alpha_u and alpha_v of its own, but to "gtr", "hepd", "epd" or "student-t".'),
    ("microfacet", {"distribution": "gtr", "alpha_u": 0.1}, 'alpha_u does not belong to distribution = "gtr", which has alpha and gamma'),
    ("microfacet", {"kurt_exponent": 0.2}, 'kurt_exponent does not belong to shadowing = "smith", which has multiscatter of its own, but to "kurt".'),
    ("microfacet", {"distribution": "phong"}, 'microfacet: distribution = "phong" is unknown; it must be one of "beckmann", "ggx"'),
    ("microfacet", {"distribution": "abc"}, 'shadowing = "smith" is not known for distribution = "abc"; take it with beckmann, ggx or blinn,'),
    ("microfacet", {"distribution": "hepd", "shadowing": "schlick"}, 'shadowing = "schlick" is not known for distribution = "hepd"; take it with'),
    ("walter", {"f82": 0.5}, "f82 needs f0 beside it"),
    ("walter", {"material": "Au", "film_ior": 1.5}, "walter: film_ior needs film_thickness beside it."),
    ("burley", {"haze_spread": 0.5}, "burley: haze_spread needs haze beside it."),
    ("walter", {"material": "Au", "f90": 0.5}, "excludes f90"),
    ("walter", {"f0": 0.5, "film_thickness": 300.0}, "film_thickness needs a conductor or a dielectric beside it; give eta and k"),
    ("microfacet", {"distribution": "abc", "shadowing": "vcavity", "haze": 0.5}, 'haze is not known for distribution = "abc"; take it with'),
    ("microfacet", {"shadowing": "vcavity", "multiscatter": "walk"}, "multiscatter does not belong to shadowing"),
    ("metallicroughness", {"shadowing": "ibl", "multiscatter": "walk"}, "multiscatter does not belong to shadowing"),
    ("nishino", {"variant": "dsbrdf", "f0": 0.1}, 'nishino: f0 does not belong to variant = "dsbrdf", which has no parameter of its own, but to "'),
]  # fmt: skip


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", pytest.param("scalar_spectral", marks=pytest.mark.slow)])
def test_rejected(variant):
    with mi.variant_context(variant):
        for plugin, given, message in REJECTED:
            with pytest.raises(RuntimeError) as caught:
                mi.load_dict({"type": plugin, **given})
            sentence = one_line(caught.value)
            assert message in sentence and sentence in str(caught.value)
            assert sentence.startswith(f"{plugin}: ") and sentence.endswith(".")


@pytest.mark.usefixtures("llvm_rgb")
def test_nested_objects_without_a_name():
    with pytest.raises(
        RuntimeError, match=r"ward: a texture is nested without a name; give it the name of the parameter"
    ):
        mi.load_string('<bsdf type="ward" version="3.0.0"><texture type="checkerboard"/></bsdf>')
    with pytest.raises(RuntimeError, match=r"lambert: a BSDF is nested without a name"):
        mi.load_string('<bsdf type="lambert" version="3.0.0"><bsdf type="diffuse"/></bsdf>')


def bitmap(value, channels=1):
    return {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.full((2, 2, channels), value, np.float32))}


@pytest.mark.parametrize("spelling", ["float", "integer", "uniform", "bitmap", "checkerboard"])
def test_numbers_take_any_texture(spelling, variant):
    if spelling == "checkerboard" and mi.is_spectral:
        pytest.skip("Mitsuba's checkerboard does not answer numbers in spectral variants")
    given = {
        "float": 1.0,
        "integer": 1,
        "uniform": {"type": "uniform", "value": 1.0},
        "bitmap": bitmap(1.0),
        "checkerboard": {"type": "checkerboard", "color0": 1.0, "color1": 1.0},
    }[spelling]
    bsdf, plain = mi.load_dict({"type": "ward", "alpha": given}), mi.load_dict({"type": "ward", "alpha": 1.0})
    wi, wo = direction(20)[None], direction(50, 30)[None]
    ctx = mi.BSDFContext()
    np.testing.assert_allclose(call(bsdf.eval, ctx, wi, wo)[0], call(plain.eval, ctx, wi, wo)[0], rtol=1e-5)


@pytest.mark.parametrize("spelling", ["rgb", "spectrum", "bitmap", "texture object"])
def test_colours_take_any_texture(spelling, variant):
    given = {
        "rgb": {"type": "rgb", "value": [0.4, 0.4, 0.4]},
        "spectrum": {"type": "spectrum", "value": [(300, 0.4), (900, 0.4)]},
        "bitmap": bitmap(0.4),
        "texture object": mi.load_dict({"type": "uniform", "value": 0.4}),
    }[spelling]
    bsdf = mi.load_dict({"type": "lambert", "reflectance": given})
    value = call(bsdf.eval, mi.BSDFContext(), direction(20)[None], direction(60)[None])[0]
    np.testing.assert_allclose(value, 0.4 / np.pi * 0.5, rtol=2e-3)  # rgb values are fitted by a smooth spectrum


@pytest.mark.usefixtures("llvm_rgb")
def test_ward_leaves_a_lone_roughness_at_its_default():
    """As Mitsuba 0.6 does."""
    lone = mi.load_dict({"type": "ward", "alpha_v": 0.4})
    pair = mi.load_dict({"type": "ward", "alpha_u": 0.1, "alpha_v": 0.4})
    assert str(lone) == str(pair)


def test_rotation_turns_counter_clockwise_from_dp_du(variant):
    """A quarter turn swaps the roughnesses; an eighth turn lays the wide axis along +45°."""
    ctx, up = mi.BSDFContext(), direction(0)[None]

    def value(phi, **given):
        bsdf = mi.load_dict({"type": "walter", **given})
        return call(bsdf.eval, ctx, up, direction(40, phi)[None])[0].max()

    tall, wide = {"alpha_u": 0.05, "alpha_v": 0.4}, {"alpha_u": 0.4, "alpha_v": 0.05}
    assert value(20, **tall, rotation=0.25) == pytest.approx(value(20, **wide), rel=1e-4)
    assert value(45, **wide, rotation=0.125) > 10 * value(-45, **wide, rotation=0.125)
