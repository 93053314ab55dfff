"""The largest directional albedos of the models: a search over all their numbers and over the direction of view.

Parameters are textures that have another value in each lane: so one kernel evaluates thousands of settings.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from scipy.stats import qmc
from support import per_lane

from mi_brdfs.measure.arrays import luminance
from mi_brdfs.measure.probe import BSDFProbe
from mi_brdfs.parameters import Choice, Colour, Flag, Number, OneOf, PerLobe

STEEPEST = 89.9
"""The largest angle of view, in degrees."""

LEAST = {"epd": {"alpha": 0.003}}
"""The least of the numbers of some words that is searched: the flanks of narrower lobes are as steep as directions are
rounded."""


def albedos(bsdf, wi, log2_count, seed=1):
    """The directional albedos at several directions: the means of sample's weights over the same low-discrepancy
    variates. 2⁸ are good to about 1 %, 2¹⁴ to some 1e-4."""
    probe = BSDFProbe(bsdf)
    return luminance(probe.weights(probe.whole, wi, variates(log2_count, seed))).mean(axis=1)


@cache
def variates(log2_count, seed):
    """Points of the unit cube, shape (2^log2_count, 3), by other means than the checker's."""
    return np.float32(qmc.Sobol(3, seed=seed).random_base2(log2_count)).clip(0, 1 - 2**-24)


# --- The space of settings ------------------------------------------------------------------------------------------


class Axis(NamedTuple):
    """A number of the search, and its range."""

    name: str
    low: float
    high: float

    def at(self, t):
        """The value at the fraction ``t`` of the range, in steps of equal ratio far from zero."""
        if self.low > 0:
            return self.low * (self.high / self.low) ** t
        low, high = np.arcsinh([self.low, self.high])
        return np.sinh(low + (high - low) * t).clip(self.low, self.high)


VIEW = [Axis("cosine", np.cos(np.radians(STEEPEST)), 1), Axis("azimuth", 0, np.pi / 2)]


def view(cosine, azimuth):
    """The direction of view."""
    sin = np.sqrt(1 - cosine * cosine)
    return np.stack([sin * np.cos(azimuth), sin * np.sin(azimuth), cosine], axis=-1)


def axes(model, fixed: dict[str, Any]) -> list[Axis]:
    """The numbers that are not fixed, both of a pair, and the direction of view."""
    words = [value for value in fixed.values() if isinstance(value, str)]
    least = {name: value for word in words for name, value in LEAST.get(word, {}).items()}
    numbers = [p for p in flat(model.declared(), words) if isinstance(p, Number) and p.name not in fixed]
    return [
        Axis(name, max(number.limits[0], least.get(name, -np.inf)), number.limits[1])
        for number in numbers
        for name in number.pair or number.names[:1]
    ] + VIEW


def white(model) -> dict[str, float]:
    """The colours that make a model brightest: 1, and 0 for a diffuse lobe beside others."""
    colours = [p for p in flat(model.declared()) if isinstance(p, Colour)]
    return {c.name: 0.0 if c.name == "diffuse_reflectance" and len(colours) > 1 else 1.0 for c in colours}


def flat(declared, words=()) -> Iterator:
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


def choices(declared, given) -> list[dict[str, Any]]:
    """Every combination of words for the choices among some parameters, as a configuration allows."""
    combinations = [{}]
    for parameter in declared:
        if isinstance(parameter, (Choice, OneOf, Flag)):
            combinations = [one | more for one in combinations for more in words_of(parameter, given)]
    return combinations


def words_of(parameter, given) -> Iterator[dict[str, Any]]:
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


# --- The search -----------------------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """An albedo, its standard error, and where it was found: the direction of view and the numbers by name."""

    albedo: float
    noise: float
    numbers: dict[str, float]
    words: dict[str, Any]

    def __str__(self):
        theta, phi = np.degrees([np.arccos(self.numbers["cosine"]), self.numbers["azimuth"]])
        rest = self.words | {n: f"{value:.4g}" for n, value in self.numbers.items() if n not in ("cosine", "azimuth")}
        return f"{self.albedo:.5g} ± {self.noise:.0e} at {theta:.4g}°, {phi:.3g}° " + " ".join(
            f"{name}={value}" for name, value in rest.items()
        )


