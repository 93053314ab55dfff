"""Every model over all that it declares: values are finite, what is seen can be sampled, and nothing raises.

The inputs come from the declarations alone. Parameters are textures that have another value in each lane: so one call
evaluates thousands of settings and pairs of directions, which fill the lanes in several ways.
"""

from __future__ import annotations

import re
import zlib

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from fuzzing import FILM, typical, ways
from support import context, floats, interaction, is_scalar, numbers, per_lane, sample_arguments, unit, vectors

from mi_brdfs.mitsuba.registry import brought_terms, own_models

EVALUATIONS = 1_000_000
"""How many settings and pairs of directions a run tries, or more: with the first way to give each model's parameters,
and as many again with the others, which take long to compile."""
LANES, EXAMPLES = 1 << 14, 6
"""Lanes that are filled in the same way, and how many ways there are."""

pytestmark = pytest.mark.usefixtures("no_lanes_left")

MODELS = own_models()
FEW = "eon", "ward", "burley"
"""Models that are always tried, also in a scalar variant, and with derivatives."""
CASES = [
    pytest.param(model, options, id=f"{model.plugins[0]} {options}", marks=[pytest.mark.slow] if k else [])
    for model in MODELS
    for k, options in enumerate(ways(model.declared()))
]
MOSTLY_SLOW = [
    case if case.values[0].plugins[0] in FEW else pytest.param(*case.values, id=case.id, marks=pytest.mark.slow)
    for case in CASES
]


# --- Inputs: each function has its own way to fill the lanes --------------------------------------------------------


def magnitudes(low, high, rng, count):
    """Numbers of all magnitudes between two that are above zero."""
    return np.exp(rng.uniform(np.log(low), np.log(high), count))


def mixture(functions):
    """Any of the functions in each lane."""

    def mixed(*arguments):
        *_, rng, count = arguments
        filled = np.stack([function(*arguments) for function in functions])
        return filled[rng.integers(len(functions), size=count), np.arange(count)]

    return mixed


def usual(quantity, rng, count):
    return np.full(count, typical(quantity))


def uniform(quantity, rng, count):
    return rng.uniform(*quantity.limits, count)


def ends(quantity, rng, count):
    return rng.choice(quantity.limits, count)


def near_the_ends(quantity, rng, count):
    low, high = quantity.limits
    inside = (high - low) * magnitudes(1e-7, 0.1, rng, count)
    return np.where(rng.random(count) < 0.5, low + inside, high - inside)


def tiny_and_huge(quantity, rng, count):
    """Of either sign if the range has both, and down to denormal numbers if it includes zero."""
    low, high = quantity.limits
    if low > 0:
        return magnitudes(low, high, rng, count)
    size = magnitudes(rng.choice([1e-44, 1e-8, 1e-3], count), high, rng, count)
    return np.where(rng.random(count) < 0.5, size, np.maximum(-size, low))


def beyond(quantity, rng, count):
    """Outside the range, to which textured values are limited where they are evaluated."""
    low, high = quantity.limits
    outside = magnitudes(1e-8, 1e30, rng, count)
    return np.where(rng.random(count) < 0.5, low - outside, high + outside)


def directions(cos, sin, rng):
    phi = rng.uniform(0, 2 * np.pi, len(cos))
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)


def generic(rng, count):
    cos = rng.random(count)
    return directions(cos, np.sqrt(1 - cos * cos), rng)


def normal(rng, count):
    return np.tile([0.0, 0.0, 1.0], (count, 1))


def near_normal(rng, count):
    sin = magnitudes(rng.choice([1e-20, 1e-7], count), 1e-2, rng, count)
    return directions(np.sqrt(1 - sin * sin), sin, rng)


def grazing(rng, count):
    cos = magnitudes(1e-7, 0.1, rng, count)
    return directions(cos, np.sqrt(1 - cos * cos), rng)


def along_an_axis(rng, count):
    w = generic(rng, count)
    w[np.arange(count), rng.integers(2, size=count)] = 0
    return unit(w)


def horizontal(rng, count):
    return directions(np.zeros(count), 1, rng)


def below(rng, count):
    return generic(rng, count) * [1, 1, -1]


def independent(wi, rng, count):
    return mixture(INCIDENT)(rng, count)


def mirrored(wi, rng, count):
    return wi * [-1, -1, 1]


def nearly_mirrored(wi, rng, count):
    return nearly_back(mirrored(wi, rng, count), rng, count)


def back(wi, rng, count):
    return wi


def nearly_back(wi, rng, count):
    return unit(wi + rng.normal(size=(count, 3)) * magnitudes(1e-8, 0.3, rng, count)[:, None])


def straight_on(wi, rng, count):
    return -wi


SETTINGS = (usual, uniform, ends, near_the_ends, tiny_and_huge, beyond)
INCIDENT = (generic, normal, near_normal, grazing, along_an_axis, horizontal, below)
REFLECTED = (independent, mirrored, nearly_mirrored, back, nearly_back, straight_on)


