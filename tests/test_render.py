"""Progressive rendering: nothing is lost, counted twice or biased by the division into passes."""

import os
import signal
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_brdfs  # noqa: F401
from mi_brdfs.rendering import passes as module
from mi_brdfs.rendering.output import display_image, tonemap
from mi_brdfs.rendering.passes import render

WIDTH, HEIGHT = 32, 24


@pytest.fixture(params=[pytest.param("scalar_rgb", marks=pytest.mark.slow), "llvm_ad_rgb"])
def variant(request):
    mi.set_variant(request.param)
    return request.param


@pytest.fixture(autouse=True)
def four_samples_a_pass(monkeypatch):
    monkeypatch.setattr(module, "_samples_per_pass", lambda threads: 4 * WIDTH * HEIGHT)


def scene(integrator=None, sampler="independent", **film):
    box = mi.cornell_box()
    box["integrator"] = integrator or {"type": "path", "max_depth": 3}
    box["sensor"]["film"] = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, **film}
    box["sensor"]["sampler"] = {"type": sampler, "sample_count": 16}
    return mi.load_dict(box)


def mean_weight(loaded):
    return np.array(loaded.sensors()[0].film().develop(raw=True))[..., 3].mean()


class Deposits:
    """An integrator whose passes leave given numbers in the film."""

    def __init__(self, deposits):
        self.deposits, self.seeds, self.counts = list(deposits), [], []

    def render(self, scene, sensor, seed, spp, evaluate):
        film = sensor.film()
        film.prepare([])
        tensor = mi.TensorXf(self.deposits[len(self.seeds)])
        film.put_block(mi.ImageBlock(tensor, film.crop_offset(), border=False))
        self.seeds.append(seed)
        self.counts.append(spp)


def test_the_result_is_exactly_the_sum_of_the_raw_passes(variant, monkeypatch):
    deposits = np.random.default_rng(0).uniform(0.1, 2, (3, HEIGHT, WIDTH, 4)).astype(np.float32)
    integrator, sensors = Deposits(deposits), scene().sensors()
    given = SimpleNamespace(sensors=lambda: sensors, integrator=lambda: integrator)
    picture = render(given, spp=10, seed=3)
    total = (deposits[0] + deposits[1]) + deposits[2]
    assert np.array_equal(np.array(sensors[0].film().develop(raw=True)), total)
    np.testing.assert_allclose(np.array(picture.image), total[..., :3] / total[..., 3:], rtol=1e-6)
    assert integrator.counts == [4, 4, 2] and len(set(integrator.seeds)) == 3
    # One sample at least, in however many pixels; powers of two are not exceeded.
    for limit, counts in (0, [1, 1]), (7 * WIDTH * HEIGHT, [4, 1]):
        monkeypatch.setattr(module, "_samples_per_pass", lambda threads, limit=limit: limit)
        integrator.seeds, integrator.counts = [], []
        render(given, spp=sum(counts))
        assert integrator.counts == counts
    sizes, total = module._pass_sizes(sensors[0].sampler(), 9 * 10**12 + 1, 4)
    assert total == 9 * 10**12 + 1 and next(iter(sizes)) == 4  # without a list of them


def test_passes_agree_with_one_render_of_the_same_total(variant):
    loaded = scene()
    passes = np.array(render(loaded, spp=256, seed=1).image)
    at_once = np.array(mi.render(loaded, spp=256, seed=77))
    difference = (passes - at_once).mean(axis=-1).ravel()
    assert np.any(difference)
    assert abs(difference.mean()) < 4 * difference.std() / np.sqrt(difference.size)
    # The noise of the two is the same too, so no samples were lost or repeated.
    again = np.array(mi.render(loaded, spp=256, seed=78))
    noise = np.median(np.abs(difference)) / np.median(np.abs((again - at_once).mean(axis=-1)))
    assert 0.8 < noise < 1.25


