"""What ``shading`` can be part of: derivatives, frozen functions, threads and other integrators; what it says of bad
input."""

import gc
from concurrent.futures import ThreadPoolExecutor

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from plates import SKY, SUN, WHITE, film, from_above, lamp, noisy, plate, refused, shaded
from support import fresh_process

from mi_brdfs.mitsuba import integrator as adapter
from mi_brdfs.mitsuba.integrator import LANES


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("lanes", "opacity", "keys"),
    [
        (LANES, None, [
            "plate.bsdf.exponent.value", "plate.bsdf.diffuse_reflectance.value",
            "plate.bsdf.specular_reflectance.value", "light0.intensity.value", "light0.position",
            "light1.radiance.value", "integrator.ambient.value",
        ]),
        (8, 0.3, [
            "light2.bsdf.opacity.value", "light2.bsdf.nested_bsdf.alpha.data", "plate.bsdf.diffuse_reflectance.value",
            "integrator.ambient.value",
        ]),
    ],
    ids=["", "in passes, through a mask"],
)  # fmt: skip
def test_differentiable(lanes, opacity, keys, monkeypatch):
    """By the logarithms of parameters of BSDFs, of lights and of the ambient light, as finite differences have it, and
    forward by all of them."""
    monkeypatch.setattr(adapter, "LANES", lanes)
    bsdf = {"type": "phong", "normalization": "original", "exponent": 10.0}
    others = [{"type": "point", "position": [1, 0.5, 2], "intensity": 4.0}, SKY | {"radiance": 0.1}]
    if opacity:
        rough = {"type": "bitmap", "bitmap": mi.Bitmap(np.full((2, 2), 0.3, np.float32)), "raw": True}
        inner = {"type": "walter", "alpha": rough | {"format": "variant"}}
        mask = {"type": "mask", "opacity": opacity, "inner": inner}
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
        dr.set_grad(params[key], original)
    params.update()
    forward = dr.forward_to(mean(seed=0))
    assert np.array(forward).item() == pytest.approx(sum(gradients.values()), rel=1e-3)
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


FROZEN = {
    "one pass": ("perspective", None, LANES),
    "passes": ("perspective", None, 256),
    "meter": ("radiancemeter", None, LANES),
    "aov": ("perspective", "aov", LANES),
}


@pytest.mark.slow
def test_frozen_pictures():
    """In a process of their own: Dr.Jit records no picture while a BSDF that its scene does not hold is alive."""
    with fresh_process() as process:
        for name, case in FROZEN.items():
            try:
                process.submit(check_frozen_pictures, *case).result()
            except Exception as error:
                raise AssertionError(name) from error


def check_frozen_pictures(kind, around, lanes):
    """Recorded, and replayed for other parameters: of a plate seen through a mask."""
    mi.set_variant("llvm_ad_rgb")
    gc.collect()
    adapter.LANES = lanes
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


@pytest.mark.slow
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


# --- Bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("ambient", [None, 0.0, {"type": "rgb", "value": [0, 0, 0]}])
def test_no_light_and_no_ambient(ambient):
    given = {} if ambient is None else {"ambient": ambient}
    with refused("shading: the scene has no light; add an emitter to it, or give ambient"):
        mi.render(plate(WHITE, **given))


@pytest.mark.usefixtures("llvm_rgb")
def test_bad_scenes():
    with pytest.raises(RuntimeError, match=r"shading: ambient = -0\.1 is not allowed; it must be a number, rgb or"):
        mi.load_dict({"type": "shading", "ambient": -0.1})
    with refused("environment_reflection needs an environment"):
        mi.render(plate(WHITE, SUN, environment_reflection=True))
    with refused('area_lights = "centre" knows Rectangle, Disk and Sphere, but a light is a Cylinder'):
        mi.render(plate(WHITE, lamp("cylinder"), area_lights="centre"))
    with refused('area_lights = "centre" knows lights of one radiance, but that of a light is a texture'):
        mi.render(plate(WHITE, lamp("disk", {"type": "checkerboard"}), area_lights="centre"))
    for inward in ({"flip_normals": True}, {"to_world": mi.ScalarTransform4f().scale([-1, 1, 1])}):
        with refused('area_lights = "centre" knows spheres that shine outward'):
            mi.render(plate(WHITE, lamp("sphere") | inward, area_lights="centre"))


def test_films_without_colours_are_refused():
    with mi.variant_context("llvm_ad_spectral"):
        band = {"type": "regular", "wavelength_min": 400, "wavelength_max": 700, "values": "0, 1, 0"}
        film = {"type": "specfilm", "width": 2, "height": 2, "band": band}
        sensor = mi.load_dict({"type": "orthographic", "film": film})
        with pytest.raises(ValueError, match="shading: SpecFilm has no colours to finish; use an hdrfilm"):
            mi.load_dict({"type": "shading"}).render(plate(WHITE, SUN), sensor)