class Search:
    """The search among the settings of a model in white that leave something ``fixed``. A setting is a point of the
    unit cube, with a side for each axis."""

    LANES = 1 << 20

    def __init__(self, model, fixed: dict[str, Any]):
        self.fixed, self.axes = fixed, axes(model, fixed)
        self.textures = {axis.name: per_lane() for axis in self.axes if axis not in VIEW}
        self.bsdf = mi.load_dict({"type": model.plugins[0], **white(model), **fixed} | self.textures)

    def numbers(self, points):
        return {axis.name: axis.at(t) for axis, t in zip(self.axes, np.transpose(points), strict=True)}

    def albedos(self, points, log2_count, seed=1):
        """The albedos at several points."""
        at_once = self.LANES >> log2_count
        parts = [points[k : k + at_once] for k in range(0, len(points), at_once)]
        return np.concatenate([self._albedos(part, log2_count, seed) for part in parts])

    def _albedos(self, points, log2_count, seed):
        numbers = self.numbers(points)
        for name, texture in self.textures.items():
            texture.value = mi.Float(np.repeat(np.float32(numbers[name]), 1 << log2_count))
        found = albedos(self.bsdf, view(numbers["cosine"], numbers["azimuth"]), log2_count, seed)
        for texture in self.textures.values():
            texture.value = None  # what lives on is part of other kernels
        return found

    def brightest(self, climbs=16, steps=32, rounds=12, log2_counts=(9, 11)) -> Setting:
        """The brightest of several climbs from the brightest of points all over the cube. A climb tries steps in a box
        that shrinks from round to round: along some of the axes, as the others may be at their best, and in every other
        climb to what any of the climbs has found there. Cube and boxes stretch over the ends of the ranges, where most
        maxima lie. Each round has other variates, so that nothing stays at the top by their noise."""
        rng = np.random.default_rng(1)
        coarse, fine = log2_counts
        points = (1.2 * qmc.Sobol(len(self.axes), seed=1).random_base2(11) - 0.1).clip(0, 1)
        best = points[np.argsort(self.albedos(points, coarse))[-climbs:]]
        climb = np.arange(climbs)[:, None]
        for k in range(rounds):
            along = rng.random((climbs, steps, len(self.axes))) < 0.5
            step = 0.4 * 0.005 ** (k / rounds) * rng.uniform(-1, 1, along.shape)
            start = np.where(climb % 2, rng.integers(climbs, size=(climbs, steps)), climb)
            tried = np.where(along, (best[start] + step).clip(0, 1), best[:, None])
            tried = np.concatenate([best[:, None], tried], axis=1)
            found = self.albedos(np.concatenate(tried), coarse + (fine - coarse) * k // rounds, seed=2 + k)
            best = np.take_along_axis(tried, found.reshape(climbs, -1).argmax(axis=1)[:, None, None], axis=1)[:, 0]
        best = best[self.albedos(best, 14).argmax()]
        # By variates that had no part in the choice.
        found = np.concatenate([self.albedos(best[None], 14, seed) for seed in range(100, 108)])
        numbers = {name: float(value) for name, value in self.numbers(best).items()}
        return Setting(found.mean(), found.std(ddof=1) / len(found) ** 0.5, numbers, self.fixed)


def brightest(model, given: dict[str, Any], **effort) -> Setting:
    """The brightest setting among those that a configuration of the page allows."""
    found = []
    for words in choices(model.declared(), given):
        try:
            search = Search(model, given | words)
        except RuntimeError as error:
            assert "is not known for" in str(error)  # a combination that the kit refuses
            continue
        found.append(search.brightest(**effort))
    return max(found, key=lambda setting: setting.albedo)


def fault(stated: float, found: float, noise: float = 0.0, slack: float = 0.02) -> str:
    """What is wrong with an albedo that a page states, or nothing. Rounding to float32 may exceed it by 1e-4, and what
    a search has found may fall short of it by the ``slack``."""
    if stated == np.inf:
        return "" if found > 100 else "there is a limit"
    if found > stated * (1 + 1e-4) + 3 * noise:
        return "it is exceeded"
    return "" if found > (1 - slack) * stated else "it is too high"
