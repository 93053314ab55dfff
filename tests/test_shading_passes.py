"""How ``shading`` draws samples in passes: their mean is what is finished, and they take no more memory than one."""

import os
import signal

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from plates import SUN, WHITE, film, from_above, noisy, plate, shaded

from mi_brdfs.mitsuba import integrator as adapter
from mi_brdfs.rendering import passes as render


def in_passes(scene, monkeypatch, samples=4, **given):
    """The picture that ``mi-brdfs render`` makes, in passes of some samples."""
    monkeypatch.setattr(
        render, "_samples_per_pass", lambda threads: samples * int(np.prod(scene.sensors()[0].film().size()))
    )
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


@pytest.mark.slow
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


@pytest.mark.usefixtures("llvm_rgb")
def test_memory_does_not_grow_with_samples(monkeypatch):
    """16 times as many take no more."""
    monkeypatch.setattr(adapter, "LANES", 8 * 64 * 64)
    scene = noisy(64)
    # What is in use while the first compiles its kernels does not count.
    _, (_, few), (_, many) = (peak(lambda spp: dr.eval(mi.render(scene, spp=spp)), spp) for spp in (32, 32, 512))
    assert many < 1.05 * few


@pytest.mark.slow
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
