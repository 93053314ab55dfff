"""What the integrator ``shading`` makes of each kind of light, and of the light that a surface reflects.

A plate fills the picture, seen from straight above. Of Lambert's model it has the shade ρ E, where E is what a light
sends to it: π belongs to the light.
"""

import mitsuba as mi
import numpy as np
import pytest
from plates import ALBEDO, SUN, WHITE, lamp, plate, shade, shaded
from support import call, direction


def T():
    return mi.ScalarTransform4f()


def named(bsdf):
    return bsdf["type"] if isinstance(bsdf, dict) else ""


# --- The sum over the lights ----------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_lights_add_up_and_the_sum_is_clamped_or_compressed():
    """π belongs to the light, or to the BRDF."""
    assert shade(WHITE, SUN) == pytest.approx(ALBEDO, rel=1e-5)
    assert shade(WHITE, SUN, pi_folded=False) == pytest.approx(ALBEDO / np.pi, rel=1e-5)
    suns = [SUN] * 3
    assert shade(WHITE, *suns, clamp=False) == pytest.approx(3 * ALBEDO, rel=1e-5)
    assert shade(WHITE, *suns) == 1
    assert shade(WHITE, *suns, tonemap="reinhard") == pytest.approx(3 * ALBEDO / (1 + 3 * ALBEDO), rel=1e-5)


# --- Kinds of lights ------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_spots_shine_by_the_square_of_the_distance():
    intensity, height = 2.0, 2
    to_world = T().look_at(origin=[0, 0, height], target=[0, 0, 0], up=[0, 1, 0])
    spot = {"type": "spot", "intensity": intensity, "cutoff_angle": 30, "to_world": to_world}
    middle = shaded(plate(WHITE, spot, size=101), spp=1)[50, 50]
    np.testing.assert_allclose(middle, ALBEDO * intensity / height**2, rtol=1e-3)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("shape", "solid_angle"),
    [
        # The area over the squared distance; of the sphere, that of its disk.
        ("rectangle", 4 / 10**2),
        ("disk", np.pi / 10**2),
        ("sphere", np.pi / 10**2),
    ],
)
def test_area_lights_may_shine_from_their_centre(shape, solid_angle):
    """Which is above the middle of the picture, where it is as symmetric as the light; and no seed changes it."""
    radiance = 3.0
    scene = plate(WHITE, lamp(shape, radiance), size=101, area_lights="centre")
    image = shaded(scene, spp=1)
    np.testing.assert_allclose(image[50, 50], ALBEDO * radiance * solid_angle, rtol=1e-3)
    np.testing.assert_allclose(image[::-1, ::-1], image, rtol=1e-3)
    np.testing.assert_array_equal(shaded(scene, spp=1, seed=7), image)


