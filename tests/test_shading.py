"""Local illumination: the scenes pixel by pixel, what the parameters mean, and bad input."""

import re
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support import call, direction, is_scalar

import mi_brdfs
from mi_brdfs import render
from mi_brdfs.parameters import ParameterError

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))

import shading_pictures

SCENES = Path(__file__).parents[1] / "scenes" / "shading"
NAMES = [path.stem for path in sorted(SCENES.glob("*.xml"))]

rgb = np.array


def load(name, width, height, **defaults):
    return mi.load_file(str(SCENES / f"{name}.xml"), width=str(width), height=str(height), **defaults)


def shaded(scene, **settings):
    image = np.array(mi.render(scene, **settings), np.float64)
    assert np.isfinite(image).all()
    return image


# --- The scenes, from their formulas --------------------------------------------------------------------------------


def unit(v):
    v = np.asarray(v, np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def dot(a, b):
    return (a * b).sum(axis=-1)


def column(x):
    return np.asarray(x)[..., None]


TOWARDS = rgb([0.0, 0.0, 1.0])
"""The direction to the viewer, who is infinitely far away."""


class Ball:
    """The pixels of a picture that show a sphere, of the scenes' orthographic camera: their points and normals. Those
    that touch the outline are left out."""

    def __init__(self, centre, radius, width, height, half):
        x = half * (2 * (np.arange(width) + 0.5) / width - 1) - centre[0]
        y = half * height / width * (1 - 2 * (np.arange(height) + 0.5) / height) - centre[1]
        x, y = np.meshgrid(x / radius, y / radius)
        self.pixels = x * x + y * y < 0.995
        x, y = x[self.pixels], y[self.pixels]
        self.normal = np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1)
        self.centre, self.radius = rgb(centre), radius
        self.point = self.centre + radius * self.normal
        self.mirror = 2 * column(self.normal[:, 2]) * self.normal - TOWARDS

    def shadows(self, points, light):
        """Whether this sphere stands between points and a light, and whether that is a close shave."""
        way = light - points
        distance = np.linalg.norm(way, axis=-1)
        to = self.centre - points
        along = dot(to, way) / distance
        beside = np.sqrt(np.maximum(dot(to, to) - along**2, 0))
        between = (along > 0) & (along < distance)
        return between & (beside < self.radius), between & (abs(beside - self.radius) < 0.01 * self.radius)


def compare(image, ball, expected, but=False):
    np.testing.assert_allclose(image[ball.pixels][~np.broadcast_to(but, ball.pixels.sum())],
                               expected[~np.broadcast_to(but, len(expected))], atol=1e-4)  # fmt: skip
    assert np.ptp(expected) > 0.3  # there is something to see


@pytest.mark.usefixtures("llvm_rgb")
def test_formulas():
    """Diffuse formulas as the whole response to a light, and Phong's with its clamp before the power."""
    width, height, half = 96, 24, 4.6
    image = shaded(load("formulas", width, height), spp=1)
    l, light, colour = -unit([2, -1.5, -1.6]), rgb([1, 0.96, 0.9]), rgb([0.8, 0.5, 0.35])
    balls = [Ball((x, 0, 0), 1, width, height, half) for x in (-3.45, -1.15, 1.15, 3.45)]
    formulas = [
        lambda b: np.maximum(dot(b.normal, l), 0),
        lambda b: (0.5 * dot(b.normal, l) + 0.5) ** 2,
        lambda b: (np.maximum(dot(b.normal, l), 0) * b.normal[:, 2]) ** 1.5,
    ]
    for ball, k in zip(balls, formulas, strict=False):
        compare(image, ball, column(k(ball)) * colour * light)
    ball = balls[3]
    cos = dot(ball.normal, l)
    highlight = np.where(cos > 0, np.maximum(dot(ball.mirror, l), 0) ** 20, 0)
    compare(image, ball, (column(np.maximum(cos, 0)) * colour + 0.2 * column(highlight)) * light)


def step(cos, threshold, smooth):
    x = np.clip((cos - threshold + smooth) / (2 * smooth), 0, 1) if smooth else (cos > threshold).astype(float)
    return x * x * (3 - 2 * x)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("tonemap", ["none", "reinhard"])
