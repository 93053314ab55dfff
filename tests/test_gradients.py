"""Gradients of a rendered picture, against finite differences."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from catalogue import SMOOTH, mostly_slow
from support import direction, interaction

LINEAR = ("reflectance", "subsurface", "metallic", "specular.", "tint", "sheen", "clearcoat.")
"""Parts of the keys of parameters in which a picture is linear or quadratic: a central difference is exact."""

NOISY = ("burley", "kurt two lobes", "walter dielectric")
"""Several lobes that share a parameter, or a weak influence: other samples are chosen after a step, which makes the
differences noisy."""

FAINT = ("sheen",)
"""Parts of the keys of parameters that change the picture so little that this noise takes four times the samples."""


def scene_of(bsdf):
    """A sphere under a point light, where a highlight has no noise, and a sky with a broad bright spot, where both the
    light and the BSDF are sampled."""
    v, u = np.mgrid[0:16, 0:32]
    spot = np.exp(-((v - 5) ** 2 + (u - 18) ** 2) / 20)
    sky = np.repeat((0.01 + 0.2 * spot)[..., None], 3, axis=2).astype(np.float32)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "prb", "max_depth": 3},
            "sensor": {
                "type": "perspective",
                "fov": 22,
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 6], [0.25, 0.25, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
                "sampler": {"type": "independent"},
            },
            "shape": {"type": "sphere", "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 70), "bsdf": bsdf},
            "key": {"type": "point", "position": [2, 3, 5], "intensity": 20.0},
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky)},
        }
    )


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", mostly_slow(SMOOTH))
def test_prb_agrees_with_finite_differences(name):
    """To 2 %, for every continuous parameter; the picture's brightest parts, so the highlight, weigh most. (The weights
    show a turned frame: the highlight that they would be symmetric to has no derivative for the rotation.)

    Both sides use the same random numbers, so they share most of their noise; what remains is below 1 % for 1M paths.
    A central difference over ±3 % errs by some tenths of a percent; parameters in which the picture is linear take
    longer steps against the noise of lobes that are chosen otherwise.
    """
    turned = {"rotation": SMOOTH[name]["rotation"] + 0.05} if "rotation" in SMOOTH[name] else {}
    spp = 1 << (14 if name in NOISY else 12)
    weights = dr.square(mi.render(scene_of({**SMOOTH[name], **turned}), spp=spp, seed=99))
    scene = scene_of(SMOOTH[name])
    params = mi.traverse(scene)

    def loss(spp=spp, **seeds):
        return dr.mean(mi.render(scene, params, spp=spp, **seeds) * weights, axis=None)

    keys = [key for key in params.keys() if key.startswith("shape.bsdf.")]
    assert keys
    for key in keys:
        dr.enable_grad(params[key])
    params.update()
    dr.backward(loss(seed=2, seed_grad=1))
    gradients = {key: np.sum(dr.grad(params[key]).numpy()) for key in keys}
    for key in keys:
        dr.disable_grad(params[key])

    for key in keys:
        original = type(params[key])(params[key])  # params[key] changes with what is assigned to it
        linear = any(part in key for part in LINEAR)
        step = 0.15 if linear else 0.03 * abs(np.array(original).ravel()[0])
        losses, samples = [], 4 * spp if any(part in key for part in FAINT) else spp
        for shift in (step, -step):
            params[key] = original + shift
            params.update()
            losses.append(loss(samples, seed=1).numpy().item())
        params[key] = original
        params.update()
        assert gradients[key] == pytest.approx((losses[0] - losses[1]) / (2 * step), rel=0.02), key


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", ["phong energy", "ward isotropic", "walter correlated", "walter conductor"])
def test_sample_carries_the_gradient_of_the_albedo(name):
    """E[weight] is the albedo, so the derivative of the weights averages to that of the albedo, here taken from the
    quadrature of eval over a fixed grid. It would not if the density or the sampled direction were differentiated as
    well: the choice among lobes depends on the parameters, too. The batches tell the noise, and bound it."""
    bsdf = mi.load_dict(SMOOTH[name])
    params = mi.traverse(bsdf)
    si = interaction(direction(70))
    n = 1500
    x, y = dr.meshgrid(dr.arange(mi.Float, n), dr.arange(mi.Float, n))
    grid = mi.warp.square_to_uniform_hemisphere(mi.Point2f((x + 0.5) / n, (y + 0.5) / n))

    def gradient(key, albedo):
        dr.enable_grad(params[key])
        params.update()
        dr.backward(dr.mean(mi.luminance(albedo())))
        result = np.sum(dr.grad(params[key]).numpy())
        dr.disable_grad(params[key])
        return result

    def weights(seed):
        rng = mi.PCG32(size=1 << 21, initstate=seed)
        u, v = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
        return bsdf.sample(mi.BSDFContext(), si, u, v, True)[1]

    for key in params.keys():
        batches = [gradient(key, lambda seed=seed: weights(seed)) for seed in range(1, 9)]
        noise = np.std(batches, ddof=1) / np.sqrt(len(batches))
        expected = gradient(key, lambda: bsdf.eval(mi.BSDFContext(), si, grid, True) * dr.two_pi)
        assert noise < 0.02 * abs(expected), key
        assert np.mean(batches) == pytest.approx(expected, rel=1e-3, abs=4.5 * noise), key  # 0.3 % of Student's t for 7


@pytest.mark.usefixtures("llvm_rgb")
def test_parameters_at_their_limits_can_be_optimised():
    """A reflectance of 0, or of 1, has the derivative of its neighbours: an optimiser must be able to leave it."""
    for value in (0.0, 1.0):
        bsdf = mi.load_dict({"type": "lambert", "reflectance": value})
        params = mi.traverse(bsdf)
        dr.enable_grad(params["reflectance.value"])
        params.update()
        dr.backward(bsdf.eval(mi.BSDFContext(), interaction(direction(0)), mi.Vector3f(0, 0, 1), True)[0])
        assert dr.grad(params["reflectance.value"]).numpy() == pytest.approx(1 / np.pi)
