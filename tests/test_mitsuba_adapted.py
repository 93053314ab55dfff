"""What Mitsuba's tests of its BSDFs (src/bsdfs/tests of 3.9.1) ask of them, asked of the nearest models here."""

import mitsuba as mi
import numpy as np
import pytest
from support import call, chi_square, context, direction, hemisphere, interaction, lattice, numbers

GREY = {"type": "lambert", "reflectance": 0.4}
WHITE = {"type": "lambert", "reflectance": 1.0}
METAL = {"type": "walter", "alpha": 0.3, "material": "Al"}
BRUSHED = {"type": "walter", "alpha_u": 0.4, "alpha_v": 0.1, "material": "Al"}
DIAGONAL = np.array([1, 1, 1]) / np.sqrt(3)
FRONT, BACK = mi.BSDFFlags.FrontSide, mi.BSDFFlags.BackSide
DIFFUSE, GLOSSY = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection
UP = np.array([[0, 0, 1]], np.float32)


def blend(weight, first, second):
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


def two_sided(*nested):
    return {"type": "twosided"} | {f"side_{k}": it for k, it in enumerate(nested)}


def quarter_circle(count=20):
    """Directions from the normal to the horizon."""
    theta = np.linspace(0, np.pi / 2, count)
    return np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=-1).astype(np.float32)


LOBES = {
    "diffuse": (GREY, [DIFFUSE | FRONT]),
    "roughconductor": (METAL, [GLOSSY | FRONT]),
    "anisotropic": (BRUSHED, [GLOSSY | FRONT | mi.BSDFFlags.Anisotropic]),
    "principled": ({"type": "burley"}, [DIFFUSE | FRONT, GLOSSY | FRONT]),
    "twosided": (two_sided(GREY), [DIFFUSE | FRONT, DIFFUSE | BACK]),
    "two sides": (two_sided(METAL, GREY), [GLOSSY | FRONT, DIFFUSE | BACK]),
    "blend": (blend(0.2, GREY, GREY), [DIFFUSE | FRONT, DIFFUSE | FRONT]),
    "other blend": (blend(0.2, METAL, GREY), [GLOSSY | FRONT, DIFFUSE | FRONT]),
    "mask": ({"type": "mask", "opacity": 0.5, "nested": GREY}, [DIFFUSE | FRONT, mi.BSDFFlags.Null | FRONT | BACK]),
}


@pytest.mark.parametrize("name", LOBES)
def test_lobes_and_their_flags(name):
    """As test_diffuse, _twosided, _blendbsdf and _principled: the components, their flags, and all of them together."""
    given, expected = LOBES[name]
    bsdf = mi.load_dict(given)
    assert [bsdf.flags(k) for k in range(bsdf.component_count())] == [int(it) for it in expected]
    assert bsdf.flags() == int(np.bitwise_or.reduce([int(it) for it in expected]))


def test_anisotropy_that_comes_later():
    """As test_principled, but for the flag, which stays: a parameter that is changed makes it anisotropic."""
    changed, given = mi.load_dict({"type": "burley"}), mi.load_dict({"type": "burley", "anisotropic": 0.5})
    params = mi.traverse(changed)
    params["anisotropic.value"] = 0.5
    params.update()
    wi, wo = hemisphere(20, 1), hemisphere(20, 2)
    values = [call(bsdf.eval, context(), wi, wo)[0] for bsdf in (changed, given)]
    np.testing.assert_allclose(*values, rtol=1e-6)
    assert np.ptp(call(given.eval, context(), UP.repeat(2, 0), np.array([[0.6, 0, 0.8], [0, 0.6, 0.8]]))[0]) > 0.01


GLASS = {"type": "roughdielectric", "alpha": 0.5}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("first, second", [(GREY, GREY), (GREY, GLASS), (METAL | {"alpha": 0.5}, GLASS)])
def test_samples_of_blends_have_their_density(first, second):
    """As the χ² tests of test_blendbsdf."""
    given = blend(0.2, first, second)
    if second is GLASS:  # whose samples may have a density but no weight
        sample, pdf = mi.chi2.BSDFAdapter("blendbsdf", given, wi=UP[0])
        test = mi.chi2.ChiSquareTest(mi.chi2.SphericalDomain(), sample, pdf, sample_dim=3, seed=1)
    else:
        test = chi_square(mi.load_dict(given), context(), UP[0], seed=1)
    assert test.run(test_count=3, quiet=True), test.messages


