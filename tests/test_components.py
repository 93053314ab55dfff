"""Lobes as components: flags, masks, the choice among them, and the other questions that Mitsuba and calls from Python
ask a BSDF."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support import call, context, direction, hemisphere, interaction, numbers

TWO_LOBES = {
    "phong": {"type": "phong", "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.3, 0.5]}},
    "walter": {"type": "walter", "alpha": 0.3, "f0": 0.04, "diffuse_reflectance": 0.3},
}


OPTIONAL = [
    ("walter", {}, 1, "diffuse_reflectance"),
    ("low", {}, 1, "diffuse_reflectance"),
    ("burley", {}, 2, "sheen"),
    ("burley", {"sheen": 1.0}, 3, "clearcoat"),
]


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name, given, count, optional", OPTIONAL)
def test_a_lobe_is_there_if_it_is_given(name, given, count, optional):
    """Even as 0: then it is black, but can be optimised."""
    without = mi.load_dict({"type": name, **given})
    black = mi.load_dict({"type": name, **given, optional: 0.0})
    assert (without.component_count(), black.component_count()) == (count, count + 1)
    keys = [{key.split(".")[0] for key in mi.traverse(bsdf).keys()} for bsdf in (without, black)]
    assert keys[1] - keys[0] == {optional}
    wi, wo = hemisphere(50, 3), hemisphere(50, 4)
    np.testing.assert_allclose(*(call(bsdf.eval, context(), wi, wo)[0] for bsdf in (without, black)), rtol=1e-6)

    params = mi.traverse(black)
    key = next(key for key in params.keys() if key.startswith(optional))
    params[key] = params[key] + 0.5
    params.update()
    gained = call(black.eval, context(), wi, wo)[0] - call(without.eval, context(), wi, wo)[0]
    assert (gained >= 0).all() and gained.max() > 1e-3


@pytest.mark.usefixtures("llvm_rgb")
def test_flags_tell_anisotropy_textures_and_reciprocity():
    flags = mi.BSDFFlags
    pair = mi.load_dict({"type": "ward", "alpha_u": 0.1, "alpha_v": 0.2})
    turned = mi.load_dict({"type": "ward", "rotation": 0.25})
    textured = mi.load_dict({"type": "ward", "specular_reflectance": {"type": "checkerboard"}})
    original = mi.load_dict({"type": "phong", "normalization": "original"})
    plain = mi.load_dict({"type": "ward"})
    for bsdf, flag in [(pair, flags.Anisotropic), (original, flags.NonSymmetric)]:
        assert mi.has_flag(bsdf.flags(1), flag) and not mi.has_flag(bsdf.flags(0), flag)
        assert not mi.has_flag(plain.flags(), flag)
    assert not mi.has_flag(turned.flags(), flags.Anisotropic)
    assert mi.has_flag(textured.flags(), flags.SpatiallyVarying)
    assert not mi.has_flag(plain.flags(), flags.SpatiallyVarying)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "bsdf, anisotropic",
    [
        ({"type": "kurt", "alpha_1": 0.1, "alpha_u_2": 0.1, "alpha_v_2": 0.4}, [False, False, True]),
        ({"type": "burley", "anisotropic": 0.5, "clearcoat": 1.0}, [False, True, False]),
        ({"type": "ashikhminshirley", "exponent_u": 10, "exponent_v": 40}, [False, True]),
        ({"type": "microfacet", "diffuse_reflectance": 0.5, "f0": 0.5, "alpha_u": 0.1, "alpha_v": 0.4}, [False, True]),
    ],
)
def test_anisotropy_belongs_to_a_lobe(bsdf, anisotropic):
    loaded = mi.load_dict(bsdf)
    flagged = [mi.has_flag(loaded.flags(k), mi.BSDFFlags.Anisotropic) for k in range(loaded.component_count())]
    assert flagged == anisotropic


@pytest.mark.parametrize("name", TWO_LOBES)
def test_masks_select_lobes(name, variant):
    """Component and type mask mean the same, the lobes add up to the whole, and an empty selection is black."""
    bsdf, flags = mi.load_dict(TWO_LOBES[name]), mi.BSDFFlags
    kinds = [flags.DiffuseReflection, flags.GlossyReflection]
    assert [bsdf.flags(k) for k in range(bsdf.component_count())] == [int(kind | flags.FrontSide) for kind in kinds]
    assert bsdf.flags() == bsdf.flags(0) | bsdf.flags(1)
    wi, wo = hemisphere(30, 1), hemisphere(30, 2)
    rng = np.random.default_rng(0)
    u, v = rng.random((30, 1)), rng.random((30, 2))
    lobes = []
    for component, mask in enumerate(kinds):
        by_index, by_type = context(component), context(mask=mask)
        value, pdf = call(bsdf.eval_pdf, by_index, wi, wo)
        lobes.append(value)
        np.testing.assert_array_equal(call(bsdf.eval_pdf, by_type, wi, wo)[0], value)
        np.testing.assert_array_equal(call(bsdf.eval_pdf, by_type, wi, wo)[1], pdf)
        for ctx in (by_index, by_type):
            bs, _ = bsdf.sample(ctx, interaction(direction(40)), mi.Float(0.3), mi.Point2f(0.4, 0.6), True)
            assert dr.all(bs.sampled_component == component) and dr.all(bs.sampled_type == int(mask))
    np.testing.assert_allclose(call(bsdf.eval, context(), wi, wo)[0], sum(lobes), rtol=1e-5)

    for nothing in (context(7), context(0, flags.GlossyReflection), context(mask=flags.Transmission)):
        assert not any(value.any() for value in call(bsdf.eval_pdf, nothing, wi, wo))
        assert not call(bsdf.sample, nothing, wi, u, v)[2].any()
        assert not call(bsdf.eval_pdf_sample, nothing, wi, wo, u, v)[4].any()


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", TWO_LOBES)
def test_lobes_are_chosen_by_energy(name):
    """A lobe's share of the samples follows its share of the reflected light, at each point by itself."""
    count = 1 << 18
    rng = np.random.default_rng(1)
    u, v = rng.random((count, 1)), rng.random((count, 2))
    dark_left = mi.Bitmap(np.array([[[0.02], [0.9]]], np.float32))
    texture = {"type": "bitmap", "bitmap": dark_left, "raw": True, "filter_type": "nearest"}
    bsdf = mi.load_dict({**TWO_LOBES[name], "diffuse_reflectance": texture})
    for x in (0.25, 0.75):
        si = interaction(direction(30))
        si.uv = mi.Point2f(x, 0.5)
        bs, _ = bsdf.sample(context(), si, mi.Float(u.ravel()), mi.Point2f(v.T), True)
        share = numbers(mi.Float(bs.sampled_component)).mean()
        energies = []
        for component in (0, 1):
            bs, weight = bsdf.sample(context(component), si, mi.Float(u.ravel()), mi.Point2f(v.T), True)
            energies.append(numbers(weight)[:, 1].mean())
        assert share == pytest.approx(energies[1] / sum(energies), abs=0.1)


