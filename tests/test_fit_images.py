"""Parameters from pictures: what was put in comes out, whatever the start."""

import json
import re

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_brdfs.fit import FitError, images

pytestmark = pytest.mark.usefixtures("llvm_rgb")

SIZE = 32


def rgb(*value):
    return {"type": "rgb", "value": [*value]}


def scene_of(bsdf, shape=None, size=SIZE, integrator="prb", origins=((0, 0, 5.2),), lights=None, pixel_format="rgb"):
    """A surface under an even sky and two lamps, from some places."""
    T = mi.ScalarTransform4f
    sensors = {
        f"sensor_{k}": {
            "type": "perspective",
            "fov": 24,
            "to_world": T().look_at(origin=[*origin], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "pixel_format": pixel_format,
                     "rfilter": {"type": "box"}},
        }
        for k, origin in enumerate(origins)
    }  # fmt: skip
    if lights is None:
        lights = lamps(0.3, key=([-3, 3, 4], 30.0), rim=([4, 1, -1], 20.0))
    if isinstance(integrator, str):
        integrator = {"type": integrator} | ({} if integrator == "shading" else {"max_depth": 2})
    surface = shape or {"type": "sphere", "to_world": T().rotate([1, 0, 0], -70)}
    return mi.load_dict(
        {"type": "scene", "integrator": integrator, **sensors, **lights,
         "ball": {**surface, "bsdf": bsdf}}
    )  # fmt: skip


def picture_of(scene, sensor=0, spp=1024):
    return np.array(mi.render(scene, sensor=sensor, spp=spp, seed=1000))


def fitted(start, hidden, *sought, spp=1024, samples=None, **options):
    """Fit a material to a picture of another one."""
    picture = picture_of(scene_of(hidden, **options), spp=spp)
    return images(scene_of(start, **options), picture, sought or None, spp=samples)


def lamps(sky=None, **lamps):
    """The radiance of a sky, and the place and intensity of each lamp."""
    points = {name: {"type": "point", "position": place, "intensity": it} for name, (place, it) in lamps.items()}
    return ({"sky": {"type": "constant", "radiance": sky}} if sky else {}) | points


def values(found, of="ball.bsdf"):
    """The values of a BSDF by the names of its parameters."""
    return {key[len(of) + 1 :].rpartition(".")[0]: value for key, value in found.values.items()}


START = {"diffuse_reflectance": rgb(0.5, 0.5, 0.5), "specular_reflectance": rgb(0.2, 0.2, 0.2)}
HIDDEN = {"diffuse_reflectance": rgb(0.1, 0.2, 0.3), "specular_reflectance": rgb(0.5, 0.4, 0.3)}


@pytest.mark.slow
@pytest.mark.parametrize("start", [(0.01, 0.01), (0.3, 0.05)])
def test_an_anisotropic_highlight(start):
    """Adam on the parameters themselves ends at 0.01 instead of 0.05."""
    truth = {"alpha_u": 0.05, "alpha_v": 0.3, **HIDDEN}
    found = fitted({"type": "ward", "alpha_u": start[0], "alpha_v": start[1], **START}, {"type": "ward", **truth})
    assert found.converged and not found.bounds
    for name, hidden in truth.items():
        value = np.array(hidden["value"] if isinstance(hidden, dict) else hidden)
        sigma = np.array(found.sigma[f"ball.bsdf.{name}.value"])
        assert (abs(values(found)[name] - value) < 3 * sigma).all() and (sigma < 0.12 * value + 0.01).all(), name
    assert values(found)["alpha_u"] == pytest.approx(0.05, rel=0.05)
    assert values(found)["alpha_v"] == pytest.approx(0.3, rel=0.05)


def test_a_rotation_goes_all_the_way():
    """A step is short if it is so in radians: the first ones, where highlights hardly overlap, are in turns."""
    ward, lights = {"type": "ward", "alpha_u": 0.05, "alpha_v": 0.3}, lamps(0.3, key=([3, 3, 4], 30.0))
    found = fitted(ward | {"rotation": 0.0}, ward | {"rotation": 0.1}, "ball.bsdf.rotation", lights=lights)
    assert found.converged and values(found)["rotation"] == pytest.approx(0.1, abs=3e-3)


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_share_that_starts_at_an_end(start):
    found = fitted(
        {"type": "lambert", "reflectance": start}, {"type": "lambert", "reflectance": 0.5}, spp=64, samples=64
    )
    assert found.converged and values(found)["reflectance"] == pytest.approx(0.5, abs=5e-3)


