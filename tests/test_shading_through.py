"""What ``shading`` shows of surfaces that let light straight through, and behind them."""

import mitsuba as mi
import numpy as np
import pytest
from plates import SUN, WHITE, film, from_above, plate, shaded

GREY = {"type": "twosided", "inner": {"type": "lambert", "reflectance": 0.4}}
BEHIND, VEIL = 0.8, 0.4  # the shades of a plate and a veil of these reflectances in the sun


def veil(bsdf, height=1.0):
    """A plate between the camera and the sun on one side, and the plate of the scene on the other."""
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, height]).scale(9), "bsdf": bsdf}


def mask(opacity, inner=GREY):
    return {"type": "mask", "opacity": opacity, "inner": inner}


def camera():
    """One that tells colour and alpha."""
    colours = "luminance_alpha" if mi.is_monochromatic else "rgba"
    return {"type": "orthographic", "to_world": from_above(), "film": film(pixel_format=colours)}


def seen(*others, **settings):
    """The grey of a picture, and its alpha."""
    *colour, alpha = shaded(plate(WHITE, SUN, *others, sensor=camera(), **settings), spp=8).mean(axis=(0, 1))
    return np.mean(colour), alpha


def through(opacity):
    """The shade of the plate, seen and lit through a veil."""
    return opacity * VEIL + (1 - opacity) ** 2 * BEHIND


def check_masks():
    """What is behind a mask is seen, and lit, through it."""
    for opacity in (0.0, 0.3, 1.0):
        assert seen(veil(mask(opacity))) == pytest.approx((through(opacity), 1), rel=1e-5)
    assert seen(veil({"type": "null"})) == pytest.approx((BEHIND, 1), rel=1e-5)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "scalar_rgb", "llvm_ad_mono_polarized"])
def test_null_and_masks_show_what_is_behind_and_let_its_light_through(name):
    with mi.variant_context(name):
        check_masks()


@pytest.mark.parametrize("name", ["llvm_ad_spectral", "llvm_ad_spectral_polarized"])
def test_masks_in_spectral_variants(name):
    with mi.variant_context(name):
        scene = plate(WHITE, SUN, veil(mask(0.3)))
        assert shaded(scene, spp=20000).mean() == pytest.approx(through(0.3), rel=0.03)


def check_layers():
    """Two masks and the plate, each lit through those above it."""
    layers = [veil(mask(0.5), height) for height in (1.0, 2.0)]
    assert seen(*layers)[0] == pytest.approx(0.5 * VEIL + 0.5**3 * VEIL + 0.5**4 * BEHIND, rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_what_is_behind_is_seen_through():
    """Layers of masks, blends with null, masks within a shape group, and a medium, which is left out. Without shadows a
    veil takes no light away."""
    check_layers()
    blended = {"type": "blendbsdf", "weight": 0.5, "a": GREY, "b": {"type": "null"}}
    assert seen(veil(blended))[0] == pytest.approx(through(0.5), rel=1e-5)
    group = {"type": "shapegroup", "veil": veil(mask(0.3)), "id": "leaves"}
    instance = {"type": "instance", "group": {"type": "ref", "id": "leaves"}}
    assert seen(group, instance)[0] == pytest.approx(through(0.3), rel=1e-5)
    fog = {"type": "homogeneous", "albedo": 0.5, "sigma_t": 1.0}
    cloud = {"type": "sphere", "radius": 2, "interior": fog, "bsdf": {"type": "null"}}
    assert seen(cloud)[0] == pytest.approx(BEHIND, rel=1e-5)
    sensor = {"type": "orthographic", "to_world": from_above(), "film": film(), "medium": fog}
    assert shaded(plate(WHITE, SUN, sensor=sensor), spp=1).mean() == pytest.approx(BEHIND, rel=1e-5)
    assert seen(veil(mask(0.3)), shadows=False)[0] == pytest.approx(0.3 * VEIL + 0.7 * BEHIND, rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_masks_cut_shapes_out():
    """Of a textured opacity, the whole shadow lies where the mask is opaque. The light comes from the side, so that it
    is seen beside the mask, too."""
    half = {"type": "bitmap", "bitmap": mi.Bitmap(np.array([[[1.0], [0.0]]], np.float32)), "raw": True,
            "filter_type": "nearest"}  # fmt: skip
    leaf = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, 0.5]).scale(0.5),
            "bsdf": mask(half)}  # fmt: skip
    sun = {"type": "directional", "direction": [1, 0, -1], "irradiance": 2**0.5}
    row = shaded(plate(WHITE, sun, leaf, size=8), spp=1)[4, :, 0]
    np.testing.assert_allclose(row, [0.8, 0.8, VEIL, VEIL, 0, 0, 0.8, 0.8], atol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("inner", [{"type": "diffuse", "reflectance": 0.4}, GREY], ids=lambda bsdf: bsdf["type"])
def test_ambient_light_meets_as_much_of_a_mask_as_there_is(inner):
    scene = plate({"type": "lambert", "reflectance": 0.0}, veil(mask(0.3, inner)), ambient=1.0)
    assert shaded(scene, spp=1).mean() == pytest.approx(0.3 * 0.4, rel=1e-5)
    scene = plate({"type": "lambert", "reflectance": 0.0}, veil(mask(0.5, mask(0.3, inner))), ambient=1.0)
    assert shaded(scene, spp=1).mean() == pytest.approx(0.5 * 0.3 * 0.4, rel=1e-5)


def test_alpha_is_what_masks_hide(variant):
    alone = {
        "type": "scene",
        "integrator": {"type": "shading"},
        "sensor": camera(),
        "sun": SUN,
    }
    for opacity in (0.0, 0.3, 1.0):
        picture = shaded(mi.load_dict(alone | {"veil": veil(mask(opacity))}), spp=2)
        np.testing.assert_allclose(picture[..., -1], opacity, atol=1e-6)


@pytest.mark.usefixtures("llvm_rgb")
def test_thin_glass_is_seen_through_and_thick_is_not():
    once = mi.fresnel(1.0, 1.5046 / 1.000277)[0][0]
    passed = 1 - 2 * once / (1 + once)
    assert seen(veil({"type": "thindielectric"}))[0] == pytest.approx(passed**2 * BEHIND, rel=1e-3)
    assert seen(veil({"type": "dielectric"}))[0] == 0


@pytest.mark.usefixtures("llvm_rgb")
def test_lights_behind_a_mask_shine_through():
    """A lamp that is seen, and that lights what is on the other side of the mask."""
    T = mi.ScalarTransform4f
    shining = {"type": "disk", "to_world": T().scale(5), "emitter": {"type": "area", "radiance": 0.9}}
    scene = {
        "type": "scene",
        "integrator": {"type": "shading"},
        "sensor": {"type": "orthographic", "to_world": from_above(), "film": film()},
        "lamp": shining,
        "veil": veil(mask(0.3, {"type": "lambert", "reflectance": 0.0})),
    }
    assert shaded(mi.load_dict(scene), spp=1).mean() == pytest.approx(0.7 * 0.9, rel=1e-5)
