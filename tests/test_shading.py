"""Local illumination: what the parameters of ``shading`` mean, and what its lights do to BSDFs, ours and others."""

import mitsuba as mi
import numpy as np
import pytest
from plates import SUN, WHITE, lamp, plate, shaded, value
from support import call, direction


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
