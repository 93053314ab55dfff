"""Words that models of facets share: tints of Schlick's reflectance, haze, retroreflection."""

import mitsuba as mi
import numpy as np
import pytest
import reference as ref
from support import call, hemisphere

from mi_brdfs.fit import fit
from mi_brdfs.fit.unknowns import configurations
from mi_brdfs.models.walter import Walter
from mi_brdfs.testing import assert_bsdf
from mi_brdfs.validation import CHECKS

pytestmark = pytest.mark.usefixtures("llvm_rgb")

COUNT = 2000
ELLIPSE = {"alpha_u": 0.5, "alpha_v": 0.2}


def values(given, wi, wo):
    """f, of one channel."""
    return call(mi.load_dict(given).eval, mi.BSDFContext(), wi, wo)[0][:, 0] / wo[:, 2]


def facets(wi, wo, alpha_u, alpha_v, fresnel=np.ones_like):
    """f of Walter et al. in float64."""
    return ref.walter(wi, wo, 0, 1, alpha_u, alpha_v, "separable", fresnel) / wo[:, 2]


@pytest.mark.parametrize(("given", "function"), [
    ({"f0": 0.6, "f82": 0.2}, {"f0": 0.6, "f82": 0.2}),
    ({"f0": 0.1, "f90": 0.4}, {"f0": 0.1, "f90": 0.4}),
    ({"f0": 0.3, "schlick_exponent": 2.5}, {"f0": 0.3, "exponent": 2.5}),
    ({"f0": 0.2, "f82": 0.0, "f90": 0.7, "schlick_exponent": 8.0},
     {"f0": 0.2, "f82": 0.0, "f90": 0.7, "exponent": 8.0}),
])  # fmt: skip
def test_schlicks_reflectance_with_tints(given, function):
    wi, wo = hemisphere(COUNT, 1), hemisphere(COUNT, 2)
    found = values({"type": "walter", **ELLIPSE, **given}, wi, wo)
    expected = facets(wi, wo, 0.5, 0.2, lambda cos: ref.fresnel_generalized_schlick(cos, **function))
    # Where F falls to 0, it is a difference of numbers up to one.
    scale = facets(wi, wo, 0.5, 0.2)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("given", [
    {"type": "walter", **ELLIPSE}, {"type": "microfacet", "distribution": "ggx", **ELLIPSE},
    {"type": "burley", "base_color": 1.0, "metallic": 1.0, "roughness": 0.6, "anisotropic": 0.6},
])  # fmt: skip
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_retroreflection_is_the_lobe_of_the_mirrored_viewer(given, share):
    wi, wo = hemisphere(COUNT, 1), hemisphere(COUNT, 2)
    back = values({**given, "retroreflectivity": share}, wi, wo)
    plain = values(given, wi, wo), values(given, wi * np.float32([-1, -1, 1]), wo)
    np.testing.assert_allclose(back, (1 - share) * plain[0] + share * plain[1], rtol=1e-4, atol=1e-7)
    if given["type"] == "walter":
        expected = (1 - share) * facets(wi, wo, 0.5, 0.2) + share * facets(wi * [-1, -1, 1], wo, 0.5, 0.2)
        np.testing.assert_allclose(back, expected, rtol=2e-4)


CURVES = {
    15: [(-74.9999, 0.000666683), (-22.9999, 0.00404187), (5.0001, 0.408624), (33.0001, 0.070562)],
    30: [(-28.9999, 0.000933248), (5.0001, 0.0200003), (33.0001, 4.80213), (55.0001, 0.0344305)],
    60: [(-22.9999, 0.000472432), (33.0001, 0.0301941), (55.0001, 5.42602), (61.0001, 14.7626)],
}  # fmt: skip
"""f of the model of Raab et al. with roughness .23, f0 = .19 and f82 = 0 in the plane of incidence, by the angles of
incidence and reflection, as published with the paper (portsmouth/MRM_retroreflectivity on GitHub)."""


@pytest.mark.parametrize("theta", CURVES)
def test_published_curves_of_retroreflection(theta):
    angles, expected = np.array(CURVES[theta]).T
    w = [np.float32([np.sin(t), 0 * t, np.cos(t)]).T for t in np.radians([np.full_like(angles, theta), angles])]
    given = {"type": "walter", "shadowing": "correlated", "alpha": 0.23**2, "f0": 0.19, "f82": 0.0}
    np.testing.assert_allclose(values({**given, "retroreflectivity": 1.0}, *w), expected, rtol=1e-3)