def test_alpha_is_no_colour():
    """It differs between ``path``, which sees the sky, and ``prb``."""
    lambert = {"type": "lambert", "reflectance": rgb(0.2, 0.5, 0.8)}
    picture = picture_of(scene_of(lambert, integrator="path", pixel_format="rgba"), spp=64)
    assert picture.shape[2] == 4 and picture[0, 0, 3] == 1
    grey = {"type": "lambert", "reflectance": rgb(0.5, 0.5, 0.5)}
    first, second = (
        images(scene_of(grey, integrator="path", pixel_format="rgba"), given, spp=64)
        for given in (picture, picture[..., :3])
    )
    assert values(first)["reflectance"] == pytest.approx([0.2, 0.5, 0.8], abs=2e-3)
    assert first.losses == pytest.approx(second.losses, rel=1e-3)


def test_bitmaps_are_in_the_colours_of_the_film():
    """What mi.Bitmap holds says which colours it has, but an array is as the film."""
    lambert, grey = ({"type": "lambert", "reflectance": rgb(*value)} for value in ((0.2, 0.5, 0.8), (0.5, 0.5, 0.5)))
    scene = scene_of(lambert, pixel_format="xyz")
    array = picture_of(scene, spp=64)
    for given in (array, scene.sensors()[0].film().bitmap(), mi.Bitmap(picture_of(scene_of(lambert), spp=64))):
        found = images(scene_of(grey, pixel_format="xyz"), given, spp=64)
        assert values(found)["reflectance"] == pytest.approx([0.2, 0.5, 0.8], abs=5e-3)


def test_a_number_that_few_pixels_decide_is_no_surer_than_others():
    """They leave no residuals of their own. From picture to picture, what is found varies by 0.0021."""
    start, hidden = ({"type": "ward", "alpha": alpha} for alpha in (0.3, 0.15))
    found = fitted(start, hidden, "ball.bsdf.alpha", spp=64, size=16, lights=lamps(lamp=([2, 3, 4], 20.0)))
    sigma = found.sigma["ball.bsdf.alpha.value"]
    assert abs(values(found)["alpha"] - 0.15) < 4 * sigma and 5e-4 < sigma < 0.01


def test_a_texture_that_the_scene_holds(tmp_path):
    """Its key is its own."""
    mi.Bitmap(np.full((2, 2, 1), 0.2, np.float32)).write(str(tmp_path / "grey.exr"))
    grey = f"""<texture type="bitmap" id="grey"><string name="filename" value="{tmp_path / "grey.exr"}"/>
        <boolean name="raw" value="true"/><string name="format" value="variant"/></texture>"""
    ball = '<bsdf type="phong" id="ball"><ref name="diffuse_reflectance" id="grey"/></bsdf>'
    light = '<emitter type="constant"/><integrator type="prb"/>'
    sensor = """<sensor type="perspective"><transform name="to_world"><translate z="-4"/></transform>
        <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>"""
    scene = mi.load_string(f'<scene version="3.0.0">{grey}{ball}{light}{sensor}'
                           '<shape type="sphere"><ref id="ball"/></shape></scene>')  # fmt: skip
    picture = picture_of(scene, spp=256)
    params = mi.traverse(scene)
    (key,) = (key for key in params.keys() if key.endswith(".data"))
    params[key] = mi.TensorXf(np.full((2, 2, 1), 0.4, np.float32))
    params.update()
    found = images(scene, picture, key, iterations=5, spp=64)
    np.testing.assert_allclose(found.values[key], 0.2, atol=0.02)
    assert found.bsdfs["ball"]["type"] == "phong"