def test_bands(tonemap):
    """Bands, and the clamp at the end, or the HDR alternative to it."""
    width, height, half = 96, 32, 3.5
    image = shaded(load("bands", width, height, tonemap=tonemap), spp=1)
    ambient = rgb([0.06, 0.06, 0.09])
    lights = [
        (-unit([1.5, -1.5, -2]), rgb([0.95, 0.9, 0.8])),
        (-unit([-2, -0.5, -2]), rgb([0.5, 0.55, 0.7])),
    ]

    def finished(colour):
        return colour / (1 + colour) if tonemap == "reinhard" else np.clip(colour, 0, 1)

    ball = Ball((-2.3, 0, 0), 1, width, height, half)
    sum_of_lights = ambient + sum(column(np.maximum(dot(ball.normal, l), 0)) * light for l, light in lights)
    expected = rgb([0.95, 0.85, 0.4]) * sum_of_lights
    assert expected.max() > 1.05
    compare(image, ball, finished(expected))

    toons = [(0, [0.7, 0.3, 0.25], 0.5, 0.0, 0.0, 0.97, 0.0), (2.3, [0.3, 0.5, 0.75], 0.3, 0.15, 0.3, 0.9, 0.05)]
    for x, colour, threshold, smooth, dark, specular_threshold, specular_smooth in toons:
        ball = Ball((x, 0, 0), 1, width, height, half)
        expected, edge = rgb(colour) * ambient + 0 * ball.normal, np.zeros(len(ball.normal), bool)
        for l, light in lights:
            cos, cos_r = dot(ball.normal, l), dot(ball.mirror, l)
            band = dark + (1 - dark) * step(cos, threshold, smooth)
            lit = rgb(colour) * column(band) + 0.2 * column(step(cos_r, specular_threshold, specular_smooth))
            expected = expected + np.where(column(cos > 0), lit, 0) * light
            edge |= abs(cos) < 1e-5
            if not smooth:
                edge |= (abs(cos - threshold) < 1e-5) | (abs(cos_r - specular_threshold) < 1e-5)
        compare(image, ball, finished(expected), but=edge)


@pytest.mark.usefixtures("llvm_rgb")
def test_phong():
    """The Phong illumination model, with max(0, ·) and both terms within the sum over the lights."""
    width, height, half = 72, 48, 2.1
    image = shaded(load("phong", width, height), spp=1)
    balls = [Ball((0.3, 0, 0), 1.2, width, height, half), Ball((-1.4, 0.75, 1.4), 0.35, width, height, half)]
    colours = [rgb([0.7, 0.25, 0.2]), rgb([0.25, 0.5, 0.3])]
    lights = [(rgb([-4.0, 3, 4]), rgb([30, 28, 24])), (rgb([4.0, -1, 3]), rgb([5, 7, 12]))]
    in_shadow = 0
    for ball, kd, other in zip(balls, colours, reversed(balls), strict=True):
        expected, doubt = kd * rgb([0.12, 0.12, 0.16]) + 0 * ball.normal, np.zeros(len(ball.normal), bool)
        for position, intensity in lights:
            way = position - ball.point
            l, light = unit(way), intensity / column(dot(way, way))
            cos = dot(ball.normal, l)
            hidden, close = other.shadows(ball.point, position)
            specular = np.maximum(dot(ball.mirror, l), 0) ** 40
            term = kd * column(cos) + 0.4 * column(specular)
            expected = expected + np.where(column((cos > 0) & ~hidden), term * light, 0)
            doubt |= close | (abs(cos) < 1e-3)
            in_shadow += (hidden & (cos > 0.1)).sum()
        compare(image, ball, np.clip(expected, 0, 1), but=doubt)
    assert in_shadow > 10


