"""Mueller matrices: those of Mitsuba's conductors, those of Fresnel's equations, and of what depolarises."""

import itertools

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import reference as ref
import scipy.stats
from generate import polarization
from support import call, direction, hemisphere, interaction, is_scalar, near_mirror, numbers, observed, unit

from mi_brdfs.lobes import WeightedLobe
from mi_brdfs.probe.arrays import WAVELENGTHS
from mi_brdfs.testing import assert_bsdf

IN_LLVM = "llvm_ad_spectral_polarized"
MODES = [mi.TransportMode.Radiance, mi.TransportMode.Importance]
PAULI = np.array([[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]]])
"""With fields ∝ exp(iωt), E†σE are the Stokes parameters; the last one is that of right circular light."""
SWAP = np.array([1, 1, -1, 1])
"""The signs of the Stokes parameters of light that goes back."""


@pytest.fixture
def polarized():
    with mi.variant_context(IN_LLVM):
        yield


def directions(count, seed=1):
    """Pairs of them, every other one near that of a mirror."""
    wi = hemisphere(count, seed)
    return wi, near_mirror(wi, hemisphere(count, seed + 100), 0.1)


def context(mode):
    return mi.BSDFContext(mode)


def elements(matrix, count):
    """Those of a Mueller matrix, shape (count, channels, 4, 4)."""
    dr.eval(matrix)  # in one kernel
    rows = [[numbers(mi.UnpolarizedSpectrum(matrix[i, j]), count) for j in range(4)] for i in range(4)]
    return np.moveaxis(np.array(rows, np.float64), (0, 1), (-2, -1))


def matrices(bsdf, wi, wo, mode=MODES[0]):
    """What ``eval`` returns for arrays of directions."""
    bsdf = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf

    def once(wi, wo):
        return elements(bsdf.eval(context(mode), interaction(wi), mi.Vector3f(wo.T), True), len(np.atleast_2d(wi)))

    return np.concatenate([once(i, o) for i, o in zip(wi, wo, strict=True)]) if is_scalar() else once(wi, wo)


def in_parts_of_the_intensity(found, expected):
    """The largest difference of each element from the other one's."""
    return abs(found - expected).max(axis=(-2, -1)) / expected[..., 0, 0]


# --- Mitsuba's conductors --------------------------------------------------------------------------------------------

CONDUCTORS = {
    "gold": {"material": "Au", "alpha": 0.3},
    "brushed": {"eta": 1.5, "k": 2.0, "alpha_u": 0.05, "alpha_v": 0.5, "specular_reflectance": 0.7},
    "thin": {"eta": 0.3, "k": 0.1, "alpha": 0.6},
    "semiconductor": {"eta": 3.0, "k": 0.01, "alpha": 0.6},
}
GGX = {"type": "walter"}, {"type": "roughconductor", "distribution": "ggx"}
EXACT = {"type": "microfacet"}, {"type": "roughconductor", "distribution": "beckmann"}
BECKMANN = EXACT[0] | {"shadowing": "smith-rational"}, EXACT[1]


@pytest.mark.parametrize("variant", [IN_LLVM, "scalar_spectral_polarized"])
@pytest.mark.parametrize("mode", MODES, ids=["radiance", "importance"])
def test_all_elements_are_those_of_roughconductor(mode, variant):
    """To 1e-4 of the intensity. The exact shadowing of Beckmann's facets differs from the approximated one by up to
    .7 %: a factor that all elements have."""
    with mi.variant_context(variant):
        wi, wo = directions(16 if is_scalar() else 4000)
        for name, given in CONDUCTORS.items():
            for ours, theirs in (GGX, BECKMANN, EXACT):
                found, expected = (matrices(bsdf | given, wi, wo, mode) for bsdf in (ours, theirs))
                lit = expected[..., 0, 0] > 1e-12
                assert lit.mean() > 0.4
                found, expected = found[lit], expected[lit]
                if ours is EXACT[0]:
                    ratio = found[:, 0, 0] / expected[:, 0, 0]
                    np.testing.assert_allclose(ratio, 1, rtol=7e-3)
                    found = found / ratio[:, None, None]
                assert in_parts_of_the_intensity(found, expected).max() < 1e-4
                if name != "semiconductor":  # which leaves linear light linear
                    assert (abs(expected[:, 1:, 1:]).max(axis=0) > 0.01 * expected[:, 0, 0].max()).all()


