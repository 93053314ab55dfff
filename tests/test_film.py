"""Thin films: spectra and colours, limits, derivatives, and what a fit finds."""

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import reference as ref
from support import call, direction, hemisphere, interaction, numbers, observed, per_lane

from mi_brdfs.fit import fit
from mi_brdfs.testing import assert_bsdf

COUNT = 400
BASES = {
    "glass": ({"int_ior": 1.5, "ext_ior": 1.0}, 1.5),
    "water in oil": ({"int_ior": 1.33, "ext_ior": 1.47}, 1.33),
    "air in glass": ({"int_ior": 1.0, "ext_ior": 1.5}, 1.0),
    "silver": ({"eta": 0.05, "k": 4.0}, 0.05 - 4j),
    "chrome": ({"eta": 3.2, "k": 3.3}, 3.2 - 3.3j),
    "germanium": ({"eta": 4.5, "k": 1.5}, 4.5 - 1.5j),
}
"""Dicts, and the index."""


def directions(count, seed=1):
    """Pairs of them, every other one those of a mirror, down to 89.9°; and the cosine to the half vector."""
    wi, wo = hemisphere(count, seed, 2e-3), hemisphere(count, seed + 100, 2e-3)
    wo[::2] = wi[::2] * np.float32([-1, -1, 1])
    i, o = (w.astype(np.float64) / np.linalg.norm(w.astype(np.float64), axis=1, keepdims=True) for w in (wi, wo))
    return wi, wo, np.linalg.norm(i + o, axis=1) / 2


def reflectances(given, wi, wo, wavelengths=None):
    """F of facets, of shape (lanes, channels): what ``eval`` returns over the same with F = 1."""
    si = interaction(wi) if wavelengths is None else interaction(wi, wavelengths=wavelengths)

    def evaluated(**fresnel):
        bsdf = mi.load_dict({"type": "walter", "alpha": 0.5, **fresnel})
        return numbers(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(wo.T), True), len(wi))

    return evaluated(**given) / evaluated()


def textures(**values):
    """Textures with a value for each lane."""
    lanes = {}
    for name, value in values.items():
        lanes[name] = per_lane()
        lanes[name].value = mi.Float(value)
    return lanes


def drawn(count, least=1.0, seed=1):
    """Indices of films and thicknesses, as float32 has them."""
    rng = np.random.default_rng(seed)
    index = rng.uniform(least, rng.choice([2.0, 4.0], count), count)
    thickness = rng.choice([1, 0.3], count) * rng.uniform(0, 2000, count)
    return index.astype(np.float32).astype(float), thickness.astype(np.float32).astype(float)


@pytest.mark.parametrize("name", BASES)
def test_spectra_are_those_of_characteristic_matrices(name):
    """To 1e-4, of films of all thicknesses and indices."""
    given, base = BASES[name]
    exterior = given.get("ext_ior", 1.0)
    wi, wo, cos = directions(4000)
    index, thickness = drawn(4000, exterior)
    wavelengths = np.random.default_rng(2).uniform(360, 830, (4000, 4)).astype(np.float32)
    with mi.variant_context("llvm_ad_spectral"):
        film = textures(film_ior=index, film_thickness=thickness)
        found = reflectances(given | film, wi, wo, wavelengths)
    cos, index, thickness = cos[:, None], index[:, None], thickness[:, None]
    expected = ref.fresnel_film(cos, exterior, index, base, thickness, wavelengths.astype(float))
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert np.ptp(expected) > 0.3