def variates(rng, count):
    """Three for each lane, some of them at the ends of [0, 1)."""
    special = rng.choice([0, 2**-24, 0.5, 1 - 2**-24], (count, 3))
    return np.where(rng.random((count, 3)) < 0.3, special, rng.random((count, 3), np.float32)).astype(np.float32)


def some_of(functions, rng):
    """One of the functions, or as often all of them."""
    return mixture(functions) if rng.random() < 0.5 else functions[rng.integers(len(functions))]


# --- Outputs --------------------------------------------------------------------------------------------------------


class FuzzedPlugin:
    """A plugin with some options, whose quantities differ from lane to lane, each ``lanes`` of which are filled in one
    of ``examples`` ways. A range without an end has ``largest``."""

    def __init__(self, model, options, largest, examples=1, lanes=LANES):
        self.given = {"type": model.plugins[0], **options.words}
        self.quantities, self.largest, self.lanes = options.quantities, largest, lanes
        self.textures = {quantity.name: per_lane() for quantity in self.quantities}
        self.bsdf = mi.load_dict(self.given | self.textures)
        rng = np.random.default_rng(zlib.crc32(f"{self.given} {options} 0".encode()))
        *settings, wi, wo, u = zip(*(self._filled(rng) for _ in range(examples)), strict=True)
        self.values = {q.name: np.concatenate(v, axis=-1) for q, v in zip(self.quantities, settings, strict=True)}
        self.wi, self.wo, self.u = (np.concatenate(arrays) for arrays in (wi, wo, u))

    def _filled(self, rng):
        """Settings, of which colours are grey at times, directions and variates."""
        settings = []
        for quantity in self.quantities:
            fill = some_of(SETTINGS, rng)
            values, *others = (self._values(quantity, fill, rng) for _ in range(3 if quantity.colour else 1))
            if quantity.colour:
                values = np.where(rng.random(self.lanes) < 0.3, values, [values, *others])
            settings.append(np.float32(values))
        wi = some_of(INCIDENT, rng)(rng, self.lanes)
        wo = some_of(REFLECTED, rng)(wi, rng, self.lanes)
        return *settings, np.float32(wi), np.float32(wo), variates(rng, self.lanes)

    def _values(self, quantity, fill, rng):
        low, high = quantity.limits
        end = min(high, self.largest)
        values = fill(quantity._replace(limits=(low, end)), rng, self.lanes)
        return values if high == end else np.minimum(values, end)

    def enter(self, lane=slice(None)):
        """Give the quantities their values in all lanes, or in one."""
        for quantity in self.quantities:
            kind = mi.UnpolarizedSpectrum if quantity.colour else mi.Float
            value = self.values[quantity.name][..., lane]
            if not is_scalar():
                value = [*map(floats, value)] if quantity.colour else floats(value)
            self.textures[quantity.name].value = kind(value)

    def arguments(self, lane=slice(None)):
        """Those of ``eval_pdf_sample`` after the context; vectorized ones in memory that keeps the kernel the same."""
        u, v, w = self.u[lane].T
        variates = (mi.Float(u), mi.Point2f(v, w)) if is_scalar() else sample_arguments(self.u[lane])
        return interaction(self.wi[lane]), vectors(self.wo[lane]), *variates

    def answers(self, lane=slice(None)):
        """What ``eval_pdf_sample`` answers, by name, for the whole BSDF (None) and for each of its components. That the
        other methods answer the same is for the checker to say."""
        self.enter(lane)
        count = self.bsdf.component_count()
        parts = {part: context(part) for part in [None, *range(count if count > 1 else 0)]}
        arguments, found = self.arguments(lane), {}
        for part, ctx in parts.items():
            value, pdf, sample, weight = self.bsdf.eval_pdf_sample(ctx, *arguments, True)
            found[part] = {
                "eval": value,
                "pdf": pdf,
                "the direction of sample": sample.wo,
                "the density of sample": sample.pdf,
                "the weight of sample": weight,
            }
        dr.eval(found)
        return {part: {name: numbers(x) for name, x in answers.items()} for part, answers in found.items()}

    def derivatives(self, mode):
        """Those of all that the methods answer together, by name of the input; in forward mode for all of these at
        once."""
        self.enter()
        si, wo, *variates = self.arguments()
        inputs = {name: texture.value for name, texture in self.textures.items()} | {"wi": si.wi, "wo": wo}
        dr.enable_grad(inputs)
        value, pdf, sample, weight = self.bsdf.eval_pdf_sample(context(), si, wo, *variates, True)
        total = mi.luminance(value) + pdf + sample.pdf + mi.luminance(weight)
        if mode == "reverse":
            dr.backward(total)
            derivatives = dr.grad(inputs)
        else:
            for x in inputs.values():
                dr.set_grad(x, 1)
            dr.forward_to(total)
            derivatives = {"all inputs": dr.grad(total)}
        dr.eval(derivatives)
        return {name: numbers(derivative) for name, derivative in derivatives.items()}

    def reproduction(self, part, lane):
        """The call that shows a lane alone."""
        given = dict(self.given)
        for (low, high), name in ((quantity.limits, quantity.name) for quantity in self.quantities):
            values = self.values[name][..., lane]
            if values.ndim:
                given[name] = {"type": "rgb", "value": shortest(values.clip(low, high))}
            else:
                (value,) = shortest([values])
                given[name] = value if low <= value <= high else {"type": "uniform", "value": value}
        u, v = np.split(self.u[lane], [1])
        arrays = ", ".join(f"np.float32([{shortest(array)}])" for array in (self.wi[lane], self.wo[lane], u, v))
        return f"call(mi.load_dict({given}).eval_pdf_sample, context({part}), {arrays})"


