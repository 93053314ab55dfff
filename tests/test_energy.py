"""How much light the models reflect at most, as their pages say."""

import inspect
from functools import partial

import mitsuba as mi
import numpy as np
import pytest
from reference_albedos import REFERENCES
from support import direction

from mi_brdfs.mitsuba.registry import brought_terms, own_models
from mi_brdfs.probe.largest_albedo import albedos, default_albedo, fault, largest_albedo
from mi_brdfs.probe.parameter_space import choices, white

PLUGINS = {model: model.plugins[0] for model in own_models()}
FEW = "eon", "ward", "burley"
"""Models that are always tried."""
CONFIGURATIONS = [(model, given, albedo) for model in PLUGINS for given, albedo in model.energy.largest]


def configuration(value):
    return PLUGINS[value] if isinstance(value, type) else str(value)


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model, given, stated", CONFIGURATIONS, ids=configuration)
def test_largest_albedo(model, given, stated):
    """No setting of all numbers, and no direction of view, is brighter than the page states, and one is nearly as
    bright. The integral of the reference says the same of it."""
    found = largest_albedo(model, given)
    assert not fault(stated, found.albedo, found.noise), found
    for reference in REFERENCES:
        if reference.model == PLUGINS[model] and reference.given == given:
            if found.given.get("multiscatter", "none") != "none":  # which references do not know
                found = largest_albedo(model, given | {"multiscatter": "none"})
            tolerance = 2e-3 * found.albedo + 3 * found.noise
            assert reference.albedo(found.numbers, 18) == pytest.approx(found.albedo, abs=tolerance), found


def test_references_are_configurations():
    stated = [(PLUGINS[model], given) for model, given, _ in CONFIGURATIONS]
    assert all((reference.model, reference.given) in stated for reference in REFERENCES)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "model",
    [pytest.param(it, marks=[] if PLUGINS[it] in FEW else pytest.mark.slow) for it in PLUGINS],
    ids=configuration,
)
def test_largest_albedo_of_the_defaults(model):
    assert not fault(model.energy.default, default_albedo(model))


@pytest.mark.parametrize("model", PLUGINS, ids=configuration)
def test_every_choice_is_covered(model):
    """Whatever words of its own are chosen, some configuration on the page includes them, or the plugin refuses
    them."""
    pages = [choices(model.declared(), given) for given, _ in model.energy.largest if not numbers_in(given)]
    covered = [words for page in pages for words in page]
    for words in choices(model.declared(), {}):
        if words not in covered and not brought_terms().keys() & words.items():
            with pytest.raises(RuntimeError, match="is not known for"):
                mi.load_dict({"type": PLUGINS[model]} | words)


def numbers_in(given):
    """Whether a configuration speaks of some values of numbers only."""
    return any(isinstance(value, float) for value in given.values())


EVERYTHING = {"subsurface": 1.0, "specular": 1.0, "sheen": 1.0, "clearcoat": 1.0}
GRAZING = [*range(60, 80), *np.arange(80, 89.95, 0.3)]


def albedo(model, /, *angles, azimuth=17, **given):
    """The largest albedo at some angles, of a plugin in white."""
    wi = np.array([direction(angle, azimuth) for angle in angles or GRAZING])
    bsdf = mi.load_dict({"type": PLUGINS[model], **white(model, given), **given})
    return albedos(bsdf, wi, 12 if len(wi) > 1 else 16).max()


def compared(at, angle, **given):
    """By how many percent the albedos of two variants differ."""
    return 100 * abs(at(angle, variant="ward-duer", **given) / at(angle, **given) - 1)