def test_derivatives_that_an_optimiser_left():
    """At another parameter: they would be added to those of the pictures."""
    picture = picture_of(scene_of({"type": "ward", "alpha": 0.15}), spp=64)
    scene = scene_of({"type": "ward", "alpha": 0.3})
    params = mi.traverse(scene)
    left = params["ball.bsdf.specular_reflectance.value"]
    dr.enable_grad(left)
    dr.set_grad(left, 100)
    params.update()
    found = images(scene, picture, "ball.bsdf.alpha", spp=64)
    assert values(found)["alpha"] == pytest.approx(0.15, rel=0.05)


def test_derivatives_of_another_scene():
    """Of a picture that waits for them: Dr.Jit cannot take ours alone, and does after what the message says."""
    other = scene_of({"type": "ward", "alpha": 0.3}, integrator="path", size=8)
    params = mi.traverse(other)
    dr.enable_grad(params["ball.bsdf.alpha.value"])
    params.update()
    picture = mi.render(other, params, spp=4)
    scene = scene_of({"type": "ward", "alpha": 0.5}, size=8)
    with pytest.raises(FitError, match=r"call dr\.disable_grad for that parameter, or dr\.backward for that picture"):
        images(scene, np.array(picture), "ball.bsdf.alpha", iterations=1, spp=4)
    dr.disable_grad(params["ball.bsdf.alpha.value"])
    assert images(scene, np.array(picture), "ball.bsdf.alpha", iterations=1, spp=4).values


@pytest.mark.slow
def test_noise_of_a_few_pixels_is_part_of_the_uncertainty():
    """Of a highlight of some pixels: squares of sixteen that are taken as one each are too few to judge it by."""

    def scene(alpha):
        metal = {"type": "walter", "alpha": alpha, "specular_reflectance": 0.4, "diffuse_reflectance": 0.3}
        lights, integrator = lamps(0.5, lamp=([2, 4, 3], 20.0)), {"type": "path", "max_depth": 3}
        return scene_of(metal, size=24, lights=lights, integrator=integrator)

    errors = []
    for seed in (3, 5, 6, 7):
        picture = np.array(mi.render(scene(0.2), spp=256, seed=100 + seed))
        found = images(scene(0.4), picture, ["ball.bsdf.alpha"], seed=seed)
        errors.append((values(found)["alpha"] - 0.2) / found.sigma["ball.bsdf.alpha.value"])
    assert np.sqrt(np.mean(np.square(errors))) < 2  # of four, once in 3000 by chance; by the squares alone 3.8


def test_what_one_pixel_sees_is_as_sure_as_that_pixel():
    """It leaves no residual there: without those of others, errors are five times the standard deviations."""
    T = mi.ScalarTransform4f

    def scene(reflectance):
        card = {"type": "rectangle", "to_world": T().scale(0.08)}
        wall = {"type": "rectangle", "to_world": T().translate([0, 0, -1]).scale(4)}
        return scene_of({"type": "lambert", "reflectance": reflectance}, card, 9, lights=lamps(1.0) | {"wall": wall})

    errors = []
    for seed in (3, 4, 5):
        grain = np.random.default_rng(seed).normal(1, 0.05, (9, 9, 3))
        found = images(scene(0.5), picture_of(scene(0.3)) * grain, spp=64, seed=seed)
        errors.append((values(found)["reflectance"] - 0.3) / found.sigma["ball.bsdf.reflectance.value"])
    assert np.sqrt(np.mean(np.square(errors))) < 2.5  # of three, once in 3000 by chance


@pytest.mark.slow
def test_noise_of_derivatives_is_part_of_the_uncertainty():
    """On a narrow highlight they decide the last step, and leave few residuals: by these alone, errors are four times
    the standard deviations."""
    lights = lamps(0.3, lamp=([2, 3, 4], 20.0))
    picture = picture_of(scene_of({"type": "walter", "alpha": 0.15}, size=32, lights=lights), spp=4096)
    start = {"type": "walter", "alpha": 0.4}
    found = [images(scene_of(start, size=32, lights=lights), picture, ["ball.bsdf.alpha"], seed=k) for k in (0, 4, 5)]
    errors = [(values(it)["alpha"] - 0.15) / it.sigma["ball.bsdf.alpha.value"] for it in found]
    assert np.sqrt(np.mean(np.square(errors))) < 2.5  # of five degrees of freedom, 1.3 is usual