@pytest.mark.parametrize("material", ["Au", "Cr"])
def test_spectra_of_metals_are_those_of_their_indices(material):
    folder = Path(mi.__file__).parent / "data" / "ior"
    wi, wo, cos = directions(COUNT)
    wavelengths = np.random.default_rng(2).uniform(380, 780, (COUNT, 4)).astype(np.float32)
    with mi.variant_context("llvm_ad_spectral"):
        given = {"material": material, "film_thickness": 350.0, "film_ior": 1.8}
        found = reflectances(given, wi, wo, wavelengths)
        eta, k = (
            np.interp(wavelengths, *mi.spectrum_from_file(str(folder / f"{material}.{n}.spd"))) for n in ("eta", "k")
        )
    expected = ref.fresnel_film(cos[:, None], 1.0, 1.8, eta - 1j * k, 350.0, wavelengths.astype(float))
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("name", BASES)
def test_colours_are_those_of_all_wavelengths(name):
    """To 1 % of each channel, or 3e-5 of white, of films of all thicknesses and indices; what is outside sRGB is
    limited to it. And so is the luminance, in the variant of one channel."""
    given, base = BASES[name]
    exterior = given.get("ext_ior", 1.0)
    wi, wo, cos = directions(COUNT)
    index, thickness = drawn(COUNT, exterior)
    wavelengths, weights = observed()
    each = zip(cos, index, thickness, strict=True)
    colours = np.array([ref.fresnel_film(c, exterior, n, base, d, wavelengths) @ weights for c, n, d in each])
    for variant, mixed in (("llvm_ad_rgb", np.eye(3)), ("llvm_ad_mono", [[0.212671], [0.715160], [0.072169]])):
        with mi.variant_context(variant):
            found = reflectances(given | textures(film_ior=index, film_thickness=thickness), wi, wo)
        np.testing.assert_allclose(found, np.clip(colours @ mixed, 0, 1), rtol=0.01, atol=3e-5)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", BASES)
def test_what_is_no_film_is_the_bare_surface(name):
    """No thickness, or the index of the exterior or, where that is larger, of the dielectric; a lower index than the
    exterior's is taken for it."""
    given, base = BASES[name]
    exterior = given.get("ext_ior", 1.0)
    wi, wo, _ = directions(COUNT)
    expected = reflectances(given, wi, wo)
    films = [(0, 1.7), (1e-4, 2.0), (700, exterior), (300, 1.0)]
    for thickness, index in [*films, (500, base)] if given.get("int_ior", 0) > exterior else films:
        found = reflectances(given | {"film_thickness": float(thickness), "film_ior": float(index)}, wi, wo)
        np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_what_reflects_all_does_so_under_a_film():
    wi, wo, cos = directions(COUNT)
    film = {"film_thickness": 400.0, "film_ior": 2.0}
    found = reflectances(BASES["air in glass"][0] | film, wi, wo)
    total = 1 - cos**2 > 1.001 / 1.5**2
    assert 0.2 < total.mean() < 0.8
    np.testing.assert_allclose(found[total], 1, atol=1e-6)
    assert (found[~total].max(axis=1) < 1).mean() > 0.95
    for none in {"material": "none"}, {}:
        np.testing.assert_array_equal(reflectances(none | film, wi, wo), 1)


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral"])
def test_scalar_variants_agree(variant):
    wi, wo, _ = directions(20)
    given = {"type": "microfacet", "alpha": 0.3, "material": "Al", "film_thickness": 500.0, "multiscatter": "walk"}
    values = []
    for each in variant, "llvm_ad_" + variant.partition("_")[2]:
        with mi.variant_context(each):
            values.append(call(mi.load_dict(given).eval, mi.BSDFContext(), wi, wo)[0])
    np.testing.assert_allclose(*values, rtol=1e-4, atol=1e-7)