@pytest.mark.usefixtures("llvm_rgb")
def test_mirrored_sky():
    """The mirrored environment, weighted by the Fresnel reflectance, beside what the lobes make of a light."""
    width, height, half = 96, 32, 3.5
    image = shaded(load("mirrored_sky", width, height), spp=1)
    sky = np.array(mi.Bitmap(str(SCENES / "sky.exr")), np.float64)[:, 0]
    l, light = -unit([1.5, -1.5, -2]), rgb([0.6, 0.58, 0.5])
    h = unit(l + TOWARDS)

    def fresnel(f0, cos):
        return f0 + (1 - f0) * column(1 - cos) ** 5

    def environment(d):
        theta = np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * (len(sky) - 1)
        return np.stack([np.interp(theta, np.arange(len(sky)), channel) for channel in sky.T], axis=-1)

    def metal(b, nl, nv, nh):
        alpha = 0.5**2
        d = alpha**2 / (np.pi * (1 + (alpha**2 - 1) * nh**2) ** 2)
        k = 1.5**2 / 8
        g = 1 / ((nl * (1 - k) + k) * (nv * (1 - k) + k))
        return fresnel(rgb([0.9, 0.65, 0.35]), h @ TOWARDS) * column(np.pi * d * g / 4 * nl)

    def dielectric(b, nl, nv, nh):
        alpha = 0.2
        d = np.exp((1 - 1 / nh**2) / alpha**2) / (np.pi * alpha**2 * nh**4)
        g = np.minimum(1, np.minimum(2 * nh * nv, 2 * nh * nl) / (h @ TOWARDS))
        return fresnel(rgb([0.05] * 3), h @ TOWARDS) * column(np.pi * d * g / (4 * nv))

    def blinn(b, nl, nv, nh):
        return rgb([0.5, 0.6, 0.5]) * column(nh**60)

    colours = [rgb([0.9, 0.65, 0.35]), rgb([0.05] * 3)]
    mirrors = [lambda nv, f0=f0: fresnel(f0, nv) for f0 in colours] + [lambda nv: rgb([0.5, 0.6, 0.5])]
    for x, specular, mirror in zip((-2.3, 0, 2.3), (metal, dielectric, blinn), mirrors, strict=True):
        ball = Ball((x, 0, 0), 1, width, height, half)
        nl, nv, nh = dot(ball.normal, l), ball.normal[:, 2], dot(ball.normal, h)
        lit = np.where(column(nl > 0), specular(ball, np.maximum(nl, 1e-9), nv, np.maximum(nh, 1e-3)), 0) * light
        compare(image, ball, np.clip(lit + mirror(nv) * environment(ball.mirror), 0, 1), but=nv < 0.1)


@pytest.mark.parametrize("name", NAMES)
def test_scenes_in_every_variant(name, variant):
    image = shaded(load(name, 24, 8), spp=1 if is_scalar() else 16)
    assert 0.02 < image.mean() < 0.9
    assert image.min() >= 0
    assert image.max() <= 1


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("path", shading_pictures.SCENES, ids=lambda path: path.stem)
def test_picture_shows_the_scene(path):
    """Rendered anew with few samples, the picture differs by its noise, and as JPEG has it."""
    stored = np.array(mi.Bitmap(str(shading_pictures.PICTURES / f"{path.stem}.jpg")), np.float64) / 255
    now = np.array(shading_pictures.picture(path, spp=64), np.float64) / 255
    assert abs(stored - now).mean() < 0.02, "stale: run python docs/shading_pictures.py"