# --- Fresnel's equations ----------------------------------------------------------------------------------------------


def first_axes(forward):
    """Those of Mitsuba's Stokes vectors: T. Duff et al., Building an orthonormal basis, revisited, Journal of Computer
    Graphics Techniques 6(1), 2017."""
    x, y, z = forward.T
    sign = np.copysign(1, z)
    a = -1 / (sign + z)
    return np.stack([1 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1)


def surface(index):
    """The amplitudes of s and p that a smooth surface reflects, as a function of the cosine."""

    def amplitudes(cos):
        refracted = np.sqrt(1 - (1 - cos**2) / complex(index) ** 2)
        refracted = np.where(refracted.imag > 0, -refracted, refracted)  # it decays inside
        s_wave = (cos - index * refracted) / (cos + index * refracted)
        return s_wave, (index * cos - refracted) / (index * cos + refracted)

    return amplitudes


def of_facets(wi, wo, amplitudes):
    """The Mueller matrices of facets, from what they make of electric fields."""
    towards, away = -unit(wo), unit(wi)
    h = unit(away - towards)
    cos = (h * away).sum(axis=1)
    s = unit(np.cross(h, away))

    def axes(forward):
        x = first_axes(forward)
        waves = np.stack([s, np.cross(forward, s)], axis=1)
        return waves @ np.stack([x, np.cross(forward, x)], axis=2)

    scales = np.stack(amplitudes(cos), axis=-1)[:, :, None]
    jones = axes(away).swapaxes(-1, -2) @ (scales * axes(towards))
    traces = np.einsum("aij,njk,bkl,nil->nab", PAULI, jones, PAULI, jones.conj()) / 2
    assert abs(traces.imag).max() < 1e-12
    return traces.real


def for_their_own_light(matrix):
    """That of facets with F = 1."""
    return matrix / matrix[..., :1, :1]


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("eta", [1.0003, 1.33, 1.5, 2.4, 40.0, 0.95, 0.66, 0.3, 0.03])
def test_dielectrics_obey_fresnel(eta):
    """To 1e-4 of the intensity, from outside and from inside, where all may be reflected; but not at the very critical
    angle, about which the phase goes as the root of float32's error."""
    wi, wo = directions(4000)
    found = matrices({"type": "walter", "int_ior": eta, "ext_ior": 1.0, "alpha": 0.5}, wi, wo)[:, 0]
    sin2 = 1 - (1 + (wi * wo).sum(axis=1)) / 2
    checked = abs(eta**2 - sin2) > 2e-3
    assert checked.mean() > 0.95
    found, expected = for_their_own_light(found), for_their_own_light(of_facets(wi, wo, surface(eta)))
    assert in_parts_of_the_intensity(found, expected)[checked].max() < 1e-4
    total = (sin2 > eta**2) & checked
    if eta in (0.66, 0.3, 0.03):
        assert total.mean() > 0.1
        assert abs(found[total, 3, 1:3]).max() > 0.5 * (eta > 0.1)  # it turns linear light to elliptic


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("index", [0.2 - 3j, 1.5 - 2j, 5 - 40j, 3 - 1e-3j, 0.01 - 100j])
def test_conductors_obey_fresnel(index):
    wi, wo = directions(4000)
    given = {"type": "microfacet", "eta": index.real, "k": -index.imag, "alpha": 0.5}
    found = matrices(given | {"shadowing": "vcavity", "distribution": "ggx"}, wi, wo)[:, 0]
    expected = for_their_own_light(of_facets(wi, wo, surface(index)))
    assert in_parts_of_the_intensity(for_their_own_light(found), expected).max() < 1e-4


FILMS = {
    "soap": ({"int_ior": 1.0, "ext_ior": 1.0}, 1.0, 1.33, 400.0),
    "coated glass": ({"int_ior": 1.5, "ext_ior": 1.0}, 1.5, 2.3, 700.0),
    "from inside": ({"int_ior": 1.0, "ext_ior": 1.5}, 1.0, 1.8, 300.0),
    "silver": ({"eta": 0.05, "k": 4.0}, 0.05 - 4j, 1.5, 250.0),
    "chrome": ({"eta": 3.2, "k": 3.3}, 3.2 - 3.3j, 1.4, 1500.0),
}
"""Dicts, the index of what is below, and that of the film with its thickness."""


@pytest.mark.parametrize("name", FILMS)
def test_films_do_to_fields_what_characteristic_matrices_say(name):
    """All elements, to 2e-4 of the intensity that F = 1 reflects, at each wavelength; and in variants without, in the
    mean over all of them, to .003."""
    given, base, index, thickness = FILMS[name]
    wi, wo = directions(400)
    wavelengths, weights = observed()
    luminance = weights @ [0.212671, 0.715160, 0.072169]
    film = {"type": "walter", "alpha": 0.5, "film_thickness": thickness, "film_ior": index, **given}

    def expected(wavelength):
        media = given.get("ext_ior", 1.0), index, base, thickness, wavelength
        return of_facets(wi, wo, lambda cos: ref.film_amplitudes(cos, *media))

    found = {}
    for variant in IN_LLVM, "llvm_ad_mono_polarized":
        with mi.variant_context(variant):
            unit = matrices({"type": "walter", "alpha": 0.5}, wi, wo)[..., :1, :1]
            found[variant] = matrices(film, wi, wo) / unit
    for channel, wavelength in enumerate(WAVELENGTHS):
        assert abs(found[IN_LLVM][:, channel] - expected(wavelength)).max() < 2e-4
        assert abs(found[IN_LLVM][:, channel, 1:, 1:]).max(axis=0).min() > 0.02
    some = slice(None, None, 8)
    mean = sum(w * expected(wavelength) for w, wavelength in zip(luminance[some], wavelengths[some], strict=True))
    assert abs(found["llvm_ad_mono_polarized"][:, 0] - mean / luminance[some].sum()).max() < 3e-3


SAME = {
    "conductor": {"type": "walter", "eta": 1.2, "k": 3.0, "alpha": 0.3},
    "narrow": {"type": "walter", "eta": 1.2, "k": 3.0, "alpha": 1e-3},
    "glass": {"type": "microfacet", "int_ior": 1.5, "alpha": 0.2, "diffuse_reflectance": 0.3},
    "next to nothing": {"type": "walter", "int_ior": 1.0001, "ext_ior": 1.0, "alpha": 0.5},
    "from inside": {"type": "cooktorrance", "int_ior": 1.0, "ext_ior": 2.0, "alpha": 0.5},
    "turquin": {"type": "walter", "eta": 1.2, "k": 3.0, "alpha": 0.9, "multiscatter": "turquin"},
    "film": {"type": "walter", "eta": 3.0, "k": 3.0, "alpha": 0.3, "film_thickness": 300.0},
}


@pytest.mark.parametrize("mode", MODES, ids=["radiance", "importance"])
def test_the_intensity_is_that_of_unpolarized_variants(mode):
    """But for rounding: of what both compute from f of the exchanged directions, and of the sum of lobes. That of the
    exchanged directions moves a narrow lobe's half vector by 1e-7, about 1e-4 of its width."""
    wi, wo = directions(2000)
    wi[:200] = unit(hemisphere(2000, 5, 0)[:200] * [1, 1, 1e-4])
    u, v = np.random.default_rng(1).random((2000, 1)), np.random.default_rng(2).random((2000, 2))
    for name, given in SAME.items():
        results = []
        for variant in "llvm_ad_mono", "llvm_ad_mono_polarized":
            with mi.variant_context(variant):
                value, pdf, wo_drawn, density, weight = call(
                    mi.load_dict(given).eval_pdf_sample, context(mode), wi, wo, u, v
                )
                results.append((value, pdf, wo_drawn, density, weight))
        for plain, ours in zip(*results, strict=True):
            rtol = 2e-3 if name == "narrow" and mode == MODES[1] else 5e-6
            np.testing.assert_allclose(ours, plain, rtol=rtol, atol=1e-6 * np.median(abs(plain)), err_msg=name)


WORDS = {"retroreflectivity": 0.4}, {"haze": 0.5}, {"multiscatter": "walk"}, {"multiscatter": "turquin"}


@pytest.mark.parametrize("words", [*WORDS, WORDS[0] | WORDS[3]], ids=" ".join)
def test_the_colour_of_gold_is_that_of_unpolarized_variants(words):
    """But for rounding, as above: also of the light that a word depolarises."""
    wi, wo = directions(2000)
    values = []
    for variant in "llvm_ad_spectral", IN_LLVM:
        with mi.variant_context(variant):
            gold = mi.load_dict({"type": "walter", "material": "Au", "alpha": 0.5} | words)
            values.append(call(gold.eval, context(MODES[0]), wi, wo)[0])
    assert (np.ptp(values[0], axis=1) > 0.1 * values[0].max(axis=1)).mean() > 0.9
    np.testing.assert_allclose(*reversed(values), rtol=5e-6, atol=1e-6 * np.median(values[0]))


# --- Frames -----------------------------------------------------------------------------------------------------------

METAL = {"type": "microfacet", "distribution": "ggx", "eta": 1.5, "k": 2.0}


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("mode", MODES, ids=["radiance", "importance"])
def test_rotation_turns_facets_and_not_the_frames_of_light(mode):
    wi, wo = directions(2000)
    round_facets, brushed = METAL | {"alpha": 0.3}, METAL | {"alpha_u": 0.2, "alpha_v": 0.5}
    turned = METAL | {"alpha_u": 0.5, "alpha_v": 0.2, "rotation": 0.25}
    for plain, other in ((round_facets, round_facets | {"rotation": 0.1}), (brushed, turned)):
        found, expected = (matrices(bsdf, wi, wo, mode) for bsdf in (other, plain))
        assert in_parts_of_the_intensity(found, expected).max() < 1e-4


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("words", [{}, {"diffuse_reflectance": 0.2}, *WORDS, WORDS[0] | WORDS[3]], ids=" ".join)
def test_light_goes_the_other_way_in_light_tracing(words):
    """There f of exchanged directions is wanted: from wi to wo, also of what is not reciprocal."""
    wi, wo = directions(2000)
    bsdf = METAL | {"alpha_u": 0.2, "alpha_v": 0.5} | words
    found = matrices(bsdf, wi, wo, MODES[1]) / wo[:, 2, None, None, None]
    expected = matrices(bsdf, wo, wi) / wi[:, 2, None, None, None]
    assert in_parts_of_the_intensity(found, expected).max() < 1e-5
    if words.get("multiscatter") != "turquin":
        back = matrices(bsdf, wi, wo).swapaxes(-1, -2) * SWAP * SWAP[:, None] / wo[:, 2, None, None, None]
        assert in_parts_of_the_intensity(found, back).max() < 1e-4


@pytest.mark.usefixtures("polarized")
def test_light_that_goes_straight_back():
    """At wi = wo any axis is s: what is polarized along an axis stays so, and mirrors turn the sense of a circle."""
    wi = np.float32([direction(theta, phi) for theta in (0, 1e-5, 40, 89) for phi in (0, 50, 250)])
    wo = wi + 1e-7 * hemisphere(len(wi), 3)
    for towards in wi, wo.astype(np.float32):
        found = matrices({"type": "walter", "eta": 1.5, "k": 2.0, "alpha": 1.0, "rotation": 0.2}, wi, towards)
        expected = found[..., :1, :1] * np.diag([1, 1, -1, -1])
        assert in_parts_of_the_intensity(found, expected).max() < 1e-5


@pytest.mark.usefixtures("polarized")
def test_weights_are_matrices_over_the_density():
    """Also where diffuse and turned lobes share the samples, and for the values of all methods."""
    bsdf = mi.load_dict(METAL | {"alpha_u": 0.1, "alpha_v": 0.5, "rotation": 0.1, "diffuse_reflectance": 0.2})
    si, ctx = interaction(hemisphere(500, 1)), mi.BSDFContext()
    rng = np.random.default_rng(1)
    u, v = mi.Float(rng.random(500)), mi.Point2f(rng.random((2, 500)))
    bs, weight = bsdf.sample(ctx, si, u, v, True)
    value, pdf, _, again = bsdf.eval_pdf_sample(ctx, si, bs.wo, u, v, True)
    drawn = np.array(pdf) > 0
    assert drawn.mean() > 0.95
    expected = (elements(value, 500)[drawn].T / np.array(pdf)[drawn]).T
    assert (abs(expected[:, :, 1:, 1:]).max(axis=(0, 1)) > 0.1).all()
    for found in elements(weight, 500), elements(again, 500):
        assert in_parts_of_the_intensity(found[drawn], expected).max() < 1e-5
        assert not found[~drawn].any()
    for matrix in bsdf.eval(ctx, si, bs.wo, True), bsdf.eval_pdf(ctx, si, bs.wo, True)[0]:
        np.testing.assert_array_equal(elements(matrix, 500), elements(value, 500))


# --- What depolarises -------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("polarized")
def test_the_others_depolarise():
    """Facets without indices, and lobes without facets. Those of all models, test_variants has."""
    without_facets = {"type": "burley", "clearcoat": 1.0}, {"type": "nishino", "variant": "dsbrdf"}
    for given in {"type": "walter"}, {"type": "walter", "f0": 0.5}, *without_facets:
        for mode in MODES:
            found = matrices(given, *directions(200), mode)
            assert (found[..., 0, 0] > 0).any()
            assert np.count_nonzero(found) == np.count_nonzero(found[..., 0, 0])


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("way", ["walk", "kulla-conty", "turquin"])
def test_compensation_adds_unpolarized_light(way):
    wi, wo = directions(500)
    # Walk takes the other term of GGX's facets, and so more than adds.
    bsdf = METAL | ({"alpha": 1.5, "distribution": "beckmann"} if way == "walk" else {"alpha": 0.9})
    plain, found = matrices(bsdf, wi, wo), matrices(bsdf | {"multiscatter": way}, wi, wo)
    added = found - plain
    assert (added[..., 0, 0] > 0.01 * plain[..., 0, 0]).all()
    added[..., 0, 0] = 0
    assert (abs(added).max(axis=(-2, -1)) < 1e-6 * found[..., 0, 0]).all()


@pytest.mark.usefixtures("polarized")
def test_a_diffuse_lobe_adds_its_own():
    wi, wo = directions(500)
    bsdf, diffuse = METAL | {"alpha": 0.3}, {"type": "lambert", "reflectance": 0.2}
    found = matrices(bsdf | {"diffuse_reflectance": 0.2}, wi, wo)
    expected = matrices(bsdf, wi, wo) + matrices(diffuse, wi, wo)
    assert in_parts_of_the_intensity(found, expected).max() < 1e-6


@pytest.mark.usefixtures("polarized")
def test_a_weight_scales_the_whole_matrix():
    """That of a colour scales each channel's."""
    model = mi.load_dict(METAL | {"alpha": 0.3}).model
    si = interaction(hemisphere(50, 1))
    (lobe,) = model.lobes(model.evaluate(si, True))
    wo = mi.Vector3f(hemisphere(50, 2).T)
    axes = [mi.mueller.stokes_basis(w) for w in (si.wi, wo)]
    weighted = WeightedLobe(
        lobe, lambda wi, wo: mi.UnpolarizedSpectrum(0.1, 0.2, 0.3, 0.4) * wi.z * wo.z, lambda wi: wi.z
    )
    found, plain = (elements(it.mueller_pdf(si.wi, wo, *axes)[0], 50) for it in (weighted, lobe))
    scale = np.array(si.wi.z * wo.z)[:, None] * [0.1, 0.2, 0.3, 0.4]
    np.testing.assert_allclose(found, plain * scale[..., None, None], rtol=1e-5, atol=1e-9)


# --- The laws, derivatives and pictures -------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("given", [
    METAL | {"alpha_u": 0.1, "alpha_v": 0.5, "rotation": 0.1},
    {"type": "walter", "int_ior": 1.5, "alpha": 0.3}, {"type": "walter", "int_ior": 1.0, "ext_ior": 2.0, "alpha": 0.3},
    {"type": "cooktorrance", "material": "Cu", "diffuse_reflectance": 0.1}, {"type": "nishino", "material": "Al"},
    METAL | {"alpha": 0.9, "multiscatter": "walk"}, METAL | {"alpha": 0.9, "multiscatter": "turquin"},
    {"type": "microfacet", "eta": 0.01, "k": 0.0, "alpha": 0.3},
    {"type": "walter", "eta": 3.0, "k": 3.0, "alpha": 0.3, "film_thickness": 500.0},
], ids=str)  # fmt: skip
def test_matrices_are_physical(given):
    assert_bsdf(given, only="polarization")


