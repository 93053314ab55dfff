"""Words of the kit that others bring: distributions, shadowing and Fresnel terms."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support import call, hemisphere

import mi_brdfs
from mi_brdfs.explorer.controls import controls_of, with_value
from mi_brdfs.microfacet import Fresnel, Shadowing
from mi_brdfs.microfacet.distributions import Beckmann
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.parameters import Choice, Flag, Number

pytestmark = pytest.mark.usefixtures("as_before")


class Steep(Beckmann):
    word = "steep"
    parameters = {"alpha": Number(0.1, (1e-4, 2), "roughness", anisotropic=True)}


class Dusk(Shadowing):
    word = "dusk"
    parameters = {"dusk": Number(0.5, (0, 1), "how dark it is")}

    def __init__(self, dusk):
        self.dusk = dusk

    def __call__(self, facet):
        return self.dusk * facet.cos_i * facet.cos_o


class Squared(Fresnel):
    word = "squared"
    parameters = {"edge": Number(1, (0, 1), "reflectance at grazing")}

    def __init__(self, edge):
        self.edge = edge

    def __call__(self, cos):
        return self.edge * dr.square(1 - cos)


def values(**given):
    wi, wo = hemisphere(1000, 1), hemisphere(1000, 2)
    return call(mi.load_dict({"type": "microfacet", **given}).eval, mi.BSDFContext(), wi, wo)[0][:, 0]


@pytest.mark.usefixtures("llvm_rgb")
def test_each_kind_of_term_has_a_word():
    for term in Steep, Dusk, Squared:
        assert mi_brdfs.register(term) is term
    assert (values(distribution="steep", alpha=0.3) == values(distribution="beckmann", alpha=0.3)).all()
    half, whole = values(shadowing="dusk", alpha=0.5), values(shadowing="implicit", alpha=0.5)
    np.testing.assert_allclose(half, 0.5 * whole, rtol=1e-6)
    wi, wo = hemisphere(1000, 1).astype(np.float64), hemisphere(1000, 2).astype(np.float64)
    cos_d = np.sqrt(0.5 + 0.5 * (wi * wo).sum(axis=1))
    squared = values(fresnel="squared", edge=0.5, alpha=0.5)
    np.testing.assert_allclose(squared, 0.5 * (1 - cos_d) ** 2 * values(alpha=0.5), rtol=1e-4, atol=1e-8)
    keys = mi.traverse(mi.load_dict({"type": "walter", "fresnel": "squared"})).keys()
    assert "edge.value" in keys
    assert "dusk" in mi_brdfs.info("microfacet") and "reflectance at grazing" in mi_brdfs.info("cooktorrance")


@pytest.mark.usefixtures("llvm_rgb")
def test_choices_and_flags_reach_the_term():
    class Tailed(Steep):
        word = "tailed"
        parameters = {**Steep.parameters, "tail": Choice(("short", "long"), "tail"), "twice": Flag(False, "twice")}

        def __init__(self, alpha_u, alpha_v, tail, twice):
            scale = (3 if tail == "long" else 1) * (2 if twice else 1)
            super().__init__(scale * alpha_u, scale * alpha_v)

    mi_brdfs.register(Tailed)
    for words, alpha in ({}, 0.1), ({"tail": "long"}, 0.3), ({"tail": "long", "twice": True}, 0.6):
        found = values(distribution="tailed", alpha_u=0.1, alpha_v=0.1, **words)
        np.testing.assert_allclose(found, values(distribution="beckmann", alpha_u=alpha, alpha_v=alpha), rtol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
def test_the_explorer_has_a_fresnel_term_of_others():
    """Its numbers bring its word, which gives way to other terms."""
    mi_brdfs.register(Squared)
    bsdf, walter = {"type": "walter", "f0": 0.5}, find_model("walter")

    def controls():
        return {it["name"]: it for it in controls_of(walter, bsdf)}

    assert controls()["fresnel"]["words"] == ["squared"]
    for name, value, expected in (
        ("edge", 0.3, {"fresnel": "squared", "edge": 0.3}),
        ("int_ior", 1.5, {"int_ior": 1.5}),
        ("fresnel", "squared", {"fresnel": "squared"}),
        ("edge", 0.4, {"fresnel": "squared", "edge": 0.4}),
    ):
        bsdf = with_value(bsdf, controls()[name], value)
        assert bsdf == {"type": "walter", **expected}


def told(**given):
    with pytest.raises(RuntimeError) as error:
        mi.load_dict({"type": "microfacet", **given})
    return str(error.value).strip().splitlines()[-1]


@pytest.mark.usefixtures("llvm_rgb")
def test_wrong_parameters_of_a_word_are_told():
    mi_brdfs.register(Dusk)
    mi_brdfs.register(Squared)
    assert "dusk does not belong to shadowing" in told(dusk=0.5)
    assert 'edge needs fresnel beside it, which is "squared"' in told(edge=0.5)
    assert 'fresnel = "sqaured" is unknown; it must be one of "squared"' in told(fresnel="sqaured")
    assert "fresnel excludes f0; give one Fresnel term" in told(fresnel="squared", f0=0.04)


def variation(base, /, **attributes):
    return type(base.__name__, (base,), attributes)


@pytest.mark.parametrize(
    "term, sentence",
    [
        (variation(Dusk, word=None), "Dusk: word is None; it must be lower-case letters, digits and -"),
        (variation(Dusk, word="Dusk!"), "Dusk: word is 'Dusk!'; it must be lower-case letters"),
        (variation(Dusk, word="kelemen"), 'the word "kelemen" belongs to mi_brdfs; take another one'),
        (variation(Steep, parameters={"rotation": Number(1, (0, 2), "")}), "a parameter cannot be called rotation"),
        (variation(Dusk, parameters={"alpha": Number(1, (0, 2), "")}), "a parameter cannot be called alpha"),
        (variation(Squared, parameters={"k": Number(1, (0, 2), "")}), 'called k, which means the word "conductor"'),
        (variation(Squared, parameters={"normalization": Number(1, (0, 2), "")}), "normalization, a parameter of cook"),
    ],
)
def test_wrong_terms_are_refused(term, sentence):
    with pytest.raises(ValueError, match=sentence):
        mi_brdfs.register(term)


@pytest.mark.usefixtures("llvm_rgb")
def test_a_word_can_be_registered_again_and_replaced():
    mi_brdfs.register(Dusk)
    edited = variation(Dusk, __qualname__=Dusk.__qualname__, __module__=Dusk.__module__)
    mi_brdfs.register(edited)
    stranger = variation(Dusk, __module__="elsewhere")
    with pytest.raises(ValueError, match=r"belongs to test_kit_words\.Dusk"):
        mi_brdfs.register(stranger)
    mi_brdfs.register(stranger, replace=True)