# --- Derivatives and fits ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_spectral"])
@pytest.mark.parametrize("name", ["glass", "chrome"])
def test_derivatives_are_those_of_differences(name, variant):
    """For the thickness and the index of the film, at all thicknesses, and at the ends of both ranges: without a film
    and with one of the exterior's index. Where they vanish, over glass without a film and below the exterior's index,
    they are others, with which an optimisation leaves it."""
    wi, wo = np.float32([direction(40, 20)]), np.float32([direction(55, 170)])
    with mi.variant_context(variant):

        def slopes(film, key, step, sides=(-1, 1)):
            """That of automatic differentiation, and that of differences, by channel."""

            def loaded(value):
                return mi.load_dict({"type": "walter", "alpha": 0.5, **BASES[name][0], **film, key: value})

            def evaluated(bsdf):
                return bsdf.eval(mi.BSDFContext(), interaction(wi), mi.Vector3f(wo.T), True)

            lower, upper = (numbers(evaluated(loaded(film[key] + sign * step)), 1)[0] for sign in sides)
            bsdf = loaded(film[key])
            params = mi.traverse(bsdf)
            dr.enable_grad(params[f"{key}.value"])
            params.update()
            dr.set_grad(params[f"{key}.value"], 1)
            return numbers(dr.forward_to(evaluated(bsdf)), 1)[0], (upper - lower) / (step * (sides[1] - sides[0]))

        for thickness in 30.0, 150.0, 420.0, 1500.0:
            film = {"film_thickness": thickness, "film_ior": 1.8}
            for key, step in ("film_thickness", 1.0), ("film_ior", 1e-3 if thickness < 1000 else 2e-4):
                found, expected = slopes(film, key, step)
                np.testing.assert_allclose(found, expected, rtol=5e-3, atol=5e-3 * abs(expected).max())
        of_exterior, none = {"film_thickness": 420.0, "film_ior": 1.0}, {"film_thickness": 0.0, "film_ior": 1.8}
        for film, key, step, vanishes in (
            (of_exterior, "film_ior", 1e-3, False),
            (of_exterior | {"ext_ior": 1.1} if name == "glass" else of_exterior, "film_ior", 1e-3, name == "glass"),
            (none, "film_thickness", 0.2, name == "glass"),
        ):
            found, expected = slopes(film, key, step, sides=(0, 1))
            assert abs(found).max() > 1e-5
            if not vanishes:
                np.testing.assert_allclose(found, expected, atol=0.02 * abs(expected).max())


PLANTED = [
    ({"int_ior": 1.5}, {"int_ior": 1.5}, {"film_thickness": 380.0, "film_ior": 2.0}),
    ({"int_ior": 1.52}, {"fresnel": "dielectric"}, {"film_thickness": 412.0, "film_ior": 1.9}),
    ({"int_ior": 1.8}, {"fresnel": "dielectric"}, {"film_thickness": 600.0, "film_ior": 1.33}),
    ({"material": "Cr"}, {"material": "Cr"}, {"film_thickness": 700.0, "film_ior": 1.33}),
]


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(("base", "known", "film"), PLANTED)
def test_fits_recover_a_thickness(base, known, film):
    """Also on a dielectric whose index is sought, too."""
    wi, wo = hemisphere(1500, 3, 0.2), hemisphere(1500, 4, 0.2)
    wo = wi * np.float32([-1, -1, 1]) + 0.15 * wo
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    truth = {"type": "walter", "alpha": 0.2, **base, **film}
    f = call(mi.load_dict(truth).eval, mi.BSDFContext(), wi, wo)[0] / wo[:, 2:]
    given = {"specular_reflectance": 1.0, "diffuse_reflectance": None, **known, **film, "film_thickness": "free"}
    best, *_ = fit((wi, wo, f), "walter", given=given)
    np.testing.assert_allclose(best.bsdf["film_thickness"], film["film_thickness"], rtol=2e-3)
    np.testing.assert_allclose(best.bsdf["alpha"], 0.2, rtol=2e-3)


GTR = {"type": "microfacet", "distribution": "gtr", "gamma": 1.5, "shadowing": "vcavity", "material": "Ag"}


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("given", [
    {**GTR, "film_thickness": 150.0, "film_ior": 2.5},
    {"type": "cooktorrance", "int_ior": 1.0, "ext_ior": 1.5, "film_thickness": 2000.0, "film_ior": 4.0},
    {"type": "walter", "alpha": 0.7, "int_ior": 2.0, "film_thickness": 300.0, "multiscatter": "walk"},
])  # fmt: skip
def test_a_checker_finds_nothing(given):
    """Of what the kernels of values show: others take long to compile, of multiple reflections minutes."""
    checks = ["finite", "support", "eval_pdf", "reciprocity", "weight", "pdf", "chi2", "albedo"]
    assert_bsdf(given, only=checks, angles=60)


def test_a_checker_finds_nothing_in_derivatives():
    """Nor in what else has kernels of its own, which compile faster with one channel."""
    film = {"film_thickness": 450.0, "film_ior": 1.33}
    checks = ["gradients", "active", "continuity", "textures", "updates", "recompiles", "mode"]
    with mi.variant_context("llvm_ad_mono"):
        assert_bsdf({"type": "walter", "alpha": 0.3, "int_ior": 1.5, **film}, only=checks, angles=60)