def test_volumetric_integrators():
    """They have no forward derivatives, nor need any where there is no medium."""
    lambert = {"type": "lambert", "reflectance": 0.5}
    picture = picture_of(scene_of(lambert), spp=64)
    for integrator in ("volpath", "prbvolpath"):
        found = images(scene_of({"type": "lambert", "reflectance": 0.2}, integrator=integrator), picture, spp=64)
        assert values(found)["reflectance"] == pytest.approx(0.5, abs=5e-3)
    fog = {"type": "sphere", "interior": {"type": "homogeneous"}}
    with pytest.raises(FitError, match="Scenes with media cannot be fitted"):
        images(scene_of(lambert, shape=fog), picture)


def test_local_illumination():
    """``shading`` makes surfaces π times as bright as paths of light do."""
    shading = {"type": "shading", "clamp": False}
    lamp = lamps(lamp=([2, 3, 4], 2.0))
    hidden, start = (
        {"type": "phong", "diffuse_reflectance": rho, "exponent": n} for rho, n in ((0.2, 20.0), (0.5, 40.0))
    )
    found = fitted(start, hidden, spp=1, samples=1, integrator=shading, lights=lamp)
    assert found.converged and values(found)["diffuse_reflectance"] == pytest.approx(0.2, abs=1e-3)
    assert values(found)["exponent"] == pytest.approx(20, rel=1e-2)
    with pytest.raises(FitError, match="give it clamp = false"):
        images(scene_of(start, integrator="shading", lights=lamp), GREY)
    scene = scene_of(hidden, integrator=shading | {"environment_reflection": True})
    with pytest.raises(FitError, match="environment_reflection cannot be fitted"):
        images(scene, GREY)


@pytest.mark.slow
def test_parameters_that_go_together():
    """Of which some are sought, and the others stay."""
    hidden = {"base_color": rgb(0.6, 0.3, 0.1), "metallic": 0.3, "specular": 0.6, "roughness": 0.3}
    start = {"base_color": rgb(0.3, 0.3, 0.3), "metallic": 0.7, "specular": 0.3, "roughness": 0.8}
    sought = [f"ball.bsdf.{name}" for name in start]
    found = fitted({"type": "burley", **start}, {"type": "burley", **hidden}, *sought)
    assert {*values(found)} == {*hidden}
    for name, value in hidden.items():
        assert values(found)[name] == pytest.approx(value["value"] if isinstance(value, dict) else value, rel=0.06)


@pytest.mark.slow
def test_a_scene_and_a_material_to_go_on_with():
    """The scene has the values, another one gets them, and so has the plugin dict with words and what was not sought;
    the same seed gives the same result; progress ends."""
    bsdf = {"type": "walter", "shadowing": "correlated", "f0": 0.3, "alpha": 0.2, "diffuse_reflectance": 0.3}
    picture = picture_of(scene_of(bsdf))
    steps = []

    def once():
        scene = scene_of(bsdf | {"alpha": 0.6, "diffuse_reflectance": 0.8}, integrator="path")
        sought = ["ball.bsdf.alpha", "ball.bsdf.diffuse_reflectance.value"]
        return scene, images(scene, picture, sought, seed=3, progress=lambda *done: steps.append(done))

    scene, found = once()
    assert steps[-1][0] == steps[-1][1] and sorted(steps) == steps
    assert found.bsdfs == {
        "ball.bsdf": {
            "type": "walter", "shadowing": "correlated", "multiscatter": "none", "specular_reflectance": 1.0,
            "f0": pytest.approx(0.3),
            "alpha": pytest.approx(0.2, rel=0.02), "diffuse_reflectance": pytest.approx(0.3, rel=0.02),
        }
    }  # fmt: skip
    other = scene_of(bsdf)
    found.update(other)
    expected = np.array(mi.render(scene_of(found.bsdfs["ball.bsdf"]), spp=16))
    for same in (scene, other):
        np.testing.assert_allclose(mi.render(same, integrator=other.integrator(), spp=16), expected, rtol=1e-5)
    assert json.loads(json.dumps(found.to_dict()))["values"] == found.values
    assert once()[1].values == pytest.approx(found.values, rel=1e-3)  # but for the order of sums


