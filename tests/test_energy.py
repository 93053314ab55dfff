"""How much light the models reflect at most, as their pages say."""

import itertools
from functools import cache

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import qmc
from support import context, direction, interaction

from mi_brdfs.parameters import Choice, Colour, Flag, Number, OneOf, PerLobe
from mi_brdfs.registry import all_models

PLUGINS = {model: model.plugins[0] for model in all_models()}
ANGLES = [0, 20, 40, 60, 70, 75, 80, 83, 86, 88, 89, 89.5, 89.9]
INF = float("inf")
SETTINGS = 120
"""How many settings of the parameters that a configuration leaves open are tried, or a few more."""


@cache
def uniform(angles, log2_count):
    """Points of the unit cube, the same for each of several angles."""
    points = qmc.Sobol(3, seed=1).random_base2(log2_count).astype(np.float32)
    return np.tile(points, (angles, 1)).clip(0, 1 - 2**-24)


def albedos(bsdf, angles, log2_count):
    """The directional albedo at each angle: the integral of sample's weight over its variates, which is nearly
    constant. A few hundred points are good to some 1e-3, 2²⁰ to some 1e-5."""
    u, count = uniform(len(angles), log2_count), 1 << log2_count
    si = interaction(np.repeat([direction(angle, 17) for angle in angles], count, axis=0))
    _, weight = bsdf.sample(context(), si, mi.Float(u[:, 0]), mi.Point2f(u[:, 1:].T), True)
    return np.array(mi.luminance(weight), np.float64).reshape(len(angles), count).mean(axis=1)


def white(model):
    """The colours that make a model brightest: 1, and 0 for a diffuse lobe beside others."""
    colours = [p for p in flat(model.declared()) if isinstance(p, Colour)]
    return {c.name: 0.0 if c.name == "diffuse_reflectance" and len(colours) > 1 else 1.0 for c in colours}


def flat(declared, words=()):
    """Declared parameters with those of lobes, and of the chosen words, among them."""
    for parameter in declared:
        if isinstance(parameter, PerLobe):
            yield from parameter.declared.values()
            continue
        yield parameter
        if isinstance(parameter, OneOf):
            for word, own in parameter.words.items():
                if word in words:
                    yield from flat(own.values())


def choices(declared, given):
    """Every combination of words for the choices among some parameters, as a configuration allows."""
    combinations = [{}]
    for parameter in declared:
        if isinstance(parameter, (Choice, OneOf, Flag)):
            combinations = [one | more for one in combinations for more in words_of(parameter, given)]
    return combinations


def words_of(parameter, given):
    """A choice's words, each with those of the choices that belong to it."""
    if isinstance(parameter, Flag):
        known = (False, True)
    else:
        known = tuple(parameter.words) if isinstance(parameter, OneOf) else parameter.choices
    allowed = given.get(parameter.name, known)
    for word in allowed if isinstance(allowed, tuple) else (allowed,):
        own = parameter.words[word].values() if isinstance(parameter, OneOf) else ()
        for more in choices(own, given):
            yield {parameter.name: word} | more


def axis(number, count):
    """Values of a number over its range. Wide ranges are stepped through by the logarithm, without the end that makes
    the narrowest lobes: at 89.5° the directions' own rounding changes their albedo by 1e-4."""
    low, high = number.limits
    if low > 0 and high > 100 * low:
        return list(np.geomspace(30 * low, high, count))
    if low == 0 and high >= 100:
        return [0, *np.geomspace(1e-5 * high, high / 30, count - 1)]
    return list(np.linspace(low, high, count))


def settings(numbers):
    """Values by property name for the numbers left open: a grid, or corners and random points if there are many."""
    names = [name for number in numbers for name in (number.pair or number.names[:1])]
    by_name = [number for number in numbers for _ in (number.pair or "1")]
    count = max(3, round(SETTINGS ** (1 / max(len(names), 1))))
    if count ** len(names) <= 2 * SETTINGS:
        grid = itertools.product(*(axis(number, count) for number in by_name))
    else:
        fine = [axis(number, 9) for number in by_name]
        rng = np.random.default_rng(5)
        ends = itertools.product(*((values[0], values[-1]) for values in fine))
        grid = [*ends, *([rng.choice(values) for values in fine] for _ in range(SETTINGS))]
    return [dict(zip(names, map(float, point), strict=True)) for point in grid]


def largest(model, given):
    """``(albedo, angle, parameters)`` of the brightest setting that a configuration allows."""
    found = []
    for words in choices(model.declared(), given):
        fixed = {"type": PLUGINS[model], **white(model), **given, **words}
        used = flat(model.declared(), words.values())
        numbers = [p for p in used if isinstance(p, Number) and p.name not in fixed]
        bsdf = None
        for values in settings(numbers):
            if bsdf is None:
                try:
                    bsdf = mi.load_dict(fixed | values)
                except RuntimeError as error:
                    assert "is not known for" in str(error)  # a combination that the kit refuses
                    break
                params = mi.traverse(bsdf)
            for name, value in values.items():
                params[f"{name}.value"] = value
            params.update()
            found += zip(albedos(bsdf, ANGLES, 9), ANGLES, itertools.repeat(fixed | values), strict=False)
    found.sort(key=lambda item: -item[0])
    return max(((albedos(mi.load_dict(bsdf), [angle], 20)[0], angle, bsdf) for _, angle, bsdf in found[:8]),
               key=lambda item: item[0])  # fmt: skip


CONFIGURATIONS = [(model, given, albedo) for model in PLUGINS for given, albedo in model.energy.largest]


def configuration(value):
    return PLUGINS[value] if isinstance(value, type) else str(value)


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model, given, albedo", CONFIGURATIONS, ids=configuration)
def test_largest_albedo(model, given, albedo):
    """Conserving models reflect no more than they receive, to 1e-4, and come near it; of the others, the page tells the
    largest albedo as it is measured here, or that it has no limit to speak of."""
    measured, angle, bsdf = largest(model, given)
    where = f"{measured} at {angle}° of {bsdf}"
    if albedo <= 1:
        assert 0.97 * albedo < measured <= 1 + 1e-4, where
    elif albedo == INF:
        assert measured > 100, where
    else:
        assert measured == pytest.approx(albedo, rel=6e-3), where


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model", PLUGINS, ids=configuration)
def test_largest_albedo_of_the_defaults(model):
    measured = albedos(mi.load_dict({"type": PLUGINS[model]}), ANGLES, 14).max()
    assert measured == pytest.approx(model.energy.default, rel=6e-3)


@pytest.mark.parametrize("model", PLUGINS, ids=configuration)
def test_every_choice_is_covered(model):
    """Whatever words are chosen, some configuration on the page includes them, or the plugin refuses them."""
    pages = [choices(model.declared(), given) for given, _ in model.energy.largest if not numbers_in(model, given)]
    covered = [words for page in pages for words in page]
    for words in choices(model.declared(), {}):
        if words not in covered:
            with pytest.raises(RuntimeError, match="is not known for"):
                mi.load_dict({"type": PLUGINS[model]} | words)


def numbers_in(model, given):
    """Whether a configuration speaks of some values of numbers only."""
    return any(isinstance(value, float) for value in given.values())
