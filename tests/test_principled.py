"""Burley's model against Mitsuba's ``principled``, where the two are the same model.

They share the base lobe (Burley's term of 2012 and the retro-reflection of 2015 are one polynomial; ``flatness`` is
``subsurface``), the sheen, the tints, and the specular lobe with its roughness and anisotropy, but for its Fresnel
term: ``principled`` mixes the exact reflectance of a dielectric into it, with the weight (1 - metallic)
(1 - spec_tint). So they are equal where this is 0. The clear coats differ by a factor: that of ``principled`` lacks the
denominator 4 cosθ_i cosθ_o of a microfacet lobe.
"""

import mitsuba as mi
import numpy as np
import pytest
from support import call, hemisphere, near_mirror

pytestmark = pytest.mark.usefixtures("llvm_rgb")

ORANGE = {"base_color": {"type": "rgb", "value": [0.8, 0.4, 0.15]}}
GREY = {"base_color": 0.6}
DIELECTRIC = {"spec_tint": 1.0}
SHARED = {
    "base": ORANGE | DIELECTRIC | {"roughness": 0.3},
    "rough base": ORANGE | DIELECTRIC | {"roughness": 0.9},
    "subsurface": ORANGE | DIELECTRIC | {"roughness": 0.6, "subsurface": 0.7},
    "untinted sheen": ORANGE | DIELECTRIC | {"sheen": 0.8, "sheen_tint": 0.0},
    "tinted sheen": ORANGE | DIELECTRIC | {"sheen": 0.8, "sheen_tint": 0.6},
    "specular": ORANGE | DIELECTRIC | {"specular": 0.9, "roughness": 0.4},
    "metal": ORANGE | {"metallic": 1.0, "roughness": 0.4},
    "smooth metal": ORANGE | {"metallic": 1.0, "roughness": 0.2},
    "anisotropic metal": ORANGE | {"metallic": 1.0, "roughness": 0.5, "anisotropic": 0.8},
    "half metal": ORANGE | DIELECTRIC | {"metallic": 0.5, "roughness": 0.4},
    "grey": GREY | DIELECTRIC | {"metallic": 0.3, "sheen": 0.5, "subsurface": 0.5, "anisotropic": 0.3},
}
DEFAULTS = {"specular": 0.5, "sheen_tint": 0.5, "clearcoat_gloss": 1.0}


def load(given):
    """The same parameters as ``burley`` and as ``principled``, whose defaults differ."""
    given = DEFAULTS | given
    theirs = {"flatness" if key == "subsurface" else key: value for key, value in given.items()}
    return mi.load_dict({"type": "burley", **given}), mi.load_dict({"type": "principled", **theirs})


def pairs(count):
    """Pairs of directions, half of them near each other's mirror direction."""
    wi = hemisphere(count, 1)
    return wi, near_mirror(wi, hemisphere(count, 2), 0.05)


@pytest.mark.parametrize("name", SHARED)
def test_same_values(name):
    """To float32 round-off, which D multiplies by 4/α at most (α = .04 here)."""
    ours, theirs = load(SHARED[name])
    wi, wo = pairs(20_000)
    expected = call(theirs.eval, mi.BSDFContext(), wi, wo)[0]
    assert (expected > 0).all()
    np.testing.assert_allclose(call(ours.eval, mi.BSDFContext(), wi, wo)[0], expected, rtol=2e-5)


@pytest.mark.parametrize("gloss", [0.0, 0.3, 0.8])
def test_the_clear_coats_differ_by_the_denominator(gloss):
    """The difference to the surface without a coat; what it adds is compared where it is not lost to round-off."""
    ctx, (wi, wo) = mi.BSDFContext(), pairs(20_000)
    black = DIELECTRIC | {"base_color": 0.0, "roughness": 1.0, "specular": 0.0, "clearcoat_gloss": gloss}
    plain, coated = load(black), load(black | {"clearcoat": 1.0})
    without, with_coat = ([call(bsdf.eval, ctx, wi, wo)[0] for bsdf in pair] for pair in (plain, coated))
    ours, theirs = with_coat[0] - without[0], with_coat[1] - without[1]
    denominator = 4 * wi[:, 2:] * wo[:, 2:]
    seen = (ours > 1e-2).all(axis=1) & (theirs > 1e-2).all(axis=1)
    assert seen.sum() > 100
    np.testing.assert_allclose(ours[seen] * denominator[seen], theirs[seen], rtol=1e-3)


def test_the_dielectrics_differ_by_schlicks_approximation():
    """Without a tint ``principled`` is exact, and Schlick's F for an index of 1.5 errs by up to 0.04: the values
    of the specular lobe alone must differ, by no more than that does."""
    ours, theirs = load({"base_color": 0.0, "roughness": 0.4})
    wi, wo = pairs(20_000)
    ours, theirs = (call(bsdf.eval, mi.BSDFContext(), wi, wo)[0][:, 0] for bsdf in (ours, theirs))
    ratio = ours / theirs
    assert 0.7 < ratio.min() < 0.99 and 1.01 < ratio.max() < 1.4