@pytest.mark.slow
def test_the_end_of_a_range():
    """A metal without a diffuse lobe."""
    bsdf = {"type": "walter", "alpha": 0.2, "diffuse_reflectance": 0.0}
    start = {"type": "walter", "alpha": 0.4, "specular_reflectance": 0.5, "diffuse_reflectance": 0.5}
    found = fitted(start, bsdf)
    assert 0 <= values(found)["diffuse_reflectance"] < 0.003
    assert values(found)["specular_reflectance"] == pytest.approx(1, abs=0.02)
    assert values(found)["alpha"] == pytest.approx(0.2, rel=0.02)


@pytest.mark.slow
def test_several_pictures():
    """Taken from two sides, by sensors in another order; pixels without a number do not count."""
    origins = ((0, 0, 5.2), (5.2, 0, 0))
    hidden = scene_of({"type": "orennayar", "reflectance": rgb(0.7, 0.4, 0.2), "sigma": 0.5}, origins=origins)
    pictures = [picture_of(hidden, sensor=k) for k in (1, 0)]
    pictures[0][:, ::2] = np.nan
    start = {"type": "orennayar", "reflectance": rgb(0.2, 0.2, 0.2), "sigma": 0.1}
    found = images(scene_of(start, origins=origins), pictures, sensors=[1, 0])
    assert values(found)["reflectance"] == pytest.approx([0.7, 0.4, 0.2], rel=0.04)
    assert values(found)["sigma"] == pytest.approx(0.5, rel=0.04)


def bitmap(texels, **members):
    return {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, **members}


@pytest.mark.slow
def test_a_bitmap():
    """The texels of a colour beneath a gloss, and the number of the latter."""
    lights = lamps(0.5, key=([0, 1, 2.5], 6.0))

    def scene(**given):
        return scene_of({"type": "walter", **given}, {"type": "rectangle"}, lights=lights, origins=[(0, -2, 4)])

    texels = np.float32(np.random.default_rng(0).uniform(0.1, 0.8, (4, 4, 3)))
    picture = picture_of(scene(alpha=0.2, specular_reflectance=0.2, diffuse_reflectance=bitmap(texels)))
    start = bitmap(np.full((4, 4, 3), 0.3, np.float32))
    scene = scene(alpha=0.5, specular_reflectance=0.2, diffuse_reflectance=start)
    found = images(scene, picture, ["ball.bsdf.alpha", "ball.bsdf.diffuse_reflectance"], iterations=12)
    data = values(found)["diffuse_reflectance"]
    assert found.sigma["ball.bsdf.diffuse_reflectance.data"] is None and data.shape == (4, 4, 3)
    assert np.sqrt(np.mean((data - texels) ** 2)) < 0.015
    assert values(found)["alpha"] == pytest.approx(0.2, rel=0.06)
    mi.load_dict(found.bsdfs["ball.bsdf"])
    assert np.shape(found.to_dict()["values"]["ball.bsdf.diffuse_reflectance.data"]) == (4, 4, 3)


# --- Wrong input ----------------------------------------------------------------------------------------------------