def test_every_scene_has_a_picture_in_the_readme():
    text = (SCENES / "README.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"(../../docs/scenes/shading/{name}.jpg)" in text
        assert (shading_pictures.PICTURES / f"{name}.jpg").is_file(), "run python docs/shading_pictures.py"


# --- What the parameters mean ---------------------------------------------------------------------------------------

SUN = {"type": "directional", "direction": [0, 0, -1], "irradiance": 1.0}


def plate(bsdf, *lights, size=2, tilt=0.0, **settings):
    """A scene of a plate, tilted by some degrees, that fills the picture of an orthographic camera."""
    T = mi.ScalarTransform4f
    scene = {
        "type": "scene",
        "integrator": {"type": "shading", **settings},
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
        "plate": {"type": "rectangle", "to_world": T().rotate([0, 1, 0], tilt).scale(20), "bsdf": bsdf},
    }
    return mi.load_dict(scene | {f"light{k}": light for k, light in enumerate(lights)})


def value(bsdf, *lights, spp=1, **settings):
    """The shade of such a plate in the middle of the picture's pixels."""
    return shaded(plate(bsdf, *lights, **settings), spp=spp).mean()


WHITE = {"type": "lambert", "reflectance": 0.8}


@pytest.mark.usefixtures("llvm_rgb")
def test_pi_belongs_to_the_light_or_to_the_brdf():
    assert value(WHITE, SUN) == pytest.approx(0.8, rel=1e-5)
    assert value(WHITE, SUN, pi_folded=False) == pytest.approx(0.8 / np.pi, rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_clamp_and_tonemap():
    lights = [SUN] * 3
    assert value(WHITE, *lights) == 1
    assert value(WHITE, *lights, clamp=False) == pytest.approx(2.4, rel=1e-5)
    assert value(WHITE, *lights, tonemap="reinhard") == pytest.approx(2.4 / 3.4, rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("bsdf", "diffuse"),
    [
        ({"type": "phong"}, 0.5),
        ({"type": "twosided", "inner": {"type": "phong"}}, 0.5),
        ({"type": "phong", "normalization": "original"}, 0.5),
        ({"type": "minnaert", "normalization": "none"}, 0.5),
        ({"type": "wrap", "normalization": "none", "domain": "sphere"}, 0.5),
        ({"type": "toon", "normalization": "none", "diffuse_threshold": 0.2}, 0.5),
        ({"type": "walter"}, 0),
        ({"type": "diffuse", "reflectance": 0.3}, 0.3),
        ({"type": "conductor"}, 0),
    ],
    ids=lambda x: x["type"] if isinstance(x, dict) else "",
)
def test_ambient_light_meets_the_diffuse_reflectance(bsdf, diffuse):
    assert value(bsdf, ambient=0.5) == pytest.approx(0.5 * diffuse, abs=1e-6)
    behind = 0.5 * diffuse if bsdf["type"] == "twosided" else 0
    if bsdf["type"] not in ("diffuse", "conductor"):
        assert value(bsdf, tilt=180, ambient=0.5) == pytest.approx(behind, abs=1e-6)


def test_ambient_light_is_white_in_spectral_variants():
    """As lights are, of which the colours are those of emission."""
    with mi.variant_context("llvm_ad_spectral"):
        image = shaded(plate(WHITE, ambient={"type": "rgb", "value": [0.5, 0.5, 0.25]}), spp=20000)
    np.testing.assert_allclose(image, np.broadcast_to([0.4, 0.4, 0.2], image.shape), rtol=0.03)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "bsdf",
    [{"type": "roughplastic", "alpha": 0.3}, {"type": "roughconductor", "alpha": 0.4}, {"type": "principled"},
     {"type": "twosided", "inner": {"type": "diffuse"}}, {"type": "ward", "alpha": 0.4}],
    ids=lambda bsdf: bsdf["type"],
)  # fmt: skip
def test_any_bsdf_is_shaded_with_its_own_value(bsdf):
    tilt = 25.0
    wi = direction(tilt)[None]
    loaded = mi.load_dict(bsdf)
    (f_cos,) = call(loaded.eval, mi.BSDFContext(), wi, wi)
    assert f_cos.mean() > 0.01
    assert value(bsdf, SUN, tilt=tilt, clamp=False) == pytest.approx(np.pi * f_cos.mean(), rel=1e-3)


@pytest.mark.usefixtures("llvm_rgb")
def test_spot_lights_shine_by_the_square_of_the_distance():
    T = mi.ScalarTransform4f
    spot = {
        "type": "spot",
        "intensity": 2.0,
        "cutoff_angle": 30,
        "to_world": T().look_at(origin=[0, 0, 2], target=[0, 0, 0], up=[0, 1, 0]),
    }
    middle = shaded(plate(WHITE, spot, size=101), spp=1)[50, 50]
    np.testing.assert_allclose(middle, 0.8 * 2 / 4, rtol=1e-3)


def lamp(shape, **more):
    T = mi.ScalarTransform4f
    to_world = T().translate([0, 0, 10]).rotate([1, 0, 0], 180)
    return {"type": shape, "to_world": to_world, "emitter": {"type": "area", "radiance": 3.0}, **more}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("shape", "irradiance"),
    [
        # Radiance times area over the squared distance; for the sphere the solid angle of its cone.
        ("rectangle", 3 * 4 / 100),
        ("disk", 3 * np.pi / 100),
        ("sphere", 3 * 2 * np.pi * (1 - np.sqrt(1 - 0.01))),
    ],
)
def test_area_lights_by_their_centre(shape, irradiance):
    """Lit from straight above, in the middle of the picture: any other place of the lamp would be farther away."""
    scene = plate(WHITE, lamp(shape), size=101, area_lights="centre")
    image = shaded(scene, spp=1)
    np.testing.assert_allclose(image[50, 50], 0.8 * irradiance, rtol=1e-3)
    np.testing.assert_allclose(image[::-1, ::-1], image, rtol=1e-3)
    np.testing.assert_array_equal(shaded(scene, spp=1, seed=7), image)


