"""How ``shading`` gets from samples to a picture: passes and memory, sensors, films, other integrators, derivatives."""

import gc
import os
import signal
from concurrent.futures import ThreadPoolExecutor

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from plates import SKY, SUN, WHITE, film, from_above, load, plate, shaded
from support import is_scalar

from mi_brdfs import render
from mi_brdfs.mitsuba import integrator as adapter
from mi_brdfs.mitsuba.integrator import LANES

# --- Passes ---------------------------------------------------------------------------------------------------------


def noisy(size=4, **settings):
    """A plate that a bright sky lights, where each sample sees another part of the sky."""
    return plate(WHITE, SKY | {"radiance": 1.2}, size=size, **settings)


def in_passes(scene, monkeypatch, samples=4, **given):
    """The picture that ``mi-brdfs render`` makes, in passes of some samples."""
    monkeypatch.setattr(render, "_samples_per_pass", lambda: samples * int(np.prod(scene.sensors()[0].film().size())))
    picture = render.render(scene, **given)
    return np.array(picture.image, np.float64), picture


def in_lanes(scene, monkeypatch, **given):
    """The picture that ``mi.render`` makes, where it draws four samples of each pixel at once."""
    monkeypatch.setattr(adapter, "LANES", 4 * int(np.prod(scene.sensors()[0].film().size())))
    return shaded(scene, **given)


def check_finish(monkeypatch):
    """Clamp and tone curve act on the mean of all samples: on what there is without them, drawn by the same seeds. The
    mean is that of as many samples as there are, the last pass having fewer."""
    for picture in (lambda scene: in_passes(scene, monkeypatch, spp=10)[0],
                    lambda scene: in_lanes(scene, monkeypatch, spp=12)):  # fmt: skip
        means = picture(noisy(clamp=False))
        assert np.ptp(means) > 0.5
        assert means.max() > 1.5
        np.testing.assert_allclose(picture(noisy(clamp=False, tonemap="reinhard")), means / (1 + means), rtol=1e-5)
        np.testing.assert_allclose(picture(noisy()), np.minimum(means, 1), rtol=1e-5)
        np.testing.assert_allclose(picture(plate(WHITE, SUN, size=4)), 0.8, rtol=1e-5)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "scalar_rgb"])
def test_the_mean_over_all_passes_is_finished(name, monkeypatch):
    with mi.variant_context(name):
        check_finish(monkeypatch)


@pytest.mark.usefixtures("llvm_rgb")
def test_passes_draw_different_samples(monkeypatch):
    """Sixteen passes have the noise of all their samples, from whichever loop they come."""
    at_once = shaded(noisy(32, clamp=False), spp=64).std()
    assert in_lanes(noisy(32, clamp=False), monkeypatch, spp=64).std() == pytest.approx(at_once, rel=0.15)
    assert in_passes(noisy(32, clamp=False), monkeypatch, spp=64)[0].std() == pytest.approx(at_once, rel=0.15)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("sampler", ["stratified", "multijitter", "orthogonal", "ldsampler"])
def test_samplers_stratify_over_all_that_is_drawn(sampler, monkeypatch):
    """Of 64 samples in sixteen passes."""
    sensor = {"type": "orthographic", "to_world": from_above(), "film": film(16), "sampler": {"type": sampler}}
    scene = noisy(sensor=sensor, clamp=False)
    independent = in_lanes(noisy(16, clamp=False), monkeypatch, spp=64)
    stratified = in_lanes(scene, monkeypatch, spp=64)
    assert stratified.mean() == pytest.approx(0.8 * np.pi * 1.2, rel=0.02)
    assert stratified.std() < 0.5 * independent.std()


def peak(work, *given):
    """What ``work`` returns, and the largest number of bytes that are in use before it does."""
    dr.sync_thread()
    dr.flush_malloc_cache()
    dr.detail.malloc_clear_statistics()
    result = work(*given)
    dr.eval(result)
    dr.sync_thread()
    return result, dr.detail.malloc_watermark(dr.JitBackend.LLVM)