@pytest.mark.parametrize("name", TWO_LOBES)
def test_attributes_and_albedo(name, variant):
    bsdf, si = mi.load_dict(TWO_LOBES[name]), interaction(direction(20))
    assert dr.all(bsdf.has_attribute("diffuse_reflectance", True))
    assert not dr.any(bsdf.has_attribute("nonsense", True))
    assert numbers(bsdf.eval_attribute("diffuse_reflectance", si, True)).max() <= 0.6
    if name == "phong" and mi.is_rgb:
        for method in (bsdf.eval_attribute, bsdf.eval_attribute_3):
            value = numbers(method("diffuse_reflectance", si, True)).ravel()
            np.testing.assert_allclose(value, [0.1, 0.3, 0.5], rtol=1e-6)
    if name != "phong":
        assert numbers(bsdf.eval_attribute_1("alpha", si, True)).item() == pytest.approx(0.3)
    reflectance = bsdf.eval_diffuse_reflectance(si, True)
    assert ((numbers(reflectance) > 0.2) & (numbers(reflectance) <= 1)).all()
    assert not mi.is_polarized or np.count_nonzero(reflectance) == 1  # of the Mueller matrix


@pytest.mark.parametrize("name", TWO_LOBES)
def test_parameters_are_traversed_and_shown(name, variant):
    bsdf = mi.load_dict(TWO_LOBES[name])
    params = mi.traverse(bsdf)
    keys = {key.split(".")[0] for key in params.keys()}
    expected = {"phong": {"exponent"}, "walter": {"alpha", "f0"}}[name]
    assert keys == {"diffuse_reflectance", "specular_reflectance"} | expected
    assert all(key in str(bsdf) for key in keys)
    before = call(bsdf.eval, context(0), direction(20)[None], direction(30)[None])[0]
    key = next(key for key in params.keys() if key.startswith("diffuse_reflectance"))
    params[key] = params[key] * 0.5
    params.update()
    after = call(bsdf.eval, context(0), direction(20)[None], direction(30)[None])[0]
    if mi.is_spectral and "rgb" in str(TWO_LOBES[name]):
        assert (after != before).all()  # the coefficients of an upsampled colour are not proportional to it
    else:
        np.testing.assert_allclose(after, before / 2, rtol=1e-5)


# --- What Mitsuba's own BSDFs take and return in calls from Python, ours do, too -------------------------------------


@pytest.mark.parametrize("wo", [[0, 0.6, 0.8], (0, 0.6, 0.8), np.float32([0, 0.6, 0.8]), np.array([0, 0.6, 0.8])])
def test_directions_and_variates_in_any_form(wo, variant):
    """The same results as of Mitsuba's types."""
    bsdf, ctx = mi.load_dict({"type": "phong"}), mi.BSDFContext()
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    u, v = 0.4, wo[1:]
    exact = mi.Vector3f(*map(float, wo)), mi.Float(u), mi.Point2f(*map(float, v))
    for given in ((wo, u, v), (wo, np.float32(u), v)):
        for name, arguments in [("eval", 1), ("pdf", 1), ("eval_pdf", 1), ("eval_pdf_sample", 3)]:
            method = getattr(bsdf, name)
            assert str(method(ctx, si, *given[:arguments])) == str(method(ctx, si, *exact[:arguments])), name
        assert str(bsdf.sample(ctx, si, *given[1:])) == str(bsdf.sample(ctx, si, *exact[1:]))


def test_an_unknown_attribute(variant):
    """Zero, or in scalar variants an error, as of ``diffuse``; and has_attribute says that there is none."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    ours, theirs = (mi.load_dict({"type": name}) for name in ("ward", "diffuse"))
    for method in ("eval_attribute", "eval_attribute_1", "eval_attribute_3"):
        results = []
        for bsdf in (ours, theirs):
            try:
                results.append(str(getattr(bsdf, method)("nothing", si)))
            except RuntimeError as error:
                assert "Invalid attribute requested nothing" in str(error)
                results.append("error")
        assert results[0] == results[1]
    assert not dr.any(ours.has_attribute("nothing"))
