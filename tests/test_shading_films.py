"""Where the samples of ``shading`` go: pixels, films and sensors of every kind, and scenes that are no plain shapes."""

import gc

import mitsuba as mi
import numpy as np
import pytest
from plates import SKY, SUN, WHITE, film, from_above, noisy, plate, shaded
from support import is_scalar

LAMP, INTENSITY = (0.3, -0.2, 1.0), 1.5


def point_lit(x, y):
    """The shade of a plate of ``WHITE`` at some place, lit by a point above it."""
    r2 = (x - LAMP[0]) ** 2 + (y - LAMP[1]) ** 2 + LAMP[2] ** 2
    return np.minimum(0.8 * INTENSITY * LAMP[2] / r2**1.5, 1)


def weights(rfilter, count):
    """How much of each of some pixels in a row a film gives to each."""
    if rfilter == "box":
        return np.eye(count)
    distance = np.arange(count)[:, None] - np.arange(count)[None, :]
    loaded = mi.load_dict({"type": rfilter})
    if is_scalar():
        return np.vectorize(loaded.eval_discretized)(distance)
    return np.array(loaded.eval(mi.Float(distance.ravel()))).reshape(count, count)


def check_pixels(rfilter="box", border=False):
    """A window cut from a picture has the shade in the centre of each pixel, finished, and then filtered, for which
    scalar variants look a filter up in a table."""
    size, x, y, width, height = 8, 3, 1, 4, 6
    window = {"crop_offset_x": x, "crop_offset_y": y, "crop_width": width, "crop_height": height}
    given = film(size, rfilter={"type": rfilter}, sample_border=border, pixel_format="rgba", **window)
    lamp = {"type": "point", "position": list(LAMP), "intensity": INTENSITY}
    scene = plate(WHITE, lamp, sensor={"type": "orthographic", "to_world": from_above(), "film": given})
    picture = shaded(scene, spp=3)

    margin = scene.sensors()[0].film().rfilter().border_size() if border else 0
    column, row = np.arange(-margin, width + margin) + x, np.arange(-margin, height + margin) + y
    shades = point_lit((2 * column + 1) / size - 1, 1 - (2 * row[:, None] + 1) / size)
    across, down = weights(rfilter, len(column)), weights(rfilter, len(row))
    expected = (down @ shades @ across.T) / (down.sum(1)[:, None] * across.sum(1))
    inner = slice(margin, -margin or None)
    assert shades.max() == 1
    assert np.ptp(shades[inner, inner]) > 0.3
    np.testing.assert_allclose(picture[..., :3], expected[inner, inner, None].repeat(3, axis=-1), atol=1e-4)
    np.testing.assert_allclose(picture[..., 3], 1, atol=1e-5)


@pytest.mark.parametrize("border", [False, True], ids=["", "border"])
@pytest.mark.parametrize(
    "name, rfilter",
    [
        *(("llvm_ad_rgb", it) for it in ("box", "gaussian", "lanczos")),
        *(("scalar_rgb", it) for it in ("box", "gaussian")),
    ],
)
def test_filters_act_on_finished_pixels(name, rfilter, border):
    with mi.variant_context(name):
        check_pixels(rfilter, border)


@pytest.mark.usefixtures("llvm_rgb")
def test_nothing_is_transparent_under_an_environment():
    """However many samples there are."""
    sensor = {"type": "orthographic", "to_world": from_above(), "film": film(pixel_format="rgba")}
    for spp in (1, 3):
        np.testing.assert_allclose(shaded(noisy(sensor=sensor), spp=spp)[..., 3], 1, atol=1e-6)


SENSORS = {
    "perspective": {"fov": 30, "shutter_open": 0.0, "shutter_close": 1.0},
    "thinlens": {"fov": 30, "aperture_radius": 0.3, "focus_distance": 5.0},
    "orthographic": {},
    "radiancemeter": {"size": 1},
    "distant": {"size": 1, "target": [0, 0, 0]},
    "batch": {"size": 4, "left": {"type": "perspective", "fov": 20}, "right": {"type": "perspective", "fov": 40}},
}


