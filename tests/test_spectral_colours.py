"""Colours above one in spectral variants, where rgb is upsampled to a reflectance, which cannot exceed one."""

import mitsuba as mi
import numpy as np
import pytest
from support import call, hemisphere, interaction

import mi_brdfs

GREY = {"type": "rgb", "value": [5.0, 5.0, 5.0]}
UNBOUNDED = {
    "low": ("low", {"a": GREY}),
    "brady": ("brady", {"specular_reflectance": GREY}),
    "eta and k": ("walter", {"eta": GREY, "k": {"type": "rgb", "value": [3.0, 3.0, 3.0]}}),
}


def values_in(variant, given):
    with mi.variant_context(variant):
        bsdf = mi.load_dict(given)
        return call(bsdf.eval, mi.BSDFContext(), hemisphere(500, 1), hemisphere(500, 2))[0]


@pytest.mark.parametrize("variant", ["llvm_ad_spectral", pytest.param("scalar_spectral", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", UNBOUNDED)
def test_grey_is_what_it_is_in_rgb(name, variant):
    plugin, colours = UNBOUNDED[name]
    given = {"type": plugin, **colours}
    expected = values_in("llvm_ad_rgb", given)[:, :1]
    assert expected.max() > 0
    np.testing.assert_allclose(values_in(variant, given), np.broadcast_to(expected, (500, 4)), rtol=1e-3, atol=1e-7)


def test_the_hue_is_kept():
    """The spectrum is that of Mitsuba's reflectance of the same hue, times the scale between them."""
    with mi.variant_context("llvm_ad_spectral"):
        si = interaction(np.float32([[0, 0, 1]]))
        bright = mi.load_dict({"type": "low", "a": {"type": "rgb", "value": [6.0, 3.0, 1.5]}})
        dim = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.25, 0.125]}})
        reflectance = dim.eval_diffuse_reflectance(si, True)
        np.testing.assert_allclose(bright.eval_attribute("a", si, True), 12 * np.array(reflectance), rtol=1e-4)


def test_a_later_value_keeps_the_scale():
    """The scale is traversed beside the coefficients, so that both can be changed."""
    with mi.variant_context("llvm_ad_spectral"):
        bsdf = mi.load_dict({"type": "low", "a": GREY})
        params = mi.traverse(bsdf)
        assert params["a_scale.value"] == 10
        before = call(bsdf.eval, mi.BSDFContext(), hemisphere(50, 1), hemisphere(50, 2))[0]
        params["a_scale.value"] = 20
        params.update()
        after = call(bsdf.eval, mi.BSDFContext(), hemisphere(50, 1), hemisphere(50, 2))[0]
        np.testing.assert_allclose(after, 2 * before, rtol=1e-5)
        assert "a.value" not in mi_brdfs.ranges(bsdf) and "scale = " in str(bsdf)


def test_bitmaps_of_colours_are_warned_of():
    """Mitsuba clips them before anybody can look; those of one channel hold any value."""
    for variant, channels, warned in [
        ("llvm_ad_spectral", 3, True),
        ("llvm_ad_spectral", 1, False),
        ("llvm_ad_rgb", 3, False),
    ]:
        bitmap = mi.Bitmap(np.full((2, 2, channels), 4, np.float32))
        given = {"type": "low", "a": {"type": "bitmap", "bitmap": bitmap}}
        with mi.variant_context(variant):
            if warned:
                with pytest.warns(UserWarning, match="low: a is a bitmap of colours, of which Mitsuba's spectral"):
                    mi.load_dict(given)
            else:
                assert mi.load_dict(given)
