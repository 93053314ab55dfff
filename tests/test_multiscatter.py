"""Light that facets reflect more than once: what it adds up to, and what colour it has."""

import functools

import mitsuba as mi
import numpy as np
import pytest
import reference as ref
from random_walk import walk
from support import direction, efficiencies, lattice, observed

from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.testing import assert_bsdf

pytestmark = pytest.mark.usefixtures("llvm_rgb")

ANGLES = 0, 5, 15, 30, 60, 80, 85
ROUGHNESS = {
    "smooth": (0.05, 0.05), "satin": (0.2, 0.2), "rough": (0.5, 0.5), "roughest": (1.0, 1.0),
    "brushed": (0.05, 0.4), "brushed, rough": (1.0, 0.125), "nearly isotropic": (0.53, 0.44),
    "brushed, between nodes": (0.77, 0.53),
}  # fmt: skip
GOLD = {"eta": {"type": "rgb", "value": [0.143, 0.375, 1.44]}, "k": {"type": "rgb", "value": [3.98, 2.39, 1.60]}}
FRESNEL = {
    "f0 .04": ({"f0": 0.04}, lambda c: ref.fresnel_schlick(c, 0.04)[:, None]),
    "f0 .5": ({"f0": 0.5}, lambda c: ref.fresnel_schlick(c, 0.5)[:, None]),
    "f0 .9": ({"f0": 0.9}, lambda c: ref.fresnel_schlick(c, 0.9)[:, None]),
    "F82": ({"f0": 0.9, "f82": 0.5}, lambda c: ref.fresnel_generalized_schlick(c, 0.9, 0.5)[:, None]),
    "exponent 1": ({"f0": 0.3, "schlick_exponent": 1.0}, lambda c: 1 - 0.7 * c[:, None]),
    "film": ({"eta": 2.9, "k": 3.0, "film_thickness": 500.0, "film_ior": 1.5}, lambda c: film(c)),
    "from glass": ({"int_ior": 1.0, "ext_ior": 1.5}, lambda c: ref.fresnel_dielectric(c[:, None], 1 / 1.5)),
    "gold": (GOLD, lambda c: ref.fresnel_conductor(c[:, None], *(np.array(GOLD[n]["value"]) for n in ("eta", "k")))),
}


@functools.cache
def colours_of_a_film():
    cosines, (wavelengths, weights) = np.linspace(1e-3, 1, 500), observed()
    spectra = ref.fresnel_film(cosines[:, None], 1.0, 1.5, 2.9 - 3j, 500.0, wavelengths)
    return cosines, np.clip(spectra @ weights, 0, 1)


def film(cos):
    """The colours of a film on chrome, between those of 500 angles."""
    cosines, colours = colours_of_a_film()
    return np.stack([np.interp(cos, cosines, colour) for colour in colours.T], axis=-1)


def facets(way, alpha, distribution="ggx", shadowing="smith-correlated", **given):
    names = {"alpha": alpha[0]} if alpha[0] == alpha[1] else {"alpha_u": alpha[0], "alpha_v": alpha[1]}
    return {"type": "microfacet", "distribution": distribution, "shadowing": shadowing, "multiscatter": way,
            **names, **given}  # fmt: skip


def albedos(bsdf, angles, azimuth=0):
    """The albedo at some angles, shape (angles, channels): the mean weight of 2^14 points of a lattice."""
    probe = BSDFProbe(mi.load_dict(bsdf))
    wi = np.array([direction(theta, azimuth) for theta in angles])
    return probe.weights(probe.whole, wi, lattice(14, 1)).mean(axis=1)


@pytest.mark.parametrize("shadowing", ["smith", pytest.param("smith-correlated", marks=pytest.mark.slow)])
@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
@pytest.mark.parametrize("name", ROUGHNESS)
def test_nothing_is_lost_in_a_white_furnace(name, distribution, shadowing):
    """Within half a percent at all angles and azimuths, that of the tables."""
    bsdf = facets("walk", ROUGHNESS[name], distribution, shadowing)
    for azimuth in (0, 30, 70, 90) if "brushed" in name else (0,):
        np.testing.assert_allclose(albedos(bsdf, ANGLES, azimuth), 1, atol=5e-3)


@pytest.mark.parametrize("alpha", [0.05, 0.2, 0.5, 1.0])
def test_nor_of_blinns_facets(alpha):
    """At grazing angles rough ones gain light of their own, as their Λ is approximate."""
    bsdf = {"type": "microfacet", "distribution": "blinn", "exponent": 2 / alpha**2 - 2, "multiscatter": "walk"}
    np.testing.assert_allclose(albedos(bsdf, ANGLES if alpha < 0.5 else ANGLES[:5]), 1, atol=5e-3)