EXTREMES = {
    "conductor": {"eta": [0.01, 0.3, 1.0, 3.0, 100.0], "k": [0.0, 1e-3, 1.0, 100.0]},
    "dielectric": {"int_ior": [0.01, 0.5, 1.0, 1.5, 100.0], "ext_ior": [1.0]},
    "film": {"film_thickness": [0.0, 300.0, 2000.0], "film_ior": [1.0, 4.0], "int_ior": [1.5]},
}


@pytest.mark.usefixtures("polarized")
@pytest.mark.parametrize("kind", EXTREMES)
def test_derivatives_are_finite(kind):
    """Of all elements for all parameters and both directions, at limits, at grazing and critical angles and where a
    direction or a frame is at its singularity."""
    names = list(EXTREMES[kind])
    angles = [(0, 0), (0, 90), (30, 0), (45, 180), (60, 45), (89.9, 0), (89.9, 180)]
    some = np.float32([direction(*angle) for angle in angles])
    wi, wo = (np.repeat(some, len(some), axis=0), np.tile(some, (len(some), 1)))
    for values in itertools.product(*EXTREMES[kind].values()):
        bsdf = mi.load_dict({"type": "walter", **dict(zip(names, values, strict=True)), "rotation": 0.1})
        params = mi.traverse(bsdf)
        keys = [key for key in params.keys() if key.endswith(".value")]
        for key in keys:
            dr.enable_grad(params[key])
        params.update()
        si, towards = interaction(wi), mi.Vector3f(wo.T)
        dr.enable_grad(si.wi, towards)
        matrix = bsdf.eval(mi.BSDFContext(), si, towards, True)
        assert np.isfinite(elements(matrix, len(wi))).all()
        dr.backward(sum(dr.sum(matrix[i, j], axis=None) for i in range(4) for j in range(4)))
        for inputs in si.wi, towards, *(params[key] for key in keys):
            assert np.isfinite(np.array(dr.grad(inputs))).all()