@pytest.mark.parametrize("kind", SENSORS)
def test_sensors_see_a_plate(kind, variant):
    """Which is as bright from anywhere, and opaque."""
    given = dict(SENSORS[kind])
    colours = {"pixel_format": "luminance_alpha" if mi.is_monochromatic else "rgba"}
    sensor = {"type": kind, "film": film(given.pop("size", 2), **colours)}
    if kind == "batch":
        given = {name: inner | {"to_world": from_above()} for name, inner in given.items()}
    else:
        sensor["to_world"] = from_above()
    scene = plate(WHITE, SUN, sensor=sensor | given)
    spp = 3 if not mi.is_spectral else 100 if is_scalar() else 10000
    *colour, alpha = shaded(scene, spp=spp).mean(axis=(0, 1))
    assert np.mean(colour) == pytest.approx(0.8, rel=(0.05 if is_scalar() else 0.02) if mi.is_spectral else 1e-4)
    assert alpha == pytest.approx(1, abs=1e-6)


@pytest.mark.usefixtures("llvm_rgb")
def test_an_irradiancemeter_measures_all_of_its_surface():
    """Of a square, one half is close below a lamp, and the other has nothing above it."""
    T = mi.ScalarTransform4f
    meter = {"type": "irradiancemeter", "film": film(1, pixel_format="rgba")}
    lamp = T().translate([500, 0, 1e-3]).rotate([1, 0, 0], 180).scale(500)
    scene = {
        "type": "scene",
        "integrator": {"type": "shading", "clamp": False},
        "meter": {"type": "rectangle", "bsdf": WHITE, "sensor": meter},
        "lamp": {"type": "rectangle", "to_world": lamp, "emitter": {"type": "area", "radiance": 1.0}},
    }
    *colour, alpha = shaded(mi.load_dict(scene), spp=40000)[0, 0]
    np.testing.assert_allclose(colour, np.pi / 2, rtol=0.02)
    assert alpha == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "llvm_ad_mono", "llvm_ad_spectral_polarized", "scalar_rgb"])
def test_scenes_without_shapes(name):
    """Nothing is seen but the environment; also where no BSDF of any scene is left."""
    with mi.variant_context(name):
        gc.collect()
        colours = "luminance_alpha" if mi.is_monochromatic else "rgba"
        sensor = {"type": "perspective", "film": film(pixel_format=colours)}
        for settings, others, shade in (({"ambient": 0.5}, {}, 0), ({}, {"sun": SUN}, 0), ({}, {"sky": SKY}, 0.5),
                                        ({"environment_reflection": True}, {"sky": SKY}, 0.5)):  # fmt: skip
            empty = {"type": "scene", "integrator": {"type": "shading", **settings}, "sensor": sensor, **others}
            *colour, alpha = shaded(mi.load_dict(empty), spp=4000 if mi.is_spectral else 2).mean(axis=(0, 1))
            assert np.mean(colour) == pytest.approx(shade, rel=0.05)
            assert alpha == (1 if "sky" in others else 0)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "llvm_ad_spectral_polarized"])
def test_instances_are_shaded_like_shapes(name):
    """Of a BSDF of ours and of a built-in one, with all that the lights do."""
    with mi.variant_context(name):
        T = mi.ScalarTransform4f
        settings = {"ambient": 0.1, "environment_reflection": True}
        dark = {"type": "lambert", "reflectance": 0.0}
        for bsdf in ({"type": "phong"}, {"type": "diffuse"}):

            def tile(height, bsdf=bsdf):
                return {"type": "rectangle", "to_world": T().translate([0, 0, height]).scale(9), "bsdf": bsdf}

            group = {"type": "shapegroup", "id": "group", "tile": tile(0)}
            instance = {"type": "instance", "to_world": T().translate([0, 0, 1]), "g": {"type": "ref", "id": "group"}}
            spp = 4000 if mi.is_spectral else 64
            instanced = shaded(plate(dark, SUN, SKY, group, instance, **settings), spp=spp)
            np.testing.assert_allclose(
                instanced.mean(), shaded(plate(dark, SUN, SKY, tile(1), **settings), spp=spp).mean(), rtol=0.02
            )
            assert instanced.mean() > 0.3


@pytest.mark.usefixtures("llvm_rgb")
def test_the_warning_about_mirrors_looks_into_shape_groups():
    group = {"type": "shapegroup", "id": "group", "ball": {"type": "sphere", "bsdf": {"type": "roughconductor"}}}
    instance = {"type": "instance", "g": {"type": "ref", "id": "group"}}
    with pytest.warns(UserWarning, match="shading: no mirror reflectance is known for RoughConductor"):
        shaded(plate(WHITE, SKY, group, instance, environment_reflection=True), spp=1)