def shortest(values):
    """Numbers as Python writes them with the fewest digits that float32 tells apart."""
    return [float(str(np.float32(value))) for value in values]


def faults(answers):
    """``(what is wrong, in which lanes)``"""
    direction = answers["the direction of sample"]
    for name, values in answers.items():
        if values is not direction:
            yield f"{name} is negative or not finite", ~(np.isfinite(values) & (values >= 0)).all(axis=1)
    yield "the direction of sample is not finite", ~np.isfinite(direction).all(axis=1)
    lengths = np.linalg.norm(direction, axis=1)
    yield (
        "the direction of sample is not of length one",
        (answers["the density of sample"][:, 0] > 0) & ~(abs(lengths - 1) < 1e-5),
    )
    # Light a billion times fainter than 1, or than what a sample from there carries, may lose its lobe to rounding.
    faint = 1e-9 * np.maximum(1, answers["the weight of sample"].max(axis=1))
    yield "pdf is 0 where eval is not", (answers["eval"].max(axis=1) > faint) & (answers["pdf"][:, 0] <= 0)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model, options", CASES)
def test_values(model, options):
    """Finite, not negative, of a density wherever they are positive."""
    plugin = FuzzedPlugin(model, options, 1e20, EXAMPLES)  # the rest of float32 is for the height of lobes
    assert len(plugin.wi) * len(MODELS) >= EVALUATIONS
    for part, answers in plugin.answers().items():
        for fault, wrong in faults(answers):
            assert not wrong.any(), f"{fault}: {plugin.reproduction(part, np.argmax(wrong))}"


@pytest.mark.parametrize("model, options", MOSTLY_SLOW)
def test_values_of_a_scalar_variant(model, options):
    """Where Python's floats divide: by zero they raise an error, and they go on below the least of float32."""
    with mi.variant_context("scalar_rgb"):
        plugin = FuzzedPlugin(model, options, 1e20, 2, lanes=25)
        for lane in range(len(plugin.wi)):
            try:
                found = plugin.answers(lane)
            except Exception as error:
                raise AssertionError(plugin.reproduction(None, lane)) from error
            for part, answers in found.items():
                for fault, wrong in faults(answers):
                    assert not wrong.any(), f"{fault}: {plugin.reproduction(part, lane)}"


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model, options", MOSTLY_SLOW)
def test_derivatives(model, options):
    """Finite, for every quantity and both directions: those of the value and of the density, which the weights of
    multiple importance sampling have in them, and those of a sample's weight and density."""
    fuzz_derivatives(model, options, "reverse")


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.plugins[0])
def test_derivatives_forward(model):
    """In forward mode other terms overflow."""
    fuzz_derivatives(model, ways(model.declared())[0], "forward")


def fuzz_derivatives(model, options, mode):
    # Kernels of a film's derivatives take long to compile: try them on one model, and on one lobe.
    if model.plugins[0] != "walter":
        options = options.without(*FILM)
    elif "film" in str(options):
        options = options.without("haze", "haze_spread", "retroreflectivity")
    plugin = FuzzedPlugin(model, options, 1e3, 4)
    for name, derivative in plugin.derivatives(mode).items():
        wrong = ~np.isfinite(derivative).all(axis=1)
        assert not wrong.any(), f"the derivative for {name}: {plugin.reproduction(None, np.argmax(wrong))}"


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.plugins[0])
def test_everything_declared_is_fuzzed(model):
    """Every property name, but for the numbers of lobes and presets, and every word that the manual page lists."""
    fuzzed = ways(model.declared())
    names = {name for options in fuzzed for name in [*options.words, *(q.name for q in options.quantities)]}
    unnumbered = {re.sub(r"_\d$", "", name) for parameter in model.declared() for name in parameter.names}
    unnumbered.discard("preset")
    assert {re.sub(r"_\d$", "", name) for name in names} == unnumbered
    for row in model.parameter_rows():
        if row.type in ("string", "boolean") and row.name not in ("material", "preset"):
            words = {word for word in row.range.split(" | ") if (row.name, word) not in brought_terms()}
            assert {str(options.words.get(row.name)).lower() for options in fuzzed} >= words