# --- Two sides --------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_each_side_samples_its_own():
    """As test_twosided: densities, values and samples of either side, where the other side has none."""
    dark, bright = GREY | {"reflectance": 0.1}, GREY | {"reflectance": 0.9}
    both = mi.load_dict(two_sided(dark, bright))
    wi = hemisphere(400, 1)
    wi[::2, 2] *= -1
    u = lattice(9, 1)[:400]
    wo, pdf, *_, weight = call(both.sample, context(), wi, u[:, :1], u[:, 1:])
    assert (np.sign(wo[:, 2]) == np.sign(wi[:, 2])).all()
    np.testing.assert_allclose(weight, np.where(wi[:, 2:] > 0, 0.1, 0.9).repeat(3, 1), rtol=1e-5)
    value, density = call(both.eval_pdf, context(), wi, wo)
    np.testing.assert_allclose(pdf, density, rtol=1e-5)
    np.testing.assert_allclose(value, weight * pdf, rtol=1e-5)
    assert not np.any(call(both.pdf, context(), wi, wo * [1, 1, -1])[0])


def test_each_side_has_its_own_attributes():
    """As test_twosided: diffuse reflectance and roughness are those of the side that wi is on."""
    sides = [METAL | {"alpha": 0.2}, METAL | {"alpha": 0.1}], [GREY | {"reflectance": 0.1}, GREY | {"reflectance": 0.9}]
    rough, diffuse = (mi.load_dict(two_sided(*it)) for it in sides)
    assert rough.has_attribute("alpha") and not rough.has_attribute("nothing")
    for sign, alpha, reflectance in ((1, 0.2, 0.1), (-1, 0.1, 0.9)):
        si = interaction(direction(30) * [1, 1, sign])
        np.testing.assert_allclose(numbers(rough.eval_attribute("alpha", si)), alpha, rtol=1e-6)
        np.testing.assert_allclose(numbers(diffuse.eval_diffuse_reflectance(si)), reflectance, rtol=1e-6)


# --- Blends, masks, normals -------------------------------------------------------------------------------------------


def test_a_blend_is_a_sum():
    """As test_blendbsdf: values of all, and of each component, are those of the parts times their weights."""
    first, second = mi.load_dict(METAL), mi.load_dict(WHITE)
    both, wi, wo = mi.load_dict(blend(0.2, METAL, WHITE)), UP.repeat(20, 0), quarter_circle()
    parts = [share * call(it.eval, context(), wi, wo)[0] for it, share in ((first, 0.8), (second, 0.2))]
    np.testing.assert_allclose(call(both.eval, context(), wi, wo)[0], sum(parts), rtol=1e-5, atol=1e-9)
    for component in (0, 1):
        found = call(both.eval, context(component), wi, wo)[0]
        np.testing.assert_allclose(found, parts[component], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("u", [0.1, 0.3])
def test_a_blend_samples_its_parts(u):
    """As test_blendbsdf: the weight of a sample of all is value over density, and that of a component its own, whatever
    the first number chooses."""
    both, si = mi.load_dict(blend(0.2, METAL, WHITE)), interaction(UP[0])
    bs, weight = both.sample(context(), si, u, [0.2, 0.9], True)
    value, pdf = both.eval_pdf(context(), si, bs.wo, True)
    np.testing.assert_allclose(numbers(weight), numbers(value) / pdf, rtol=1e-5)
    for component, (part, share) in enumerate([(METAL, 0.8), (WHITE, 0.2)]):
        bs, weight = both.sample(context(component), si, u, [0.2, 0.7], True)
        alone, own = mi.load_dict(part).sample(context(), si, u, [0.2, 0.7], True)
        np.testing.assert_allclose(numbers(weight), share * numbers(own), rtol=1e-5)
        np.testing.assert_allclose([*bs.wo, bs.pdf], [*alone.wo, alone.pdf], rtol=1e-5)


def test_a_mask_lets_through_what_it_does_not_show():
    """Mitsuba has no test of mask: the value is the opacity's share, and samples of the rest go straight on."""
    mask, si = mi.load_dict({"type": "mask", "opacity": 0.25, "nested": WHITE}), interaction(direction(40))
    np.testing.assert_allclose(numbers(mask.eval(context(), si, mi.Vector3f(0, 0, 1), True)), 0.25 / np.pi, rtol=1e-6)
    for u, through in ((0.2, False), (0.3, True)):
        bs, weight = mask.sample(context(), si, u, [0.3, 0.6], True)
        np.testing.assert_allclose(numbers(weight), 1, rtol=1e-5)
        assert np.allclose(bs.wo, -np.array(si.wi)) == through


def normal_map(normal, nested, **options):
    colour = {"type": "rgb", "value": list(np.asarray(normal) * 0.5 + 0.5)}
    return mi.load_dict({"type": "normalmap", "normalmap": colour, "nested": nested} | options)


def bumpmap(height, nested, scale=1.0):
    texture = {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(np.float32(height))}
    return mi.load_dict({"type": "bumpmap", "texture": texture, "scale": scale, "nested": nested})


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("kind", ["normalmap", "bumpmap"])
def test_flat_maps_change_nothing(kind):
    """As test_normalmap and _bumpmap (of the version after 3.9): values and densities of a brushed metal stay."""
    wi, wo = hemisphere(1000, 1), hemisphere(1000, 2)
    flat = normal_map((0, 0, 1), BRUSHED) if kind == "normalmap" else bumpmap(np.full((4, 4), 0.5), BRUSHED)
    found, expected = (call(bsdf.eval_pdf, context(), wi, wo) for bsdf in (flat, mi.load_dict(BRUSHED)))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-6)  # D is steep in the half vector