@pytest.mark.parametrize("way", ["kulla-conty", "turquin"])
def test_nor_by_the_published_ways(way):
    """That of Turquin scales the lobe by tables that err by half a percent of what is lost, so of up to 70 %."""
    for name in "satin", "roughest", "brushed, rough", "nearly isotropic":
        np.testing.assert_allclose(albedos(facets(way, ROUGHNESS[name]), ANGLES), 1, atol=5e-3)


@pytest.mark.parametrize(
    ("alpha", "distribution", "shadowing"),
    [
        ((0.2, 0.2), "ggx", "smith"),
        ((0.5, 0.5), "ggx", "smith"),
        ((1.0, 1.0), "ggx", "smith"),
        ((0.8, 0.2), "ggx", "smith-correlated"),
        ((0.4, 0.1), "ggx", "smith-correlated"),
        ((0.5, 0.5), "beckmann", "smith-correlated"),
    ],
)
def test_the_colour_is_that_of_a_walk(alpha, distribution, shadowing):
    """The albedo is that of simulated walks, to .005 up to 60° and .02 at 80°, besides three standard errors; to more
    of a film, and of a reflectance that is far from Schlick's, as total reflection is. The azimuth is that of smooth
    facets, which are seen at grazing angles again and again. With either term of Smith's."""
    angles, azimuth, rng = (5, 45, 60, 80), 90, np.random.default_rng(1)

    def every(cos):
        return np.stack([np.broadcast_to(function(cos), (len(cos), 3)) for _, function in FRESNEL.values()], axis=1)

    walks = [walk(distribution, *alpha, direction(theta, azimuth), every, 100_000, rng) for theta in angles]
    for k, (name, (given, _)) in enumerate(FRESNEL.items()):
        looser = {"film": (0.025, 0.03), "exponent 1": (0.02, 0.03), "from glass": (0.14, 0.14)}
        near, far = looser.get(name, (0.005, 0.02))
        ours = albedos(facets("walk", alpha, distribution, shadowing, **given), angles, azimuth)
        for albedo, theta, (energy, error) in zip(ours, angles, walks, strict=True):
            noise = 3 * np.sqrt((error[:, k] ** 2).sum(axis=0))
            wrong = abs(albedo - energy[:, k].sum(axis=0)) > (near if theta <= 60 else far) + noise
            assert not wrong.any(), (name, theta)


@pytest.mark.parametrize(
    ("alpha", "distribution"), [((0.1, 0.1), "beckmann"), ((0.45, 0.45), "ggx"), ((1.0, 0.25), "beckmann")]
)
def test_nor_far_from_it_where_little_is_reflected_or_nearly_all(alpha, distribution):
    """Of tints that nearly vanish at grazing, and of the mean or at one angle alone, and beside an f0 of 1."""
    tints = [(f0, f82, f90) for f0 in (0.0, 0.05, 0.9, 1.0) for f82 in (0.0, 0.5, 1.0) for f90 in (0.0, 1.0)]

    def every(cos):
        return np.stack([ref.fresnel_generalized_schlick(cos, *tint) for tint in tints], axis=1)

    angles, rng = (5, 60, 80), np.random.default_rng(3)
    walks = [walk(distribution, *alpha, direction(theta, 90), every, 50_000, rng) for theta in angles]
    for k, (f0, f82, f90) in enumerate(tints):
        ours = albedos(facets("walk", alpha, distribution, f0=f0, f82=f82, f90=f90), angles, 90)[:, 0]
        for albedo, theta, (energy, error) in zip(ours, angles, walks, strict=True):
            far = (0.01 if f82 < 0.5 else 0.007) if theta <= 60 else 0.013
            noise = 3 * np.sqrt((error[:, k] ** 2).sum())
            assert abs(albedo - energy[:, k].sum()) < far + noise, (f0, f82, f90, theta)


@pytest.mark.parametrize(
    ("given", "fresnel"),
    [
        ({"f0": 0.3, "schlick_exponent": 1.0}, lambda c: 1 - 0.7 * c),
        ({"f0": 0.3, "f82": 0.5}, lambda c: ref.fresnel_generalized_schlick(c, 0.3, 0.5)),
        ({"eta": 0.6, "k": 1.0}, lambda c: ref.fresnel_conductor(c, 0.6, 1.0)),
        *(
            ({"int_ior": 1.0, "ext_ior": index}, lambda c, index=index: ref.fresnel_dielectric(c, 1 / index))
            for index in (1.33, 2.4, 2.74)
        ),
    ],
)
def test_the_colour_of_kulla_and_conty_is_theirs(given, fresnel):
    """A part of what F = 1 returns that depends on the means of F and of the albedo alone, here of 400 midpoints and of
    20 angles."""
    alpha, plain = (0.7, 0.7), {"f0": 1.0}
    cos = (np.arange(400) + 0.5) / 400
    mean = 2 * np.mean(fresnel(cos) * cos)
    cos = (np.arange(20) + 0.5) / 20
    reflected = np.sum(albedos(facets("none", alpha, **plain), np.degrees(np.arccos(cos)))[:, 0] * cos) / np.sum(cos)
    colour = mean**2 * reflected / (1 - mean * (1 - reflected))
    added, all_of_it = (
        albedos(facets("kulla-conty", alpha, **it), (0, 60))[:, 0] - albedos(facets("none", alpha, **it), (0, 60))[:, 0]
        for it in (given, plain)
    )
    np.testing.assert_allclose(added, colour * all_of_it, atol=2e-3)


