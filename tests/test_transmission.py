"""Lobes on the other side of the surface, with the one model that has one."""

import mitsuba as mi
import numpy as np
import pytest
from support import call, context, direction

SHEET = {"type": "wrap", "domain": "sphere", "wrap": 0.8, "exponent": 1.5}


def test_flags(variant):
    bsdf, flags = mi.load_dict(SHEET), mi.BSDFFlags
    assert bsdf.component_count() == 2
    assert bsdf.flags(0) == int(flags.DiffuseReflection | flags.FrontSide | flags.NonSymmetric)
    assert bsdf.flags(1) == int(flags.DiffuseTransmission | flags.FrontSide | flags.NonSymmetric)
    with pytest.raises(RuntimeError, match="transmission"):
        mi.load_dict({"type": "twosided", "inner": SHEET})


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("normalization, albedo", [("energy", 0.5), ("none", 0.5 * 2 * 1.8 / 2.5)])
def test_albedo(normalization, albedo):
    """The weight is the albedo of both lobes together, in each sample."""
    bsdf, rng = mi.load_dict(SHEET | {"normalization": normalization}), np.random.default_rng(2)
    wi, u, v = np.tile(direction(40), (20_000, 1)), rng.random((20_000, 1)), rng.random((20_000, 2))
    wo, _, weight = call(bsdf.sample, context(), wi, u, v)
    np.testing.assert_allclose(weight, albedo, rtol=1e-5)
    assert (wo[:, 2] < 0).mean() == pytest.approx((0.8 / 1.8) ** 2.5, abs=0.01)


@pytest.mark.usefixtures("llvm_rgb")
def test_light_from_behind():
    """A sheet seen from its front, lit by a distant lamp behind it: radiance = E f |cosθ|."""
    for domain, expected in [("sphere", 0.5 * 3 / (4 * np.pi) * 0.25**2), ("hemisphere", 0)]:
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": 2},
                "sensor": {
                    "type": "perspective",
                    "fov": 20,
                    "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
                    "film": {"type": "hdrfilm", "width": 8, "height": 8},
                },
                "sheet": {"type": "rectangle", "bsdf": {"type": "wrap", "domain": domain}},
                "lamp": {"type": "directional", "direction": [np.sqrt(3) / 2, 0, 0.5], "irradiance": 1.0},
            }
        )
        np.testing.assert_allclose(np.array(mi.render(scene, spp=4)), expected, rtol=1e-4)