def check_memory(monkeypatch):
    """16 times as many samples take no more memory."""
    monkeypatch.setattr(adapter, "LANES", 8 * 64 * 64)
    scene = noisy(64)
    # What is in use while the first compiles its kernels does not count.
    _, (_, few), (_, many) = (peak(lambda spp: dr.eval(mi.render(scene, spp=spp)), spp) for spp in (32, 32, 512))
    assert many < 1.05 * few


@pytest.mark.usefixtures("llvm_rgb")
def test_memory_does_not_grow_with_samples(monkeypatch):
    check_memory(monkeypatch)


@pytest.mark.usefixtures("llvm_rgb")
def test_memory_of_derivatives_does_not_grow_with_samples(monkeypatch):
    """Forward and backward, which find the same for the same seeds."""
    monkeypatch.setattr(adapter, "LANES", 8 * 32 * 32)
    scene = noisy(32, ambient=0.1, tonemap="reinhard")
    params = mi.traverse(scene)
    given = mi.Float(0.8)

    def derivative(spp, forward):
        reflectance = mi.Float(given)
        dr.enable_grad(reflectance)
        params["plate.bsdf.reflectance.value"] = reflectance
        params.update()
        mean = dr.mean(mi.render(scene, params, spp=spp, seed_grad=1), axis=None)
        dr.forward(reflectance) if forward else dr.backward(mean)
        return mi.Float(dr.grad(mean).array) if forward else dr.grad(reflectance)

    found = {}
    for forward in (False, True):
        _, (_, few), (found[forward], many) = (peak(derivative, spp, forward) for spp in (16, 16, 256))
        assert many < 1.05 * few
    assert found[True][0] == pytest.approx(found[False][0], rel=1e-3)
    # By the derivative of m / (1 + m) at the mean, which is proportional to the reflectance.
    m = 0.8 * (np.pi * 1.2 + 0.1)
    assert found[True][0] == pytest.approx(m / (1 + m) ** 2 / 0.8, rel=0.02)


@pytest.mark.usefixtures("llvm_rgb")
def test_the_rays_of_a_pass_are_traced_once():
    """In one kernel, though a pass has several channels to add up."""
    scene = noisy(16)
    dr.eval(mi.render(scene, spp=8))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        dr.eval(mi.render(scene, spp=8, seed=1))
        sizes = [kernel["size"] for kernel in dr.kernel_history([dr.KernelType.JIT])]
    assert sizes.count(16 * 16 * 8) == 1


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "scalar_rgb"])
def test_ctrl_c_keeps_a_finished_picture(name, monkeypatch):
    def interrupted(**settings):
        def press(done, total):
            if done == 8:
                os.kill(os.getpid(), signal.SIGINT)

        image, picture = in_passes(noisy(**settings), monkeypatch, spp=16, on_pass=press)
        assert (picture.spp, picture.total) == (8, 16)
        return image

    with mi.variant_context(name):
        means = interrupted(clamp=False)
        np.testing.assert_allclose(interrupted(tonemap="reinhard"), means / (1 + means), rtol=1e-5)


def test_a_pass_of_a_scalar_variant_that_ctrl_c_hits_counts(monkeypatch):
    """As it runs to its end, unlike those of Mitsuba's own integrators."""
    with mi.variant_context("scalar_rgb"):
        scene = noisy()
        integrator = type(scene.integrator())
        sums = integrator.sums

        def struck(self, *args, **given):
            os.kill(os.getpid(), signal.SIGINT)
            return sums(self, *args, **given)

        monkeypatch.setattr(integrator, "sums", struck)
        assert in_passes(scene, monkeypatch, spp=16)[1].spp == 4


@pytest.mark.usefixtures("llvm_rgb")
def test_passes_of_scenes_without_noise_make_the_same_picture():
    scene = load("bands", 48, 16)
    np.testing.assert_allclose(np.array(render.render(scene, spp=7).image), shaded(scene, spp=1), atol=1e-5)


# --- Pixels, films and sensors --------------------------------------------------------------------------------------

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
    return np.array(mi.load_dict({"type": rfilter}).eval(mi.Float(distance.ravel()))).reshape(count, count)