@pytest.mark.parametrize(("given", "wide"), [
    ({"type": "walter", **ELLIPSE}, {"alpha_u": (0.5**0.5 * 0.6 + 0.4) ** 2, "alpha_v": (0.2**0.5 * 0.6 + 0.4) ** 2}),
    ({"type": "walter", "alpha": 1.5}, {}),
    ({"type": "cooktorrance", "alpha": 0.1}, {"alpha": (0.1**0.5 * 0.6 + 0.4) ** 2}),
    ({"type": "microfacet", "distribution": "gtr", "alpha": 0.1, "gamma": 1.5}, {"alpha": (0.1**0.5 * 0.6 + 0.4) ** 2}),
    ({"type": "microfacet", "distribution": "epd", "alpha": 0.1, "gamma": 0.7}, {"alpha": (0.1**0.5 * 0.6 + 0.4) ** 2}),
    ({"type": "microfacet", "distribution": "blinn", "exponent": 198.0},
     {"exponent": 2 / (0.1**0.5 * 0.6 + 0.4) ** 4 - 2}),
    ({"type": "metallicroughness", "roughness": 0.3, "metallic": 1.0}, {"roughness": 0.3 * 0.6 + 0.4}),
])  # fmt: skip
def test_haze_is_a_second_lobe_of_rougher_facets(given, wide):
    """Of the same model, at the roughness √α' = .6 √α + .4."""
    given = {"shadowing": "vcavity", **given} if given["type"] == "microfacet" else given
    wi, wo = hemisphere(COUNT, 1), hemisphere(COUNT, 2)
    hazy = values({**given, "haze": 0.3, "haze_spread": 0.4}, wi, wo)
    expected = 0.7 * values(given, wi, wo) + 0.3 * values({**given, **wide}, wi, wo)
    # Each has the error of exp and powers of far tails.
    np.testing.assert_allclose(hazy, expected, rtol=2e-4, atol=1e-7)


OF_VALUES_AND_SAMPLES = "finite", "support", "eval_pdf", "reciprocity", "weight", "pdf", "chi2", "albedo", "components"


@pytest.mark.parametrize("given", [
    {"type": "walter", **ELLIPSE, "f0": 0.5, "f82": 0.3, "retroreflectivity": 0.4},
    {"type": "cooktorrance", "alpha": 0.2, "material": "Au", "haze": 0.5, "retroreflectivity": 1.0},
    pytest.param({"type": "burley", "metallic": 1.0, "haze": 0.3, "retroreflectivity": 0.7, "anisotropic": 0.5},
                 marks=pytest.mark.slow),
    pytest.param({"type": "microfacet", "distribution": "blinn", "exponent": 60.0, "haze": 0.3, "f0": 0.9,
                  "f90": 0.5, "schlick_exponent": 3.0}, marks=pytest.mark.slow),
    pytest.param({"type": "walter", "alpha": 0.3, "f0": 0.8, "multiscatter": "turquin", "retroreflectivity": 0.5},
                 marks=pytest.mark.slow),
])  # fmt: skip
def test_a_checker_finds_nothing(given):
    """In all of the first; in the others, of what their values and samples show."""
    every = CHECKS if "f82" in given else OF_VALUES_AND_SAMPLES
    assert_bsdf(given, only=list(every), angles=60)


def test_fits_seek_them_only_if_asked():
    def unknowns(**given):
        (found,) = configurations(Walter, given, {}, 1, 1, False)
        return {it.name for it in found.unknowns}

    assert unknowns() == {"diffuse_reflectance", "specular_reflectance", "alpha", "f0"}
    for base, asked in (
        ({}, {"f82", "haze", "haze_spread", "retroreflectivity"}),
        ({"int_ior": 1.5}, {"film_thickness", "film_ior"}),
    ):
        assert unknowns(**base, **dict.fromkeys(asked, "free")) == unknowns(**base) | asked
        assert not unknowns(**base) & asked


@pytest.mark.parametrize("planted", [
    {"f0": 0.3, "f82": 0.4}, {"f0": 0.4, "haze": 0.3, "haze_spread": 0.5}, {"f0": 0.4, "retroreflectivity": 0.35},
])  # fmt: skip
def test_fits_recover_them(planted):
    wi, wo = hemisphere(COUNT, 3, 0.2), hemisphere(COUNT, 4, 0.2)
    wo[::2] = wi[::2] * np.float32([-1, -1, 1])  # half of them in the highlight, or where light comes from
    wo[::4] = wi[::4]
    wo[::2] += 0.1 * hemisphere(COUNT // 2, 5)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    truth = {"type": "walter", "alpha": 0.15, **planted}
    data = wi, wo, values(truth, wi, wo)
    given = {"specular_reflectance": 1.0, "diffuse_reflectance": None} | {name: "free" for name in planted}
    best, *_ = fit(data, "walter", given=given, starts=4)
    for name, value in {"alpha": 0.15, **planted}.items():
        np.testing.assert_allclose(best.bsdf[name], value, rtol=0.01)
