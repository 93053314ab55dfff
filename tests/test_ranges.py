"""Parameters that leave their ranges: where they are, and how to get them back. That they come back by themselves:
test_optimisation.py."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_brdfs

CHECKER = {"type": "checkerboard", "color0": 1.2, "color1": 3.0}


@pytest.mark.usefixtures("llvm_rgb")
def test_nothing_leads_further_out():
    """A loss that would fall beyond the limit has no derivative there, and one at the limit has."""
    bsdf = mi.load_dict({"type": "lambert"})
    params = mi.traverse(bsdf)
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    for value, brighter, darker in [
        (1.4, 0, 1 / np.pi),
        (1, 1 / np.pi, 1 / np.pi),
        (0, 1 / np.pi, 1 / np.pi),
        (-1, 1 / np.pi, 0),
    ]:
        for sign, expected in ((-1, brighter), (1, darker)):
            params["reflectance.value"] = mi.Float(value)
            dr.enable_grad(params["reflectance.value"])
            params.update()
            dr.backward(sign * bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1), True).x)
            assert dr.grad(params["reflectance.value"])[0] == pytest.approx(sign * expected, rel=1e-5)


def test_ranges_by_traverse_key(variant):
    bsdf = mi.load_dict({"type": "low", "b": {"type": "checkerboard"}, "a": 3.0, "int_ior": CHECKER})
    assert mi_brdfs.ranges(bsdf) == {
        "a.value": (0, float("inf")),
        "b.color0.value": (0, 1e8),
        "b.color1.value": (0, 1e8),
        "c.value": (0, 10),
        "int_ior.color0.value": (1, 100),
        "int_ior.color1.value": (1, 100),
    }
    assert set(mi_brdfs.ranges(bsdf)) <= set(mi.traverse(bsdf).keys())
    nested = {"type": "kurt", "alpha_u_2": 0.1, "alpha_v_2": 0.2, "f0_1": 0.5, "rotation": 0.2}
    ranges = mi_brdfs.ranges(mi.load_dict(nested))
    assert ranges["alpha_u_2.value"] == (1e-4, 2) and ranges["f0_1.value"] == (0, 1)
    assert not any(key.startswith("rotation") for key in ranges)
    with pytest.raises(ValueError, match="SmoothDiffuse declares no ranges: it is not a BSDF of mi_brdfs"):
        mi_brdfs.ranges(mi.load_dict({"type": "diffuse"}))


@pytest.mark.usefixtures("llvm_rgb")
def test_what_has_no_ranges_is_told():
    with mi.variant_context("scalar_rgb"):
        other = mi.load_dict({"type": "ward"})
        params = mi.traverse(other)
    for given, kind in ({"type": "ward"}, "dict"), (None, "NoneType"), (other, "Ward"):
        with pytest.raises(ValueError, match=f"{kind} is not a BSDF of llvm_ad_rgb; give a loaded BSDF"):
            mi_brdfs.ranges(given)
    with pytest.raises(ValueError, match=r"Scene holds no parameters; give what mitsuba\.traverse"):
        mi_brdfs.project(mi.load_dict({"type": "scene"}))
    with pytest.raises(ValueError, match="not of llvm_ad_rgb; activate the variant that they were loaded in"):
        mi_brdfs.project(params)


def test_coefficients_of_spectra_have_no_range():
    """They may be anything; numbers and measured spectra have their range in spectral variants, too."""
    red = {"type": "rgb", "value": [0.9, 0.1, 0.1]}
    measured = {"type": "spectrum", "value": [(400, 0.1), (700, 0.9)]}
    given = {"type": "phong", "diffuse_reflectance": red, "specular_reflectance": measured}
    for variant, expected in (("llvm_ad_rgb", True), ("llvm_ad_spectral", False)):
        with mi.variant_context(variant):
            ranges = mi_brdfs.ranges(mi.load_dict(given))
            assert ("diffuse_reflectance.value" in ranges) == expected
            assert ranges["exponent.value"] == (0, 1e6)
            assert any(key.startswith("specular_reflectance") for key in ranges)


@pytest.mark.usefixtures("llvm_rgb")
def test_project_puts_all_of_a_scene_into_range():
    """Ours within twosided, referred to, and with a bitmap; what is not ours is left alone."""
    pixels = np.float32([[-1, 0.5], [0.7, 9]])[..., None]
    ball = {"type": "sphere", "bsdf": {"type": "twosided", "inner": {"type": "ward", "alpha": 0.2}}}
    scene = mi.load_dict(
        {
            "type": "scene",
            "ball": ball,
            "shared": {"type": "lambert", "reflectance": {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True}},
            "one": {"type": "sphere", "bsdf": {"type": "ref", "id": "shared"}},
            "other": {
                "type": "sphere",
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.3]}},
            },
        }
    )
    params = mi.traverse(scene)
    params["ball.bsdf.brdf_0.alpha.value"] = 7
    params["other.bsdf.reflectance.value"] = mi.Color3f(2, 3, 4)
    params.update()
    mi_brdfs.project(params)
    assert params["ball.bsdf.brdf_0.alpha.value"] == 2
    np.testing.assert_array_equal(params["shared.reflectance.data"].numpy(), np.clip(pixels, 0, 1))
    assert dr.all(params["other.bsdf.reflectance.value"] == mi.Color3f(2, 3, 4))


@pytest.mark.usefixtures("llvm_rgb")
def test_project_knows_a_texture_that_the_scene_holds(tmp_path):
    """Its key is its own, and of two that refer to it the narrower range holds."""
    mi.Bitmap(np.full((2, 2, 1), 0.2, np.float32)).write(str(tmp_path / "grey.exr"))
    grey = f'<texture type="bitmap" id="grey"><string name="filename" value="{tmp_path / "grey.exr"}"/></texture>'
    balls = "".join(
        f'<shape type="sphere"><bsdf type="{name}"><ref name="{parameter}" id="grey"/></bsdf></shape>'
        for name, parameter in (("lambert", "reflectance"), ("ward", "alpha"))
    )
    params = mi.traverse(mi.load_string(f'<scene version="3.0.0">{grey}{balls}</scene>'))
    (key,) = (key for key in params.keys() if key.endswith(".data"))
    params[key] = mi.TensorXf(np.float32([[-1, 0.5], [1.5, 9]])[..., None])
    params.update()
    mi_brdfs.project(params)
    np.testing.assert_array_equal(params[key].numpy()[..., 0], np.float32([[1e-4, 0.5], [1, 1]]))


@pytest.mark.usefixtures("llvm_rgb")
def test_project_keeps_an_optimizer_going():
    """Its variables are put into range, and the next gradients are theirs; what it does not hold is left alone."""
    bsdf = mi.load_dict({"type": "ward"})
    params = mi.traverse(bsdf)
    optimizer = mi.ad.Adam(lr=0.5)
    optimizer["alpha.value"] = params["alpha.value"]
    params["diffuse_reflectance.value"] = 5.0
    params.update(optimizer)
    for _ in range(100):
        dr.backward(dr.square(params["alpha.value"] - 0.7))
        slope = 2 * (optimizer["alpha.value"] - 0.7)
        assert dr.grad(optimizer["alpha.value"])[0] == slope[0] != 0
        optimizer.set_learning_rate(0.95 * optimizer.learning_rate())
        optimizer.step()
        params.update(optimizer)
        mi_brdfs.project(params, optimizer)
        assert 1e-4 <= optimizer["alpha.value"][0] <= 2 and dr.all(optimizer["alpha.value"] == params["alpha.value"])
    assert optimizer["alpha.value"][0] == pytest.approx(0.7, abs=0.01)
    assert params["diffuse_reflectance.value"] == 5