@pytest.mark.usefixtures("llvm_rgb")
def test_a_tilted_normal_is_a_turned_surface():
    """As test_normalmap: by 30°, without shadowing; where wo is above the surface as well as above the normal."""
    s, t, n = np.array([[np.sqrt(0.75), 0, -0.5], [0, 1, 0], [0.5, 0, np.sqrt(0.75)]])
    wi, wo = hemisphere(2000, 1), hemisphere(2000, 2)
    turned = [np.stack([w @ s, w @ t, w @ n], axis=-1).astype(np.float32) for w in (wi, wo)]
    above = (turned[0][:, 2] > 0.05) & (turned[1][:, 2] > 0.05)
    metal = BRUSHED | {"alpha_u": 0.2, "alpha_v": 0.05}
    tilted = normal_map(n, metal, use_shadowing_function=False, flip_invalid_normals=False)
    found = call(tilted.eval, context(), wi[above], wo[above])[0]
    expected = call(mi.load_dict(metal).eval, context(), *(w[above] for w in turned))[0]
    assert above.sum() > 1000
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize("shadowed", [False, True])
def test_options_of_normal_maps(shadowed):
    """As test_normalmap: a normal turned away from wi gives black unless it is flipped, and shadowing darkens what a
    normal at the horizon makes bright."""
    wi, wo = np.array([-1, -1, 0.5]) / 1.5, mi.Vector3f(0, 0, 1)
    bsdf = normal_map(DIAGONAL, GREY, flip_invalid_normals=shadowed)
    weight = bsdf.sample(context(), interaction(wi), 0.5, [0.5, 0.5], True)[1]
    for value in (weight, bsdf.eval(context(), interaction(wi), wo, True)):
        assert np.all(numbers(value) > 0) == shadowed
    grazing = np.array([1, 0.01, 0.01]) / np.sqrt(1.0002)
    bsdf = normal_map(grazing, WHITE, use_shadowing_function=shadowed)
    value = numbers(bsdf.eval(context(), interaction(UP[0]), mi.Vector3f(*grazing), True))
    np.testing.assert_allclose(value, 0 if shadowed else 1 / np.pi, atol=1e-2)


@pytest.mark.usefixtures("llvm_rgb")
def test_samples_under_bumps_have_their_density():
    """As test_bumpmap (of the version after 3.9): ``sample`` and ``pdf`` see the same bumps."""
    bsdf = bumpmap(np.arange(64).reshape(8, 8) % 5 / 4, METAL | {"alpha": 0.2}, scale=0.2)
    u, wi = lattice(8, 1), hemisphere(4096, 1, 0.2)
    wo, pdf, *_, weight = call(bsdf.sample, context(), wi, u[:, :1], u[:, 1:])
    valid = (weight > 0).any(axis=1)
    value, density = call(bsdf.eval_pdf, context(), wi[valid], wo[valid])
    assert valid.mean() > 0.5
    np.testing.assert_allclose(density, pdf[valid], rtol=1e-3)
    np.testing.assert_allclose(value, weight[valid] * pdf[valid], rtol=1e-3)
