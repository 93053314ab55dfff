"""Slips that somebody makes who writes a model: each is told in one sentence, or works."""

import re

import mitsuba as mi
import numpy as np
import pytest
from support import call, direction, hemisphere

import mi_brdfs
from mi_brdfs.lobes import LambertLobe, Lobe, MicrofacetLobe
from mi_brdfs.microfacet.distributions import Beckmann
from mi_brdfs.microfacet.fresnel import Unit
from mi_brdfs.microfacet.shadowing import VCavity
from mi_brdfs.mitsuba.errors import one_line
from mi_brdfs.parameters import Choice, Flag, Number, OneOf, PerLobe, Reflectance, Rotation, Spelling
from mi_brdfs.validation import check

pytestmark = pytest.mark.usefixtures("llvm_rgb", "as_before")


def model(lobes, **declared):
    """A registered model of these lobes, a function of the model and its values."""
    members = {"__doc__": "A model with a slip.", "lobes": lobes, **declared}
    return mi_brdfs.register(type("Slip", (mi_brdfs.Model,), members))


def matte(self, p):
    return (LambertLobe(p.reflectance),)


class Slanted(LambertLobe):
    """Brighter where wi leans towards the first tangent."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (1 + wi.x / 2), pdf


def radiance(**given):
    bsdf = mi.load_dict({"type": "slip", **given})
    return call(bsdf.eval, mi.BSDFContext(), direction(30), np.float32([direction(0)]))[0][0, 0] * np.pi


def told(**given):
    """The sentence of the error that loading raises."""
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": "slip", **given})
    return one_line(caught.value)


def test_a_pair():
    """Without a default it is there if given, once or as NAME_u and NAME_v; given in another spelling, it is one."""

    def lobes(self, p):
        return (LambertLobe(0.0 if p.alpha is None else p.alpha[0] + p.alpha[1]),)

    model(lobes, alpha=Number(None, (0, 1), "roughness", anisotropic=True))
    assert radiance() == 0
    assert radiance(alpha_u=0.1, alpha_v=0.2) == pytest.approx(0.3)
    assert radiance(alpha=0.2) == pytest.approx(0.4)
    spelling = Spelling("width", (0, 10), 0.1, "ten times the roughness")
    model(lobes, alpha=Number(0.1, (0, 1), "roughness", anisotropic=True, spelling=spelling))
    assert radiance(alpha=0.2) == pytest.approx(0.4)
    assert radiance(width=3) == pytest.approx(0.6)


def test_a_choice_of_each_lobe():
    """Numbered like everything else of a lobe, and a flag, too."""

    def lobes(self, p):
        return tuple(
            LambertLobe(it.scale * (1 if it.shade == "full" else 0.5) * (0 if it.off else 1)) for it in p.parts
        )

    parts = PerLobe(
        3,
        scale=Reflectance(0.1, "scale"),
        shade=Choice(("full", "half"), "shade of lobe i"),
        off=Flag(False, "whether lobe i is off"),
    )
    model(lobes, parts=parts)
    assert radiance() == pytest.approx(0.1)
    assert radiance(shade="half") == pytest.approx(0.05)
    assert radiance(shade_1="half", scale_2=0.3) == pytest.approx(0.35)
    assert radiance(scale_1=0.2, scale_2=0.3, off_2=True) == pytest.approx(0.2)
    assert 'slip: shade_2 = "dim" is unknown; it must be one of "full" or "half"' in told(shade_2="dim", scale_1=0.1)


def test_a_kind_of_others_reads_the_numbered_names():
    """Or is refused: what was given would do nothing."""

    class Careless(Number):
        def bind(self, reader):
            return self.replace(
                textures={self.name: reader.number(self.name, 0, self.limits)}, ranges={self.name: self.limits}
            )

    model(lambda self, p: (LambertLobe(0.1),), parts=PerLobe(2, width=Careless(0.5, (0, 1), "width")))
    assert radiance(width=0.2) == pytest.approx(0.1)
    assert "width: Careless must read self.names[0], width_1, not width" in told(width_1=0.2, width_2=0.3)


def test_choices_are_attributes_whatever_declares_them():
    """A word with parameters of its own, and among these other words, some with parameters, too."""

    def lobes(self, p):
        if self.kind == "flat":
            return (LambertLobe(0.1),)
        strength = {"full": 0.2, "half": 0.1}[self.shade] + {"warm": 0.0, "cold": 0.05}[self.tone]
        return (LambertLobe(strength + (p.kind.hue.depth if self.hue == "blue" else 0.3)),)

    hue = OneOf({"red": {}, "blue": {"depth": Number(0.4, (0, 1), "depth")}}, "hue")
    kind = OneOf({"flat": {}, "tinted": {"hue": hue, "tone": Choice(("warm", "cold"), "tone")}}, "kind")
    model(lobes, kind=kind, shade=Choice(("full", "half"), "shade"))
    assert radiance() == pytest.approx(0.1)
    assert radiance(kind="tinted", shade="half", tone="cold") == pytest.approx(0.45)
    assert radiance(kind="tinted", hue="blue") == pytest.approx(0.6)
    assert radiance(kind="tinted", hue="blue", depth=0.6) == pytest.approx(0.8)
    assert 'depth does not belong to hue = "red"' in told(kind="tinted", depth=0.6)


def test_a_model_without_parameters():
    model(lambda self, p: (LambertLobe(0.25),))
    assert radiance() == pytest.approx(0.25)
    assert told(alpha=0.1) == "slip: unknown parameter alpha; it has no parameters."
    assert "\nParameters\n----------\nNone.\n" in mi_brdfs.info("slip")
    assert mi_brdfs.ranges(mi.load_dict({"type": "slip"})) == {}


def test_lobes_are_a_tuple():
    for lobes in (
        lambda self, p: LambertLobe(p.reflectance),
        lambda self, p: (p.reflectance,),
        lambda self, p: (it for it in (LambertLobe(p.reflectance),)),
    ):
        model(lobes, reflectance=Reflectance(0.5, "albedo"))
        sentence = told()
        assert "Slip.lobes returns " in sentence and "it must return a tuple of lobes." in sentence


def test_the_lobes_depend_on_no_values():
    """Here on whether there is a surface point already."""
    counts = iter([2, 1, 1, 1])
    model(lambda self, p: (LambertLobe(p.reflectance),) * next(counts), reflectance=Reflectance(0.5, "albedo"))
    with pytest.raises(TypeError, match=r"Slip.lobes returns 1 lobes where it returned 2, or others; their number and"):
        radiance()


def test_a_lobe_without_an_albedo_is_named():
    class Half(Lobe):
        pass

    model(lambda self, p: (Half(), Half()))
    with pytest.raises(NotImplementedError, match="Half does not define estimated_albedo"):
        radiance()


def test_a_rotation_turns_the_frame_under_any_name():
    slanted = lambda self, p: (Slanted(p.reflectance),)  # noqa: E731
    model(slanted, reflectance=Reflectance(0.5, "albedo"), turn=Rotation(), rotation=Number(1, (0, 2), "number"))
    assert radiance(rotation=0.3) == pytest.approx(0.5 * 1.25)
    assert radiance(turn=0.5) == pytest.approx(0.5 * 0.75)


TAKEN = "lobes", "evaluate", "declared", "parameters", "textures", "energy", "plugins", "id", "type"


def test_declarations_that_are_wrong():
    named = "a parameter cannot be called {}, an attribute of every model."
    for declared, sentence in (
        *(({name: Number(1, (0, 1), "number")}, named.format(name)) for name in TAKEN),
        ({"turn": Rotation(), "nap": Rotation()}, "turn and nap each turn the frame; declare one Rotation()."),
        ({"gloss": Number(2, (0, 1), "number")}, "gloss is 2 by default, not within [0, 1]."),
        ({"plugins": "slip"}, 'plugins is a tuple of names; write plugins = ("slip",).'),
    ):
        with pytest.raises(TypeError, match=re.escape(f"Slip: {sentence}")):
            model(**({"lobes": matte} | declared))
    assert model(matte, plugins=["slip", "slips"]).plugins == ("slip", "slips")


class Dimmed(MicrofacetLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return wo.z * value, pdf


@pytest.mark.parametrize("below", [(), (LambertLobe(0.3),)])
def test_a_lobe_that_changes_only_what_another_one_evaluates(below):
    """The weights of its samples are its own, not what the other one hands on as it draws."""
    model(
        lambda self, p: (*below, Dimmed(p.reflectance, Beckmann(p.alpha, p.alpha), VCavity(), Unit())),
        reflectance=Reflectance(0.5, "ρ"),
        alpha=Number(0.3, (0.01, 1), "α"),
    )
    bsdf, wi = mi.load_dict({"type": "slip"}), hemisphere(100, 1, 0.1)
    u = np.random.default_rng(2).random((len(wi), 3), np.float32)
    wo, density, weight = call(bsdf.sample, mi.BSDFContext(), wi, u[:, :1], u[:, 1:])
    value, pdf = call(bsdf.eval_pdf, mi.BSDFContext(), wi, wo)
    np.testing.assert_allclose(density, pdf, rtol=1e-3)
    np.testing.assert_allclose(weight * pdf, value, rtol=1e-3)


def test_an_error_of_the_author_has_its_line():
    """Where it is raised: as the BSDF is made, or as it is evaluated, also in what the checker says. Not a sentence of
    the author's."""

    def undefined(self, p):
        return (nothing(p),)  # noqa: F821

    def refusing(self, p):
        raise ValueError("slip: it needs a name")

    class Misspelt(LambertLobe):
        def eval_pdf(self, wi, wo):
            return super().eval_pdf(wi, wo)[0] * wo.zz, wo.z

    at = undefined.__code__.co_firstlineno + 1
    model(undefined, reflectance=Reflectance(0.5, "albedo"))
    assert told() == f"test_contracts.py, line {at}: NameError: name 'nothing' is not defined"
    model(refusing)
    assert told() == "slip: it needs a name"

    at = Misspelt.eval_pdf.__code__.co_firstlineno + 1
    model(lambda self, p: (Misspelt(p.reflectance),), reflectance=Reflectance(0.5, "albedo"))
    with pytest.raises(Exception) as caught:
        radiance()
    assert one_line(caught.value).startswith(f"test_contracts.py, line {at}: ")
    (finding,) = check({"type": "slip"}, only=["finite"]).of("finite")
    assert finding.message.endswith(f"(test_contracts.py, line {at}).")