@pytest.mark.usefixtures("llvm_rgb")
def test_area_lights_by_samples():
    """Their mean is what the built-in integrator of direct light has, where π belongs to the BRDF."""
    T = mi.ScalarTransform4f
    near = lamp("rectangle") | {"to_world": T().translate([2, 0, 7]).rotate([1, 0, 0], 180).scale(5)}
    scene = plate({"type": "phong"}, near, size=4, pi_folded=False, clamp=False)
    image = shaded(scene, spp=40000)
    assert np.ptp(image) > 0.05 * image.mean()
    direct = np.array(mi.render(scene, integrator=mi.load_dict({"type": "direct"}), spp=20000))
    np.testing.assert_allclose(image, direct, rtol=0.02)
    assert abs(shaded(scene, spp=1) - shaded(scene, spp=1, seed=1)).max() > 1e-3


@pytest.mark.usefixtures("llvm_rgb")
def test_lights_are_seen():
    centre = shaded(plate(WHITE, lamp("disk") | {"to_world": mi.ScalarTransform4f()}, clamp=False), spp=1)
    np.testing.assert_allclose(centre, 3, rtol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_environment_lights_and_is_clamped_at_the_end():
    """A sample alone is far above 1; the mean is not."""
    sky = {"type": "constant", "radiance": 0.25}
    assert value(WHITE, sky, spp=20000) == pytest.approx(0.8 * np.pi * 0.25, rel=0.02)


@pytest.mark.usefixtures("llvm_rgb")
def test_shadows():
    T = mi.ScalarTransform4f
    roof = {"type": "rectangle", "to_world": T().translate([0, 0, 7]).scale(20), "bsdf": WHITE}
    assert value(WHITE, SUN, roof) == 0
    assert value(WHITE, SUN, roof, shadows=False) == pytest.approx(0.8, rel=1e-5)


SKY = {"type": "constant", "radiance": 0.5}


def grazing(f0, degrees):
    return f0 + (1 - f0) * (1 - np.cos(np.radians(degrees))) ** 5


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("bsdf", "reflectance"),
    [
        ({"type": "phong", "normalization": "original"}, 0.2),
        ({"type": "blinnphong", "normalization": "ndf"}, 0.2),
        ({"type": "toon", "normalization": "none"}, 0.2),
        ({"type": "cooktorrance", "f0": 0.3, "normalization": "tog82"}, grazing(0.3, 60)),
        ({"type": "walter", "f0": 0.3, "specular_reflectance": 0.5}, 0.5 * grazing(0.3, 60)),
        ({"type": "low", "a": 50.0, "variant": "smooth"}, 1),
        ({"type": "lafortune"}, 0.2),
        ({"type": "lafortune", "cx": 1, "cy": 1, "exponent": 3}, 0),
        ({"type": "eon"}, 0),
        ({"type": "twosided", "inner": {"type": "phong"}}, 0.2),
        ({"type": "twosided", "front": {"type": "lambert"}, "back": {"type": "phong"}}, 0),
    ],
    ids=lambda x: x["type"] if isinstance(x, dict) else "",
)
def test_environment_reflection(bsdf, reflectance):
    """What it adds to a surface whose diffuse lobes are black."""
    dark = {key: 0.0 for key in ("diffuse_reflectance", "reflectance")}
    inner = {key: it for key, it in bsdf.items() if isinstance(it, dict)} or {"": bsdf}
    for it in inner.values():
        name = "reflectance" if it["type"] in ("eon", "lambert") else "diffuse_reflectance"
        it[name] = dark[name]
    assert value(bsdf, SKY, environment_reflection=True, tilt=60) == pytest.approx(0.5 * reflectance, abs=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_back_of_a_two_sided_surface_mirrors():
    two = {"type": "twosided", "front": WHITE, "back": {"type": "phong", "diffuse_reflectance": 0.0}}
    assert value(two, SKY, environment_reflection=True, tilt=150) == pytest.approx(0.1, abs=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_the_mirrored_environment_does_not_light_the_lobes_that_mirror_it():
    metal = {"type": "ward", "diffuse_reflectance": 0.3, "alpha": 0.5}
    mirrored = value(metal, SKY, spp=20000, environment_reflection=True, clamp=False)
    assert mirrored == pytest.approx(0.5 * (0.3 * np.pi + 0.2), rel=0.02)
    assert value(metal, SKY, spp=20000, clamp=False) == pytest.approx(0.5 * np.pi * (0.3 + 0.2 * 0.75), rel=0.1)


@pytest.mark.usefixtures("llvm_rgb")
def test_foreign_bsdfs_are_not_mirrors_and_said_so_once():
    scene = plate({"type": "roughconductor"}, SKY, SUN, environment_reflection=True)
    with pytest.warns(UserWarning, match="shading: RoughConductor cannot tell a mirror reflectance") as said:
        shaded(scene, spp=1)
        shaded(scene, spp=1)
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for dull in ("diffuse", "null"):
            shaded(plate({"type": dull}, SKY, environment_reflection=True), spp=1)


@pytest.mark.parametrize("name", mi_brdfs.list_models())
def test_every_model_knows_its_mirror_reflectance(name, llvm_rgb):
    bsdf = mi.load_dict({"type": name})
    (reflectance,) = call(lambda ctx, si, active: bsdf.mirror_reflectance(si, active), None, direction(40)[None])
    dull = name in ("lambert", "wrap", "minnaert", "orennayar", "roughdiffuse", "eon")
    assert reflectance.min() >= 0
    assert reflectance.max() <= 1
    assert (reflectance.max() > 0) == (not dull)


# --- Pictures that stay the same, derivatives, and other integrators ------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", NAMES)
def test_same_picture_for_any_seed_and_samples(name):
    first = shaded(load(name, 48, 24), spp=1)
    for seed, spp in ((1, 1), (2, 3)):
        np.testing.assert_allclose(shaded(load(name, 48, 24), seed=seed, spp=spp), first, atol=1e-6)


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


@pytest.mark.usefixtures("llvm_rgb")
def test_differentiable():
    """By the logarithms of parameters of a BSDF, of lights and of the ambient light, as finite differences have it."""
    bsdf = {"type": "phong", "normalization": "original", "exponent": 10.0}
    lamp = {"type": "point", "position": [1, 0.5, 2], "intensity": 4.0}
    settings = {"ambient": 0.2, "environment_reflection": True, "tonemap": "reinhard"}
    scene = plate(bsdf, lamp, SKY | {"radiance": 0.1}, tilt=20, **settings)
    params = mi.traverse(scene)
    keys = [
        "plate.bsdf.exponent.value", "plate.bsdf.diffuse_reflectance.value", "plate.bsdf.specular_reflectance.value",
        "light0.intensity.value", "light0.position", "light1.radiance.value", "integrator.ambient.value",
    ]  # fmt: skip

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
def test_frozen_pictures():
    """Recorded, and replayed for other parameters."""
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "shading", "ambient": 0.1},
            "sensor": {  # Mitsuba cannot freeze an orthographic one
                "type": "perspective",
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 8, "height": 8},
            },
            "ball": {"type": "sphere", "bsdf": {"type": "phong"}},
            "light": SUN,
        }
    )
    params = mi.traverse(scene)
    frozen = dr.freeze(lambda scene, seed: mi.render(scene, spp=4, seed=seed), auto_opaque=False)
    pictures = []
    for seed in range(4):
        for key in ("ball.bsdf.diffuse_reflectance.value", "integrator.ambient.value"):
            params[key] = mi.Float(0.1 * (seed + 1))
        params.update()
        pictures.append(np.array(frozen(scene, dr.opaque(mi.UInt32, seed))))
        np.testing.assert_allclose(pictures[-1], shaded(scene, spp=4), atol=1e-6)
    assert abs(pictures[3] - pictures[2]).max() > 0.05
    assert frozen.n_recordings < 4