TEXT = [
    ("blinnphong", "exceeds ρs by up to {:.1f} % (n = 9)",
     lambda at: [100 * at(0, exponent=9.0, normalization="approximate") - 100]),
    ("blinnphong", "The albedo is {:.1f} ρs (n = 10) to {:.2f} ρs (n = 100) at normal incidence",
     lambda at: [at(0, exponent=n, normalization="ndf") for n in (10.0, 100.0)]),
    ("brady", "the albedo is at most {:.3f} for α = 2, β = 0.3, F = 1",
     lambda at: [at(0, normalization="none")]),
    ("burley", "reaches {:.2f} with the defaults, {:.2f} for roughness = 1 and, with everything else switched on, "
     "{:.2f} for roughness = 0 and {:.2f} along dp_dv for roughness = 0.17 and anisotropic = 1",
     lambda at: [at(), at(roughness=1.0), at(roughness=0.0, **EVERYTHING),
                 at(roughness=0.17, anisotropic=1.0, azimuth=90, **EVERYTHING)]),
    ("kurt", "for κ = 0.5 and α = 0.1 it is {:.2f} at 88° and {:.1f} at 89.9°",
     lambda at: [at(angle, kurt_exponent=0.5) for angle in (88, 89.9)]),
    ("metallicroughness", "metallic = 1 and r = 0.1 the albedo is {:.2f} at 80°",
     lambda at: [at(80, metallic=1.0, roughness=0.1)]),
    ("metallicroughness", "r = 0.5 or 0.1, the albedo reaches {:.2f} or {:.2f} (direct), {:.2f} or {:.2f} (ibl), "
     "{:.2f} or {:.2f} (smith)",
     lambda at: [at(shadowing=word, roughness=r) for word in ("direct", "ibl", "smith") for r in (0.5, 0.1)]),
    ("minnaert", "{:.2f} ρ and {:.2f} ρ for k = 0.5",
     lambda at: [at(angle, exponent=0.5) for angle in (0, 89)]),
    ("minnaert", "for k = 0.5 it is {:.2f} ρ at 60° and {:.1f} ρ at 89°",
     lambda at: [at(angle, exponent=0.5, normalization="published") for angle in (60, 89)]),
    ("orennayar", "at grazing angles reaches {:.3f} (qualitative, σ = 0.2) and {:.3f} (full, σ = 0.3)",
     lambda at: [at(89.9, sigma=0.2), at(89.9, sigma=0.3, model="full")]),
    ("orennayar", "the albedo at normal incidence is {:.2f} and {:.2f} for σ = π/2",
     lambda at: [at(0, sigma=1.5708, model=word) for word in ("qualitative", "full")]),
    ("roughdiffuse", "at grazing angles reaches {:.3f} (α = 0.42), or {:.3f} (α = 0.28) with",
     lambda at: [at(89.9, alpha=0.42), at(89.9, alpha=0.28, use_fast_approx=True)]),
    ("toon", "ρd and {:.1f} ρs for the defaults",
     lambda at: [at(0, normalization="none")]),
    ("walter", "α = 1, F = 1: {:.2f} ρs at normal incidence",
     lambda at: [at(0, alpha=1.0)]),
    ("ward", "at 89.9° the albedo is {:.2f} ρs for α = 0.3, and {:.2f} ρs in the plane of αu = 1 as αv → 0",
     lambda at: [at(89.9, variant="ward", alpha=0.3),
                 at(89.9, variant="ward", alpha_u=1.0, alpha_v=1e-4, azimuth=0)]),
    ("ward", "at most {:.0f} % below it (α = 1), and at 80° {:.0f} % above it (α = 0.35), or {:.0f} % if αu ≠ αv",
     lambda at: [compared(at, 62.5, alpha=1.0), compared(at, 80, alpha=0.35),
                 compared(at, 80, alpha_u=0.55, alpha_v=1e-4, azimuth=0)]),
    ("ward", "At 89° it is {:.1f} ρs (α = 0.1) to {:.1f} ρs (α = 0.5)",
     lambda at: [at(89, variant="ward-duer", alpha=alpha) for alpha in (0.1, 0.5)]),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name, sentence, measured", TEXT, ids=[name for name, *_ in TEXT])
def test_albedos_in_the_text(name, sentence, measured):
    """What the docstrings say of albedos, to the last digit."""
    (model,) = (model for model in PLUGINS if PLUGINS[model] == name)
    assert sentence.format(*measured(partial(albedo, model))) in " ".join(inspect.cleandoc(model.__doc__).split())