def test_the_seed_decides_the_noise(variant):
    """A single pass has that of Mitsuba's; and the scene is left as it was."""
    loaded = scene()
    render(loaded, spp=6)
    assert render(loaded).total == 16
    np.testing.assert_allclose(np.array(render(loaded, spp=4).image), np.array(mi.render(loaded, spp=4)), rtol=1e-4)
    a, b, c = (np.array(render(loaded, spp=10, seed=seed).image) for seed in (5, 5, 6))
    np.testing.assert_allclose(a, b, rtol=1e-4)
    assert not np.allclose(a, c, rtol=1e-2)


def test_particle_tracing_is_averaged_not_summed(variant):
    traced = np.array(render(scene({"type": "ptracer", "max_depth": 3}), spp=66).image).mean()
    assert traced == pytest.approx(np.array(mi.render(scene(), spp=256)).mean(), rel=0.05)


@pytest.mark.parametrize(
    "film",
    [
        {"pixel_format": "luminance"},
        {"pixel_format": "rgba", "crop_width": 10, "crop_height": 7, "crop_offset_x": 5, "crop_offset_y": 2},
        {"pixel_format": "xyz", "sample_border": True, "rfilter": {"type": "mitchell"}},
    ],
    ids=lambda film: film["pixel_format"],
)
def test_films_and_aovs_are_developed_as_by_mitsuba(variant, film):
    loaded = scene({"type": "aov", "aovs": "depth:depth", "inner": {"type": "path", "max_depth": 3}}, **film)
    spp = 300 if "crop_width" in film else 68  # of the mean, a standard deviation of 1.5 to 2.5 %
    picture = render(loaded, spp=spp)
    mi.render(loaded, spp=spp, seed=9)
    own = loaded.sensors()[0].film()
    expected = np.array(own.develop())
    assert [field.name for field in picture.bitmap.struct_()] == [field.name for field in own.bitmap().struct_()]
    assert np.array(picture.image).shape == expected.shape
    np.testing.assert_allclose(np.array(picture.image).mean((0, 1)), expected.mean((0, 1)), rtol=0.1)
    assert np.array(display_image(picture.bitmap)).shape == (*expected.shape[:2], 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["llvm_ad_mono_polarized", "llvm_ad_spectral", "scalar_spectral_polarized"])
def test_other_variants(name):
    mi.set_variant(name)
    stokes = "polarized" in name
    loaded = scene({"type": "stokes", "inner": {"type": "path"}} if stokes else None)
    picture = render(loaded, spp=10)
    expected = np.array(mi.render(loaded, spp=64, seed=9))
    assert np.array(picture.image).shape == expected.shape
    assert np.array(picture.image)[..., 0].mean() == pytest.approx(expected[..., 0].mean(), rel=0.15)
    assert display_image(picture.bitmap) is not None


def test_a_spectral_film_has_no_display_image():
    mi.set_variant("scalar_spectral")
    bands = {f"band_{low}": {"type": "spectrum", "value": [(low, 1), (low + 100, 1)]} for low in (400, 500)}
    bitmap = render(scene(type="specfilm", **bands), spp=4).bitmap
    assert sorted(field.name for field in bitmap.struct_()) == ["band_400", "band_500"]
    assert display_image(bitmap) is None


def test_samples_are_counted_as_the_sampler_rounds_them(variant):
    at_once = scene({"type": "depth"})
    mi.render(at_once, spp=64)
    rounded = {"independent": (10, 10), "stratified": (10, 12), "multijitter": (7, 7), "orthogonal": (10, 12)}
    for sampler, (spp, counted) in (rounded | {"ldsampler": (5, 8)}).items():
        loaded, progress = scene({"type": "depth"}, sampler=sampler), []
        picture = render(loaded, spp=spp, on_pass=lambda *it, progress=progress: progress.append(it))
        assert (picture.spp, picture.total) == (counted, counted), sampler
        assert progress[-1] == (counted, counted) and len(progress) > 1
        assert mean_weight(loaded) / counted == pytest.approx(mean_weight(at_once) / 64, rel=0.05)