@pytest.mark.usefixtures("llvm_rgb")
def test_within_aov():
    scene = plate(WHITE, SUN, tilt=10)
    both = {"type": "aov", "aovs": "dd:depth,ab:albedo", "inner": {"type": "shading"}}
    image = shaded(scene, integrator=mi.load_dict(both), spp=2)
    np.testing.assert_allclose(image[..., :3], shaded(scene, spp=1), rtol=1e-4)
    np.testing.assert_allclose(image[..., 3], 5, rtol=0.1)
    np.testing.assert_allclose(image[..., 4:], 0.8, rtol=1e-4)


@pytest.mark.usefixtures("llvm_rgb")
def test_progressive_rendering():
    scene = load("bands", 48, 16)
    np.testing.assert_allclose(np.array(render.render(scene, spp=7).image), shaded(scene, spp=1), atol=1e-5)


# --- Bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"ambient": -0.1}, r"shading: ambient = -0.1 is not allowed; it must be a number, rgb or spectrum within \[0"),
        ({"ambient": {"type": "rgb", "value": [0.1, -1, 0]}}, r"shading: ambient = .* is not allowed"),
        ({"tonemap": "filmic"}, r'shading: tonemap = "filmic" is unknown; it must be one of "none" or "reinhard"'),
        ({"area_lights": "center"}, r'must be one of "sample" or "centre"'),
        ({"shadows": "yes"}, r'shading: shadows = "yes" is a string; it must be true or false'),
        ({"max_depth": 3}, "shading: unknown parameter max_depth; did you mean"),
    ],
)
def test_bad_parameters(given, message):
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "shading", **given})


