"""Models that are the same model for some parameters."""

from math import sqrt

import mitsuba as mi
import numpy as np
import pytest
import reference as ref
from support import call, efficiencies, hemisphere

pytestmark = pytest.mark.usefixtures("llvm_rgb")


def assert_same(ours, theirs, **density):
    """Values and densities, to float32 round-off, at directions all over the hemisphere."""
    wi, wo, ctx = hemisphere(20_000, 1), hemisphere(20_000, 2), mi.BSDFContext()
    (value, pdf), (expected, other) = (call(mi.load_dict(bsdf).eval_pdf, ctx, wi, wo) for bsdf in (ours, theirs))
    compared = expected > 1e-6 * expected.max()
    assert compared.mean() > 0.1
    np.testing.assert_allclose(value[compared], expected[compared], rtol=1e-5)
    np.testing.assert_allclose(pdf, other, **{"rtol": 1e-5} | density)


LAMBERT = {
    "wrap": {"type": "wrap", "wrap": 0, "exponent": 1},
    "wrap, unnormalised": {"type": "wrap", "wrap": 0, "exponent": 1, "normalization": "none"},
    "wrap on the sphere": {"type": "wrap", "wrap": 0, "exponent": 1, "domain": "sphere"},
    "minnaert": {"type": "minnaert", "exponent": 1},
    "minnaert as published": {"type": "minnaert", "exponent": 1, "normalization": "published"},
    "orennayar": {"type": "orennayar", "sigma": 0},
    "full orennayar": {"type": "orennayar", "sigma": 0, "model": "full"},
    "eon": {"type": "eon", "roughness": 0},
}