def check_pixels(rfilter="box", border=False):
    """A window cut from a picture has the shade in the centre of each pixel, finished, and then filtered."""
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


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("border", [False, True], ids=["", "border"])
@pytest.mark.parametrize("rfilter", ["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"])
def test_filters_act_on_finished_pixels(rfilter, border):
    check_pixels(rfilter, border)


def check_alpha():
    """Under an environment nothing is transparent, however many samples there are."""
    sensor = {"type": "orthographic", "to_world": from_above(), "film": film(pixel_format="rgba")}
    for spp in (1, 3):
        np.testing.assert_allclose(shaded(noisy(sensor=sensor), spp=spp)[..., 3], 1, atol=1e-6)


@pytest.mark.usefixtures("llvm_rgb")
def test_alpha_under_an_environment():
    check_alpha()


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


@pytest.mark.parametrize(("rfilter", "tolerance"), [("box", 1e-5), ("gaussian", 0.03)])
def test_same_picture_in_scalar_variants(rfilter, tolerance):
    """The two ways to go through the pixels, also with a crop and a filter that reaches over the border, which scalar
    variants look up in a table."""
    images = []
    for variant in ("llvm_ad_rgb", "scalar_rgb"):
        with mi.variant_context(variant):
            scene = load("phong", 24, 16)
            film = {"type": "hdrfilm", "width": 24, "height": 16, "rfilter": {"type": rfilter}, "sample_border": True,
                    "crop_width": 9, "crop_height": 7, "crop_offset_x": 8, "crop_offset_y": 1,
                    "pixel_format": "rgba"}  # fmt: skip
            T = mi.ScalarTransform4f
            up = T().look_at(origin=[0, 0, 10], target=[0, 0, 0], up=[0, 1, 0]).scale([2.1, 2.1, 1])
            sensor = mi.load_dict({"type": "orthographic", "to_world": up, "film": film})
            images.append(np.array(scene.integrator().render(scene, sensor, seed=1, spp=2)))
            whole = np.array(scene.integrator().render(scene, spp=1))
    assert images[0].shape == (7, 9, 4)
    np.testing.assert_allclose(images[0], images[1], atol=tolerance)
    if rfilter == "box":
        np.testing.assert_allclose(images[0][..., :3], whole[1:8, 8:17], atol=tolerance)
        assert set(np.unique(images[0][..., 3])) == {0, 1}