@contextmanager
def refused(message):
    """The error that a render has as its cause, of Mitsuba's own."""
    with pytest.raises(RuntimeError) as raised:
        yield
    cause = raised.value
    while cause.__cause__:
        cause = cause.__cause__
    assert isinstance(cause, ParameterError)
    assert message in str(cause)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("ambient", [None, 0.0, {"type": "rgb", "value": [0, 0, 0]}])
def test_no_light_and_no_ambient(ambient):
    given = {} if ambient is None else {"ambient": ambient}
    with refused("shading: the scene has no light; add an emitter to it, or give ambient"):
        mi.render(plate(WHITE, **given))


@pytest.mark.usefixtures("llvm_rgb")
def test_bad_scenes():
    with refused("environment_reflection needs an environment"):
        mi.render(plate(WHITE, SUN, environment_reflection=True))
    with refused('area_lights = "centre" knows Rectangle, Disk and Sphere, but a light is a Cylinder'):
        mi.render(plate(WHITE, lamp("cylinder"), area_lights="centre"))


def test_films_without_colours_are_refused():
    with mi.variant_context("llvm_ad_spectral"):
        band = {"type": "regular", "wavelength_min": 400, "wavelength_max": 700, "values": "0, 1, 0"}
        film = {"type": "specfilm", "width": 2, "height": 2, "band": band}
        sensor = mi.load_dict({"type": "orthographic", "film": film})
        with pytest.raises(ValueError, match="shading: SpecFilm has no colours to finish; take an hdrfilm"):
            mi.load_dict({"type": "shading"}).render(plate(WHITE, SUN), sensor)


def test_manual_page():
    page = mi_brdfs.info("shading")
    assert "pi_folded" in page
    xml = re.search(r"<integrator .*?</integrator>", page, re.S).group().replace(">", ' version="3.0.0">', 1)
    given = re.search(r'^\{"type".*?\}$', page, re.S | re.M).group()
    for variant in ("scalar_rgb", "scalar_spectral"):
        with mi.variant_context(variant):
            assert str(mi.load_string(xml)) == str(mi.load_dict(eval(given)))
    assert "shading" not in mi_brdfs.list_models()