@pytest.mark.usefixtures("ctrl_c")
def test_the_first_ctrl_c_keeps_what_is_finished_and_the_second_raises(variant):
    def press(times):
        return lambda done, total: [os.kill(os.getpid(), signal.SIGINT) for _ in range(times)]

    before, loaded = signal.getsignal(signal.SIGINT), scene()
    picture = render(loaded, spp=16, on_pass=press(1))
    assert (picture.spp, picture.total) == (4, 16)
    assert np.array(picture.image).mean() > 0.01
    with pytest.raises(KeyboardInterrupt):
        render(loaded, spp=16, on_pass=press(2))
    assert signal.getsignal(signal.SIGINT) is before


def test_passes_share_their_kernels():
    mi.set_variant("llvm_ad_rgb")
    loaded = scene()
    render(loaded, spp=4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        render(loaded, spp=40, seed=12)
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert len(kernels) >= 10
    assert sum(not kernel["cache_hit"] for kernel in kernels) <= 2


def test_tonemapping_keeps_darks_hue_and_order_of_highlights():
    image = np.random.default_rng(2).uniform(0, 1, (100, 100, 3)) * np.linspace(0, 30, 100)[:, None, None]
    mapped, m = tonemap(image), image.max(-1)
    dark = m <= 0.8
    np.testing.assert_allclose(mapped[dark], image[dark])
    assert mapped.min() >= 0 and mapped.max() <= 1 + 1e-12
    np.testing.assert_allclose(mapped * m[..., None], image * mapped.max(-1)[..., None], atol=1e-9)
    bright = np.unique(m[(m > 0) & (m < np.percentile(m, 99.9))])
    grey = np.append(bright, np.full(bright.size // 500, 40.0))[:, None, None].repeat(3, axis=-1)
    assert np.all(np.diff(tonemap(grey)[: bright.size, 0, 0]) > 0)
    assert tonemap(np.full((4, 4, 3), 7.0)).max() == pytest.approx(1)
    endless = np.float32([np.inf, 1e38, 3e38])[:, None, None] * np.ones(3, np.float32)
    np.testing.assert_allclose(tonemap(endless), 1, 1e-6)


def test_tonemapping_is_smooth_and_survives_bad_pixels():
    """Also where the shoulder begins."""
    ramp = np.repeat(np.linspace(0, 10, 100_001)[:, None, None], 3, axis=-1)
    slope = np.diff(tonemap(ramp)[:, 0, 0]) / np.diff(ramp[:, 0, 0])
    assert np.abs(np.diff(slope[:-200])).max() < 1e-3
    image = np.full((30, 30, 3), 0.5)
    image[0, 0], image[1, 1], image[2, 2] = np.nan, np.inf, -3
    mapped = tonemap(image)
    assert np.isfinite(mapped).all() and mapped[0, 0].max() == 0 and mapped[2, 2].max() == 0
    np.testing.assert_allclose(mapped[1, 1], 1)
    assert mapped[5, 5].max() == 0.5


def test_the_display_image_of_a_well_exposed_picture_is_plain_srgb(variant):
    pixels = np.random.default_rng(3).uniform(0, 1, (20, 30, 3)).astype(np.float32)
    plain = np.array(mi.util.convert_to_bitmap(mi.Bitmap(pixels))).astype(int)
    shown = mi.util.convert_to_bitmap(mi.Bitmap(pixels))  # bytes, which are sRGB already
    fine = mi.Bitmap(pixels).convert(component_format=mi.Struct.Type.UInt16, srgb_gamma=True)
    for given in mi.Bitmap(pixels), pixels, mi.TensorXf(pixels), shown, np.array(shown), fine:
        assert np.abs(np.array(display_image(given)).astype(int) - plain).max() <= 1