# --- Derivatives, frozen functions, threads and other integrators ----------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("lanes", "opacity", "keys"),
    [
        (LANES, None, [
            "plate.bsdf.exponent.value", "plate.bsdf.diffuse_reflectance.value",
            "plate.bsdf.specular_reflectance.value", "light0.intensity.value", "light0.position",
            "light1.radiance.value", "integrator.ambient.value",
        ]),
        (8, 0.3, ["light2.bsdf.opacity.value", "plate.bsdf.diffuse_reflectance.value", "integrator.ambient.value"]),
    ],
    ids=["", "in passes, through a mask"],
)  # fmt: skip
def test_differentiable(lanes, opacity, keys, monkeypatch):
    """By the logarithms of parameters of BSDFs, of lights and of the ambient light, as finite differences have it."""
    monkeypatch.setattr(adapter, "LANES", lanes)
    bsdf = {"type": "phong", "normalization": "original", "exponent": 10.0}
    others = [{"type": "point", "position": [1, 0.5, 2], "intensity": 4.0}, SKY | {"radiance": 0.1}]
    if opacity:
        mask = {"type": "mask", "opacity": opacity, "inner": {"type": "twosided", "inner": WHITE}}
        T = mi.ScalarTransform4f
        others.append({"type": "rectangle", "to_world": T().translate([0, 0, 1]).scale(9), "bsdf": mask})
    settings = {"ambient": 0.2, "environment_reflection": True, "tonemap": "reinhard"}
    scene = plate(bsdf, *others, tilt=20, **settings)
    params = mi.traverse(scene)

    def mean(seed):
        return dr.mean(mi.render(scene, params, spp=4, seed=seed, seed_grad=1 + seed), axis=None)

    originals = {key: type(params[key])(params[key]) for key in keys}  # what params gives is no copy
    for key in keys:
        dr.enable_grad(params[key])
    params.update()
    dr.backward(mean(seed=0))
    gradients = {key: np.sum(np.array(dr.grad(params[key])) * np.array(originals[key])) for key in keys}
    for key, original in originals.items():
        ends = []
        for factor in (1.01, 0.99):
            params[key] = type(original)(factor * original)
            params.update()
            ends.append(np.array(mean(seed=1), np.float64).item())
        params[key] = type(original)(original)
        params.update()
        assert gradients[key] == pytest.approx((ends[0] - ends[1]) / 0.02, rel=0.01), key
        assert abs(gradients[key]) > 1e-3


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("kind", "around", "lanes"),
    [
        ("perspective", None, LANES),
        ("perspective", None, 256),
        ("radiancemeter", None, LANES),
        ("perspective", "aov", LANES),
    ],
    ids=["one pass", "passes", "meter", "aov"],
)
def test_frozen_pictures(kind, around, lanes, monkeypatch):
    """Recorded, and replayed for other parameters: of a plate seen through a mask."""
    monkeypatch.setattr(adapter, "LANES", lanes)
    own = {"type": "shading", "ambient": 0.1, "clamp": False}
    T = mi.ScalarTransform4f
    pane = {"type": "mask", "opacity": 0.3, "inner": {"type": "twosided", "inner": WHITE}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "d:depth", "own": own} if around else own,
            # Mitsuba cannot freeze an orthographic camera, nor a thin lens.
            "sensor": {"type": kind, "to_world": from_above(), "film": film(1 if kind == "radiancemeter" else 8)},
            "ball": {"type": "sphere", "bsdf": {"type": "phong"}},
            "pane": {"type": "rectangle", "to_world": T().translate([0, 0, 2]).scale(9), "bsdf": pane},
            "light": SUN | {"irradiance": 0.5},
            "sky": SKY | {"radiance": 0.1},
        }
    )
    params = mi.traverse(scene)
    ambient = next(key for key in params.keys() if key.endswith("ambient.value"))
    frozen = dr.freeze(lambda scene, seed: mi.render(scene, spp=8, seed=seed), auto_opaque=False)
    pictures = []
    for seed in range(4):
        for key in ("ball.bsdf.diffuse_reflectance.value", ambient):
            params[key] = mi.Float(0.1 * (seed + 1))
        params.update()
        pictures.append(np.array(frozen(scene, dr.opaque(mi.UInt32, seed))))
        np.testing.assert_allclose(pictures[-1], shaded(scene, spp=8, seed=seed), atol=1e-5)
    assert abs(pictures[3] - pictures[2]).max() > 0.03
    assert frozen.n_recordings < 4


@pytest.mark.usefixtures("llvm_rgb")
def test_pictures_made_in_several_threads(monkeypatch):
    """At the same time, each of a scene of its own, in several passes."""
    monkeypatch.setattr(adapter, "LANES", 4 * 16 * 16)
    scenes = [noisy(16, ambient=0.1 * k, clamp=False) for k in range(4)]
    alone = [shaded(scene, spp=12, seed=k) for k, scene in enumerate(scenes)]

    def work(k):
        return shaded(scenes[k], spp=12, seed=k)

    with ThreadPoolExecutor(3) as pool:
        for together, expected in zip(pool.map(work, range(4)), alone, strict=True):
            np.testing.assert_allclose(together, expected, rtol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_within_aov():
    scene = plate(WHITE, SUN, tilt=10)
    both = {"type": "aov", "aovs": "dd:depth,ab:albedo", "inner": {"type": "shading"}}
    image = shaded(scene, integrator=mi.load_dict(both), spp=2)
    np.testing.assert_allclose(image[..., :3], shaded(scene, spp=1), rtol=1e-4)
    np.testing.assert_allclose(image[..., 3], 5, rtol=0.1)
    np.testing.assert_allclose(image[..., 4:], 0.8, rtol=1e-4)
