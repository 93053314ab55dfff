"""``environment_reflection``: the environment in the mirror direction, for ours and for BSDFs that know no mirror."""

import warnings

import mitsuba as mi
import numpy as np
import pytest
from plates import SKY, SUN, WHITE, plate, shade, shaded
from support import LOFT, call, direction

import mi_brdfs
from mi_brdfs.lobes import LambertLobe


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
    for it in [it for it in bsdf.values() if isinstance(it, dict)] or [bsdf]:
        it["reflectance" if it["type"] in ("eon", "lambert") else "diffuse_reflectance"] = 0.0
    assert shade(bsdf, SKY, environment_reflection=True, tilt=60) == pytest.approx(0.5 * reflectance, abs=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_back_of_a_two_sided_surface_mirrors():
    two = {"type": "twosided", "front": WHITE, "back": {"type": "phong", "diffuse_reflectance": 0.0}}
    assert shade(two, SKY, environment_reflection=True, tilt=150) == pytest.approx(0.1, abs=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_the_mirrored_environment_does_not_light_the_lobes_that_mirror_it():
    metal = {"type": "ward", "diffuse_reflectance": 0.3, "alpha": 0.5}
    mirrored = shade(metal, SKY, spp=20000, environment_reflection=True, clamp=False)
    assert mirrored == pytest.approx(0.5 * (0.3 * np.pi + 0.2), rel=0.02)
    assert shade(metal, SKY, spp=20000, clamp=False) == pytest.approx(0.5 * np.pi * (0.3 + 0.2 * 0.75), rel=0.1)


@pytest.mark.usefixtures("llvm_rgb", "as_before")
def test_the_environment_lights_what_knows_no_mirror_as_ever():
    """Measured data, and a guest whose glossy lobe does not say what it mirrors."""

    class Sheen(LambertLobe):
        glossy = True

    members = {"__doc__": "A guest.", "lobes": lambda self, p: (Sheen(0.5),)}
    mi_brdfs.register(type("Guest", (mi_brdfs.Model,), members))
    for bsdf in {"type": "tabulated", "filename": str(LOFT)}, {"type": "guest"}:
        with pytest.warns(UserWarning, match=f"no mirror reflectance is known for {bsdf['type']}"):
            lit = shade(bsdf, SKY, environment_reflection=True, spp=64)
        assert lit == shade(bsdf, SKY, spp=64) > 0.001


@pytest.mark.usefixtures("llvm_rgb")
def test_foreign_bsdfs_are_not_mirrors_and_said_so_once():
    scene = plate({"type": "roughconductor"}, SKY, SUN, environment_reflection=True)
    with pytest.warns(UserWarning, match="shading: no mirror reflectance is known for RoughConductor") as said:
        shaded(scene, spp=1)
        shaded(scene, spp=1)
    assert len(said) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for dull in ("diffuse", "null"):
            shaded(plate({"type": dull}, SKY, environment_reflection=True), spp=1)


@pytest.mark.parametrize("name", mi_brdfs.list_models())
def test_every_model_knows_its_mirror_reflectance(name, llvm_rgb):
    """Which those have that are not diffuse alone."""
    bsdf = mi.load_dict({"type": name})
    (reflectance,) = call(lambda ctx, si, active: bsdf.mirror_reflectance(si, active), None, direction(40)[None])
    assert reflectance.min() >= 0
    assert reflectance.max() <= 1
    assert (reflectance.max() > 0) == mi.has_flag(bsdf.flags(), mi.BSDFFlags.GlossyReflection)