@pytest.mark.parametrize("name", ["llvm_ad_rgb", "scalar_rgb"])
def test_spheres_shine_from_their_centre_as_points_do(name):
    """Of intensity π r² L."""
    radiance, height = 3.0, 40.0
    settings = {"area_lights": "centre", "clamp": False}
    with mi.variant_context(name):
        for radius in (0.25 * height, 0.75 * height):
            intensity = np.pi * radius**2 * radiance
            point = {"type": "point", "position": [0, 0, height], "intensity": intensity}
            sphere = lamp("sphere", radiance, T().translate([0, 0, height]).scale(radius))
            assert shade(WHITE, sphere, **settings) == pytest.approx(shade(WHITE, point, clamp=False), rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_area_lights_are_sampled_all_over():
    """With noise, whose mean is what Mitsuba's integrator of direct light finds, where π belongs to the BRDF."""
    to_world = T().translate([2, 0, 7]).rotate([1, 0, 0], 180).scale(5)
    scene = plate({"type": "phong"}, lamp("rectangle", to_world=to_world), size=4, pi_folded=False, clamp=False)
    image = shaded(scene, spp=40000)
    direct = shaded(scene, integrator=mi.load_dict({"type": "direct"}), spp=20000)
    np.testing.assert_allclose(image, direct, rtol=0.02)
    assert np.ptp(image) > 0.05 * image.mean()
    assert abs(shaded(scene, spp=1) - shaded(scene, spp=1, seed=1)).max() > 1e-3


@pytest.mark.usefixtures("llvm_rgb")
def test_lights_are_seen_and_cast_shadows():
    """Unless they are asked not to."""
    before_the_camera = lamp("disk", radiance=3.0, to_world=T().translate([0, 0, 1]))
    np.testing.assert_allclose(shaded(plate(WHITE, before_the_camera, clamp=False), spp=1), 3, rtol=1e-5)
    roof = {"type": "rectangle", "to_world": T().translate([0, 0, 7]).scale(20), "bsdf": WHITE}
    assert shade(WHITE, SUN, roof) == 0
    assert shade(WHITE, SUN, roof, shadows=False) == pytest.approx(ALBEDO, rel=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_environments_shine_and_only_their_mean_is_clamped():
    """A single sample is far above 1."""
    sky = {"type": "constant", "radiance": 0.25}
    assert shade(WHITE, sky, spp=20000) == pytest.approx(ALBEDO * np.pi * 0.25, rel=0.02)


# --- Ambient light --------------------------------------------------------------------------------------------------

TILT = {"type": "rgb", "value": [0.8, 0.5, 0.9]}
"""The normal (.6, 0, .8)."""


def blend(first, second):
    return {"type": "blendbsdf", "weight": 0.25, "first": first, "second": second}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("bsdf", "front", "back"),
    [
        ({"type": "phong"}, 0.5, 0),
        ({"type": "twosided", "inner": {"type": "phong"}}, 0.5, 0.5),
        ({"type": "phong", "normalization": "original"}, 0.5, 0),
        ({"type": "minnaert", "normalization": "none"}, 0.5, 0),
        ({"type": "wrap", "normalization": "none", "domain": "sphere"}, 0.5, 0),
        ({"type": "toon", "normalization": "none", "diffuse_threshold": 0.2}, 0.5, 0),
        ({"type": "walter"}, 0, 0),
        ({"type": "bumpmap", "arbitrary": {"type": "checkerboard"}, "inner": {"type": "phong"}}, 0.5, 0),
        ({"type": "normalmap", "normalmap": TILT, "inner": {"type": "phong"}}, 0.5, 0),
        ({"type": "mask", "opacity": 0.4, "inner": {"type": "phong"}}, 0.2, 0),
        ({"type": "twosided", "i": {"type": "normalmap", "normalmap": TILT, "inner": {"type": "phong"}}}, 0.5, 0.5),
        (blend({"type": "phong"}, {"type": "walter"}), 0.375, 0),
        (blend({"type": "twosided", "inner": {"type": "phong"}}, {"type": "diffuse", "reflectance": 0.3}), 0.45, 0.45),
        (blend(blend({"type": "phong"}, {"type": "walter"}), {"type": "walter"}), 0.28125, 0),
        ({"type": "twosided", "front": {"type": "phong"}, "back": {"type": "diffuse", "reflectance": 0.3}}, 0.5, 0.3),
        ({"type": "diffuse", "reflectance": 0.3}, 0.3, 0.3),
        ({"type": "conductor"}, 0, 0),
    ],
    ids=named,
)
def test_ambient_light_meets_the_diffuse_reflectance(bsdf, front, back):
    """Which is a formula's colour, even where its albedo is another, seen from both sides; and of built-ins what they
    say that it is."""
    assert shade(bsdf, ambient=0.5) == pytest.approx(0.5 * front, abs=1e-6)
    assert shade(bsdf, ambient=0.5, tilt=180) == pytest.approx(0.5 * back, abs=1e-6)


def test_ambient_light_is_white_in_spectral_variants():
    """As lights are, of which the colours are those of emission."""
    with mi.variant_context("llvm_ad_spectral"):
        image = shaded(plate(WHITE, ambient={"type": "rgb", "value": [0.5, 0.5, 0.25]}), spp=20000)
    np.testing.assert_allclose(image, np.broadcast_to([0.4, 0.4, 0.2], image.shape), rtol=0.03)


# --- What surfaces reflect of it ------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "bsdf",
    [
        {"type": "roughplastic", "alpha": 0.3},
        {"type": "roughconductor", "alpha": 0.4},
        {"type": "principled"},
        {"type": "twosided", "inner": {"type": "diffuse"}},
        {"type": "ward", "alpha": 0.4},
    ],
    ids=named,
)
def test_any_bsdf_is_shaded_with_its_own_value(bsdf):
    """π f cosθ of a tilted plate, seen from where the light comes from."""
    tilt = 25.0
    wi = direction(tilt)[None]
    (f_cos,) = call(mi.load_dict(bsdf).eval, mi.BSDFContext(), wi, wi)
    assert f_cos.mean() > 0.01
    assert shade(bsdf, SUN, tilt=tilt, clamp=False) == pytest.approx(np.pi * f_cos.mean(), rel=1e-3)