@pytest.mark.parametrize("name", LAMBERT)
def test_lambert(name):
    colour = {"reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.8]}}
    assert_same(LAMBERT[name] | colour, {"type": "lambert"} | colour)


@pytest.mark.parametrize("model", ["qualitative", "full"])
def test_two_spellings_of_the_roughness_of_orennayar(model):
    for alpha in (0.1, 0.4, 0.9):
        sigma, spelt = ({"type": "orennayar", "model": model} | given
                        for given in ({"sigma": alpha / sqrt(2)}, {"alpha": alpha}))  # fmt: skip
        assert_same(spelt, sigma)
        assert [key.split(".")[0] for key in mi.traverse(mi.load_dict(spelt)).keys()] == ["reflectance", "alpha"]
        assert [key.split(".")[0] for key in mi.traverse(mi.load_dict(sigma)).keys()] == ["reflectance", "sigma"]


@pytest.mark.parametrize("fast, model", [(None, "full"), (False, "full"), (True, "qualitative")])
def test_roughdiffuse(fast, model):
    given = {} if fast is None else {"use_fast_approx": fast}
    for alpha in (None, 0.7):
        roughdiffuse = {"type": "roughdiffuse"} | given | ({} if alpha is None else {"alpha": alpha})
        assert_same(roughdiffuse, {"type": "orennayar", "model": model, "sigma": (alpha or 0.2) / sqrt(2)})


def test_full_orennayar_is_black_where_its_formula_is_negative():
    bsdf = mi.load_dict({"type": "orennayar", "model": "full", "sigma": 1.5, "reflectance": 0.2})
    wi, wo = hemisphere(20_000, 1), hemisphere(20_000, 2)
    value = call(bsdf.eval, mi.BSDFContext(), wi, wo)[0][:, 0]
    expected = ref.orennayar(wi, wo, 0.2, 1.5, "full")
    assert (expected < 0).any() and (value >= 0).all()
    np.testing.assert_allclose(value, np.maximum(expected, 0), rtol=1e-5, atol=1e-7)


BOTH = {"diffuse_reflectance": 0.3, "specular_reflectance": 0.6}
SAME = {
    "a mirror-like lafortune lobe": (
        {"type": "lafortune", "cx": -1, "cy": -1, "cz": 1, "exponent": 40} | BOTH,
        {"type": "phong", "exponent": 40} | BOTH,
    ),
    "the same, numbered": (
        {"type": "lafortune", "exponent_1": 40, "specular_reflectance_1": 0.6, "diffuse_reflectance": 0.3},
        {"type": "phong", "exponent": 40} | BOTH,
    ),
}

ANISOTROPIC = {"alpha_u": 0.2, "alpha_v": 0.5, "rotation": 0.1}


def kit(distribution, shadowing, **given):
    return {"type": "microfacet", "distribution": distribution, "shadowing": shadowing, **given}


KIT = {
    "cooktorrance": (
        {"type": "cooktorrance", "alpha": 0.3, "material": "Cu"},
        kit("beckmann", "vcavity", alpha=0.3, material="Cu"),
    ),
    "cooktorrance of ggx": (
        {"type": "cooktorrance", "alpha": 0.3, "distribution": "ggx"} | BOTH,
        kit("ggx", "vcavity", alpha=0.3, **BOTH),
    ),
    "cooktorrance of blinn": (
        {"type": "cooktorrance", "alpha": 0.3, "distribution": "blinn"},
        kit("blinn", "vcavity", exponent=2 / 0.3**2 - 2),
    ),
    "ward, balanced": ({"type": "ward"} | ANISOTROPIC | BOTH, kit("beckmann", "kelemen", **ANISOTROPIC, **BOTH)),
    "walter": ({"type": "walter", "int_ior": 1.5} | ANISOTROPIC, kit("ggx", "smith", int_ior=1.5, **ANISOTROPIC)),
    "walter, correlated": (
        {"type": "walter", "alpha": 0.6, "shadowing": "correlated"},
        kit("ggx", "smith-correlated", alpha=0.6),
    ),
    "kurt with exponent 0": (
        {"type": "kurt", "f0": 0.2, "kurt_exponent": 0} | ANISOTROPIC | BOTH,
        kit("beckmann", "kurt", f0=0.2, kurt_exponent=0, **ANISOTROPIC, **BOTH),
    ),
    "kurt": (
        {"type": "kurt", "f0": 0.2, "kurt_exponent": 0.4} | BOTH,
        kit("beckmann", "kurt", f0=0.2, kurt_exponent=0.4, **BOTH),
    ),
    "metallicroughness, a metal": (
        {"type": "metallicroughness", "base_color": 0.7, "metallic": 1, "roughness": 0.6, "shadowing": "smith"},
        kit("ggx", "smith", f0=0.7, alpha=0.36),
    ),
    "nishino": (
        {"type": "nishino", "kappa": 3, "gamma": 12, "f0": 0.3},
        kit("hepd", "vcavity", kappa=3, gamma=12, f0=0.3),
    ),
    "nishino's dsbrdf": ({"type": "nishino", "variant": "dsbrdf"}, kit("hepd", "implicit")),
    "low, normalised": (
        {"type": "low", "b": 60, "c": 1.2, "int_ior": 1.7, "normalization": "unit"},
        kit("abc", "vcavity", b=60, c=1.2, int_ior=1.7, ext_ior=1.0),
    ),
    "gtr with exponent 2": (kit("gtr", "vcavity", alpha=0.3, gamma=2), kit("ggx", "vcavity", alpha=0.3)),
    "epd with exponent 1": (kit("epd", "vcavity", alpha=0.3, gamma=1), kit("beckmann", "vcavity", alpha=0.3)),
    "hepd with kappa 0": (kit("hepd", "vcavity", kappa=0, gamma=25), kit("blinn", "vcavity", exponent=25)),
}
"""Models that are entries of the kit."""


@pytest.mark.parametrize("name", SAME | KIT)
def test_same_model(name):
    """However a model is spelt, its sampler is as good. The EPD's, which goes by steps, is another one."""
    stepwise = name.startswith("epd")
    assert_same(*(SAME | KIT)[name], rtol=2e-4, atol=1e9 if stepwise else 1e-6)
    if stepwise:
        both = (efficiencies(bsdf, (5, 30, 60, 80, 87)) for bsdf in (SAME | KIT)[name])
        np.testing.assert_allclose(*both, atol=0.005)


ISOTROPIC = {
    "ward": ("alpha", 0.2),
    "walter": ("alpha", 0.3),
    "kurt": ("alpha", 0.2),
    "ashikhminshirley": ("exponent", 50),
    "microfacet": ("alpha", 0.3),
}


@pytest.mark.parametrize("plugin", ISOTROPIC)
def test_isotropic_is_anisotropic_with_equal_pairs(plugin):
    parameter, value = ISOTROPIC[plugin]
    one, two = {"type": plugin, parameter: value}, {"type": plugin, f"{parameter}_u": value, f"{parameter}_v": value}
    assert_same(one, two)
    assert_same(one, one | {"rotation": 0.17}, rtol=1e-4, atol=1e-6)