@pytest.mark.parametrize("way", ["walk", "kulla-conty"])
def test_facets_of_no_index_reflect_nothing(way):
    for k in 0.0, [0.0, 0.5, 1.0]:
        colour = {"type": "rgb", "value": k} if k else k
        found = albedos(facets(way, (0.5, 0.5), eta=1.0, k=colour), ANGLES)
        assert np.isfinite(found).all() and (found[:, 0] < 1e-7).all()
    assert (albedos(facets(way, (0.5, 0.5), int_ior=1.0, ext_ior=1.0), ANGLES) == 0).all()


def test_what_is_smooth_loses_nothing_and_stays_as_it_was():
    plain, compensated = (albedos(facets(way, (0.002, 0.002), f0=0.5), (5, 60, 80)) for way in ("none", "walk"))
    np.testing.assert_allclose(compensated, plain, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "way"),
    [
        *(("rough", way) for way in ("walk", "kulla-conty", "turquin")),
        pytest.param("brushed, rough", "walk", marks=pytest.mark.slow),
    ],
)
def test_a_checker_finds_nothing(name, way):
    """In anything; of brushed facets, in what their values and samples show."""
    only = None if name == "rough" else ["reciprocity", "weight", "pdf", "chi2", "albedo"]
    assert_bsdf(facets(way, ROUGHNESS[name], f0=0.5), only=only, angles=60)


def test_the_finest_grooves_have_no_spot_at_the_normal():
    """There the azimuth would change it within a fraction of a degree."""
    assert_bsdf(facets("kulla-conty", (1e-4, 2.0), f0=0.5), only="continuity")


@pytest.mark.parametrize("name", ROUGHNESS)
def test_samples_are_as_good_as_they_were(name):
    """Those of anisotropic facets are worse than .95 where little is lost, too."""
    plain, compensated = (efficiencies(facets(way, ROUGHNESS[name], f0=0.9), (5, 30, 60)) for way in ("none", "walk"))
    assert (compensated > np.minimum(plain, 0.96) - 0.01).all()


@pytest.mark.parametrize("given", [
    {"type": "walter"}, {"type": "metallicroughness", "shadowing": "smith", "metallic": 1.0, "base_color": 1.0},
    {"type": "burley", "metallic": 1.0, "base_color": 1.0, "anisotropic": 0.5},
])  # fmt: skip
def test_all_models_with_smiths_term_have_it(given):
    rough = {"alpha": 0.9} if given["type"] == "walter" else {"roughness": 0.95}
    np.testing.assert_allclose(albedos({**given, **rough, "multiscatter": "walk"}, ANGLES), 1, atol=5e-3)


@pytest.mark.parametrize("way", ["walk", "kulla-conty"])
def test_materials_that_share_a_texture_follow_it(way):
    """Mitsuba tells one of them that it has changed."""
    texture = mi.load_dict({"type": "uniform", "value": 0.9})
    walter = {"type": "walter", "multiscatter": way, "alpha": texture}
    shapes = {name: {"type": "sphere", "bsdf": mi.load_dict(walter)} for name in ("first", "second")}
    scene = mi.load_dict({"type": "scene", **shapes})
    params = mi.traverse(scene)
    (key,) = (key for key in params.keys() if "alpha" in key)
    wi, wo = direction(30, 0)[None], direction(40, 100)[None]
    for alpha in (0.3, 0.7):
        params[key] = alpha
        params.update()
        fresh = BSDFProbe(mi.load_dict(walter | {"alpha": alpha}))
        for shape in scene.shapes():
            probe = BSDFProbe(shape.bsdf())
            np.testing.assert_allclose(probe.eval(probe.whole, wi, wo), fresh.eval(fresh.whole, wi, wo), 1e-5)


@pytest.mark.parametrize("way", ["walk", "kulla-conty"])
def test_what_is_kept_serves_any_number_of_directions(way):
    """Dr.Jit widens a zero in place, such as how much F = 1 rises."""
    probe = BSDFProbe(mi.load_dict(facets(way, (0.7, 0.7))))
    wi, wo = direction(30, 0)[None], direction(40, 100)[None]
    values = [probe.eval(probe.whole, wi, np.repeat(wo, count, axis=0)) for count in (7, 3, 5)]
    np.testing.assert_allclose(np.concatenate(values), np.broadcast_to(values[0][0], (15, 3)), 1e-6)