@pytest.mark.usefixtures("polarized")
def test_derivatives_are_those_of_differences():
    """Of each element, for the index and the direction."""
    wi, wo = np.float32([direction(40, 20)]), np.float32([direction(55, 170)])
    step = 1e-3
    for given, name in (("conductor", "eta"), ("conductor", "k"), ("glass", "int_ior"), ("total", "ext_ior")):
        bsdf = {"conductor": METAL, "glass": {"type": "microfacet", "int_ior": 1.5, "ext_ior": 1.0},
                "total": {"type": "microfacet", "int_ior": 1.0, "ext_ior": 2.5}}[given] | {"alpha": 0.5}  # fmt: skip
        lower, upper = (matrices(bsdf | {name: bsdf[name] + sign * step}, wi, wo)[0, 0] for sign in (-1, 1))
        loaded = mi.load_dict(bsdf)
        params = mi.traverse(loaded)
        dr.enable_grad(params[f"{name}.value"])
        params.update()
        dr.set_grad(params[f"{name}.value"], 1)
        matrix = loaded.eval(mi.BSDFContext(), interaction(wi), mi.Vector3f(wo.T), True)
        dr.forward_to(matrix)
        slopes = np.array([[dr.grad(matrix[i, j])[0][0] for j in range(4)] for i in range(4)])
        scale = abs(upper - lower).max() / (2 * step)
        np.testing.assert_allclose(slopes, (upper - lower) / (2 * step), atol=2e-3 * scale)