GREY = np.full((SIZE, SIZE, 3), 0.5)
WRONG = {
    "nothing": ({"pictures": []}, "There is no picture to fit to."),
    "size": ({"pictures": GREY[:20]}, "the shape (20, 32, 3), and the film of its sensor has (32, 32, 3)."),
    "channels": ({"pictures": GREY[..., :1]}, "the shape (32, 32, 1), and the film"),
    "shape": ({"pictures": np.ones(3)}, "the shape (3,), and the film"),
    "integers": (
        {"pictures": np.uint8(255 * GREY)},
        "A picture of integers has no linear values: give its file, or mi.Bitmap(it), which is sRGB.",
    ),
    "black": ({"pictures": 0 * GREY}, "A picture is black, or has no positive numbers."),
    "negative": ({"pictures": -GREY}, "A picture is black, or has no positive numbers."),
    "gaps": ({"pictures": np.nan * GREY}, "A picture is black, or has no positive numbers."),
    "file": ({"pictures": "missing.exr"}, "There is no file missing.exr."),
    "no picture": ({"pictures": __file__}, f"Mitsuba cannot read {__file__}: [Bitmap] Bitmap: Unknown file format!"),
    "layers": (
        {"pictures": mi.Bitmap(np.ones((16, 16, 6), np.float32))},
        "A picture has 6 channels: give the colours among what mi.Bitmap.split returns.",
    ),
    "sensor": ({"sensors": 1}, "these are [1] of 1 pictures, and the scene has 1, counted from 0."),
    "sensors": ({"sensors": [0, 0]}, "these are [0, 0] of 1 pictures, and the scene has 1"),
    "number": ({"pictures": [GREY, GREY]}, "these are [0, 1] of 2 pictures, and the scene has 1"),
    "misspelt": ({"parameters": "ball.bsdf.alhpa"}, "no parameter ball.bsdf.alhpa; did you mean ball.bsdf.alpha"),
    "another": ({"parameters": ["key.intensity.value"]}, "key.intensity.value is no number, colour or bitmap"),
    "none": ({"parameters": []}, "There are no parameters to fit: the list is empty."),
    "iterations": ({"iterations": 0}, "A fit needs iterations >= 1 and spp >= 1."),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input(case):
    given, message = WRONG[case]
    with pytest.raises(FitError, match=re.escape(message)):
        images(scene_of({"type": "ward"}), **({"pictures": GREY} | given))


def test_scenes_without_an_answer():
    lamp = lamps(key=([-3, 3, 4], 30.0))
    behind = {"key": {"type": "directional", "direction": [0, 0, 1]}}
    plane = {"type": "rectangle"}
    for message, scene in {
        "A fit needs a loaded scene, not dict": {},
        "The scene has no light.": scene_of({"type": "ward"}, lights={}),
        "no BSDF of mi_brdfs whose parameters can be fitted": scene_of({"type": "diffuse"}),
        "ball.bsdf changes nothing in the pictures": scene_of({"type": "ward"}, plane, lights=behind),
        "diffuse_reflectance.data has no derivatives": scene_of(
            {"type": "ward", "diffuse_reflectance": bitmap(np.full((2, 2, 3), 99, np.uint8))}, lights=lamp
        ),
    }.items():
        with pytest.raises(FitError, match=message):
            images(scene, GREY)
    for variant in ("scalar_rgb", "llvm_ad_spectral"):
        with mi.variant_context(variant), pytest.raises(FitError, match=f"needs an rgb variant .*, not {variant}"):
            images(scene_of({"type": "ward"}, integrator="path"), GREY)


def test_an_interrupt_leaves_the_scene_as_it_was():
    def stop(done, total):
        raise KeyboardInterrupt

    scene = scene_of({"type": "ward", "alpha": 0.3})
    with pytest.raises(KeyboardInterrupt):
        images(scene, GREY, progress=stop)
    assert mi.traverse(scene)["ball.bsdf.alpha.value"][0] == pytest.approx(0.3)
    assert scene.sensors()[0].sampler().sample_count() == 4


def test_pixels_that_were_clipped_do_not_count(tmp_path):
    """A lamp so strong that a part of the picture is white in 8 bits of sRGB; the others have the values behind it."""
    lamp = lamps(key=([-1, 2, 5], 250.0))
    bsdf = {"type": "lambert", "reflectance": rgb(0.6, 0.3, 0.1)}
    picture = mi.Bitmap(picture_of(scene_of(bsdf, lights=lamp)).astype(np.float32))
    mi.util.write_bitmap(str(tmp_path / "picture.png"), picture, write_async=False)
    assert 0.1 < (np.array(mi.Bitmap(str(tmp_path / "picture.png")))[..., 0] == 255).mean() < 0.7
    start = scene_of({"type": "lambert", "reflectance": rgb(0.5, 0.5, 0.5)}, lights=lamp)
    found = images(start, tmp_path / "picture.png", spp=64)
    assert values(found)["reflectance"] == pytest.approx([0.6, 0.3, 0.1], rel=0.02)