def stokes(bsdf, offset):
    """32 renders of a sphere and a floor of metal, which light each other: shape (32, 12, 12, 4)."""
    T = mi.ScalarTransform4f
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "stokes", "nested": {"type": "path", "max_depth": 4}},
            "sensor": {
                "type": "perspective",
                "fov": 35,
                "to_world": T().look_at([0, -4, 1.2], [0, 0, -0.2], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": 12, "height": 12, "rfilter": {"type": "box"},
                         "pixel_format": "luminance"},
            },
            "sphere": {"type": "sphere", "bsdf": bsdf},
            "floor": {"type": "rectangle", "to_world": T().translate([0, 0, -1]).scale(5), "bsdf": bsdf},
            "key": {"type": "point", "position": [3, -3, 3], "intensity": 20.0},
            "sky": {"type": "constant", "radiance": 0.5},
        }
    )  # fmt: skip
    images = [np.array(mi.render(scene, spp=32, seed=seed + offset), np.float64) for seed in range(32)]
    return np.array(images)[..., -4:]


def test_stokes_pictures_are_those_of_roughconductor():
    """Per-pixel two-sample t-tests of all four parameters, over 32 renders each, at 1 % for the whole picture; and what
    noise leaves of the others than the intensity is far above it."""
    with mi.variant_context("llvm_ad_mono_polarized"):
        given = {"eta": 1.5, "k": 2.0, "alpha": 0.3}
        ours, theirs = (stokes(bsdf | given, offset) for bsdf, offset in zip(GGX, (0, 1000), strict=True))
    varies = (ours.std(axis=0) > 1e-6) | (theirs.std(axis=0) > 1e-6)
    assert varies.mean() > 0.8
    _, p = scipy.stats.ttest_ind(ours[:, varies], theirs[:, varies], equal_var=False)
    assert p.min() > 1 - (1 - 0.01) ** (1 / p.size)
    mean, error = theirs.mean(axis=0), theirs.std(axis=0) / np.sqrt(len(theirs))
    for k in range(4):
        assert (abs(mean[..., k]) > 10 * error[..., k]).mean() > 0.1, k


@pytest.mark.usefixtures("llvm_rgb")
def test_what_the_page_says_of_its_picture():
    """Edges aside: glass polarises nearly fully in a ring, chalk not at all, and of all only gold turns the field."""
    s = polarization.stokes(polarization.SCENE, 64, width="120", height="60")
    linear, circular = polarization.polarized(s)
    y, x = np.mgrid[:60, :120]
    for name, middle, least, most in (("glass", 19, 0.9, 1.001), ("chalk", 60, 0, 1e-6), ("gold", 101, 0.6, 0.9)):
        ball = np.hypot(x - middle, y - 26) < 14
        assert least <= linear[ball].max() <= most, name
        assert linear[26, middle] < 0.03, name
        left, right = (circular[ball & side & (y > 26)] for side in (x < middle, x > middle))
        if name == "gold":
            assert left.min() < -0.2 and right.max() > 0.2
        else:
            assert max(abs(left).max(), abs(right).max()) < 0.01, name
    assert linear[-4:].mean() > 1.5 * linear[:4].mean() > 0.3  # the floor: nearer to Brewster's angle below
