"""The largest directional albedo of a model: a search over the direction of view and all of its free numbers; and what
its class states of it, rounded and compared.

A setting is a point of the unit cube, with a side for each axis (:mod:`.parameter_space`). The search takes the
brightest of a Latin hypercube of points, and climbs from each by steps that shrink. Free numbers are textures with a
value for each lane, so that one kernel evaluates thousands of settings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor, inf, isinf, log10
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from ..model import Energy, Model
from .arrays import Array, floats, held, luminance, per_lane
from .bsdf import BSDFProbe
from .directions import angles_of, direction
from .parameter_space import VIEW, accepted, axes, load, view
from .variates import sobol

LANES = 1 << 20
"""Samples drawn at once."""
STARTS = 2048
"""Points of the cube that are tried first."""
CLIMBS, STEPS, ROUNDS = 16, 32, 12
"""The number of climbs, of the steps that each tries in a round, and of rounds."""
LOG2_COUNTS = 9, 11
"""Samples for each setting, at first and in the last round."""
LOG2_CHOICE, LOG2_FINAL = 14, 17
"""Samples that decide among the ends of the climbs, and those that measure the brightest for each of the seeds."""
SEEDS = range(100, 108)
"""Seeds of variates that have no part in the choice."""


class Maximum(NamedTuple):
    """An albedo, its standard error, and where it was found: direction of view, free numbers, and what was given."""

    albedo: float
    noise: float
    numbers: dict[str, float]
    given: dict[str, Any]

    @property
    def place(self) -> str:
        """Where it was found, in words."""
        wi = view(np.array(self.numbers["cosine"]), np.array(self.numbers["azimuth"]))
        free = {name: f"{value:.4g}" for name, value in self.numbers.items() if name not in ("cosine", "azimuth")}
        return ", ".join([angles_of(wi), *(f"{name} = {value}" for name, value in (self.given | free).items())])


def albedos(bsdf: mi.BSDF, wi: Array, log2_count: int, seed: int = 1) -> Array:
    """Return the directional albedos at directions of shape (N, 3): the means of sample's weights over the same 2^n
    variates. 2⁸ are good to about 1 %, 2¹⁴ to some 1e-4. Raise a ValueError if one is not a number."""
    probe = BSDFProbe(bsdf)
    found = luminance(probe.weights(probe.whole, wi, sobol(log2_count, seed))).mean(axis=1)
    if np.isnan(found).any():
        raise ValueError(f"the albedo is not a number at {angles_of(wi[np.isnan(found).argmax()])}")
    return found


def default_albedo(model: type[Model]) -> float:
    """Return the largest albedo of the default parameters, at some angles up to 89.9°."""
    angles = [0, 20, 40, 60, 70, 75, 80, 83, 86, 88, 89, 89.5, 89.9]
    wi = np.array([direction(angle, azimuth) for angle in angles for azimuth in (0, 45, 90)])
    bsdf = mi.load_dict({"type": model.plugins[0]})
    brightest = wi[[albedos(bsdf, wi, LOG2_CHOICE).argmax()]]
    return float(np.mean([albedos(bsdf, brightest, LOG2_FINAL, seed) for seed in SEEDS]))


def largest_albedo(model: type[Model], given: Mapping[str, Any]) -> Maximum:
    """Return the brightest setting of a model in white over all that is not ``given``, where a tuple stands for each of
    its words. What the plugin refuses is left out; raise a ValueError if it refuses all."""
    found = [_Search(model, setting).run() for setting in accepted(model, given)]
    return max(found, key=lambda setting: setting.albedo)


class _Search:
    """The search among the settings of a model in white whose choices are all given."""

    def __init__(self, model: type[Model], given: dict[str, Any]):
        self.given, self.axes = given, axes(model, given)
        self.textures = {axis.name: per_lane() for axis in self.axes if axis not in VIEW}
        self.bsdf = load(model, given, self.textures)
        self.rng = np.random.default_rng(1)

    def run(self) -> Maximum:
        """Return the brightest setting. Climb from the brightest of a Latin hypercube of points."""
        strata = self.rng.permuted(np.tile(np.arange(STARTS), (len(self.axes), 1)), axis=1).T
        # It stretches over the ends of the ranges, where most maxima lie, as the steps do.
        points = (1.2 * (strata + 0.5) / STARTS - 0.1).clip(0, 1)
        best = points[np.argsort(self._albedos(points, LOG2_COUNTS[0]))[-CLIMBS:]]
        first, last = LOG2_COUNTS
        for k in range(ROUNDS):
            tried = self._tried(best, k)
            # By other variates in each round: nothing stays at the top by their noise.
            found = self._albedos(np.concatenate(tried), first + (last - first) * k // ROUNDS, seed=2 + k)
            best = tried[np.arange(CLIMBS), found.reshape(CLIMBS, -1).argmax(axis=1)]
        brightest = best[self._albedos(best, LOG2_CHOICE).argmax()]
        measured = np.concatenate([self._albedos(brightest[None], LOG2_FINAL, seed) for seed in SEEDS])
        numbers = {name: float(value) for name, value in self._numbers(brightest).items()}
        noise = float(measured.std(ddof=1)) / len(measured) ** 0.5
        return Maximum(float(measured.mean()), noise, numbers, self.given)

    def _tried(self, best: Array, k: int) -> Array:
        """Return what each climb tries in a round, shape (climbs, 1 + steps, axes): where it is, and steps along some
        of the axes, as the others may be at their best; in every other climb from where any of the climbs is."""
        along = self.rng.random((CLIMBS, STEPS, len(self.axes))) < 0.5
        step = 0.4 * 0.005 ** (k / ROUNDS) * self.rng.uniform(-1, 1, along.shape)
        own = np.arange(CLIMBS)[:, None]
        start = np.where(own % 2, self.rng.integers(CLIMBS, size=(CLIMBS, STEPS)), own)
        moved = np.where(along, (best[start] + step).clip(0, 1), best[:, None])
        return np.concatenate([best[:, None], moved], axis=1)

    def _numbers(self, points: Array) -> dict[str, Array]:
        return {axis.name: axis.at(t) for axis, t in zip(self.axes, np.transpose(points), strict=True)}

    def _albedos(self, points: Array, log2_count: int, seed: int = 1) -> Array:
        """Return the albedos at points of shape (N, axes)."""
        at_once = LANES >> log2_count
        batches = [points[k : k + at_once] for k in range(0, len(points), at_once)]
        return np.concatenate([self._batch(batch, log2_count, seed) for batch in batches])

    def _batch(self, points: Array, log2_count: int, seed: int) -> Array:
        numbers = self._numbers(points)
        lanes = {name: floats(np.repeat(numbers[name], 1 << log2_count)) for name in self.textures}
        with held(self.textures, lanes):
            return albedos(self.bsdf, view(numbers["cosine"], numbers["azimuth"]), log2_count, seed)


# --- What a class states --------------------------------------------------------------------------------------------


ROUNDING = 1e-4
"""What float32 may exceed a limit by, relatively."""
SLACK = 0.02
"""What a search may fall short of the largest albedo by, relatively."""
NO_LIMIT = 100
"""What is above counts as infinite."""

Row = tuple[dict[str, Any], float]


def configurations(model: type[Model]) -> list[dict[str, Any]]:
    """Return the choices for which a model's class states the largest albedo, or all choices if it states none."""
    return [given for given, _ in model.energy.largest] if model.energy else accepted(model, {})


def energy_of(model: type[Model], default: float, found: Iterable[tuple[dict[str, Any], Maximum]]) -> Energy:
    """Return what a model's class should state, by the largest albedo of its defaults and of its configurations."""
    rows = [(given, rounded_up(setting.albedo, setting.noise)) for given, setting in found]
    return Energy(rounded_up(default), rows if model.energy else merged(rows))


def rounded_up(albedo: float, noise: float = 0.0) -> float:
    """Return the least number of three digits that an albedo does not exceed, or 1 if nothing but noise does."""
    if albedo > NO_LIMIT:
        return inf
    if albedo > 1 and not fault(1, albedo, noise):
        return 1.0
    least = albedo / (1 + ROUNDING)
    decimals = 2 - floor(log10(least)) if least > 0 else 0
    return round(ceil(least * 10**decimals) / 10**decimals, decimals)


def fault(stated: float, found: float, noise: float = 0.0) -> str:
    """Return what is wrong with a largest albedo that is stated, by what was found; or nothing."""
    if isinf(stated):
        return "" if found > NO_LIMIT else "there is a limit"
    if not found <= stated * (1 + ROUNDING) + 3 * noise:
        return "it is exceeded"
    return "" if found >= (1 - SLACK) * stated else "it is too high"


def merged(rows: Sequence[Row]) -> list[Row]:
    """Return fewer rows that say the same of combinations of words: a choice that makes no difference is left out, and
    words that make none stand together in a tuple."""
    fewer: list[Row] = []
    rest = list(rows)
    while rest:
        given: dict[str, Any] = {name: (word,) for name, word in rest[0][0].items()}
        for name in reversed(rest[0][0]):
            without = {other: words for other, words in given.items() if other != name}
            given = without if _is_row(without, rows, rest) else given
        for name in given:
            for word in dict.fromkeys(words[name] for words, _ in rest if name in words):
                wider = {**given, name: (*given[name], word)}
                given = wider if word not in given[name] and _is_row(wider, rows, rest) else given
        largest = max(albedo for words, albedo in rest if _covers(given, words))
        rest = [row for row in rest if not _covers(given, row[0])]
        fewer.append(({name: words if len(words) > 1 else words[0] for name, words in given.items()}, largest))
    return fewer


def _is_row(given: Mapping[str, Any], rows: Sequence[Row], rest: Sequence[Row]) -> bool:
    """Return whether a row may stand for all combinations that it covers: they are among the rest, have all of its
    choices and nearly the same albedo."""
    covered = [row for row in rows if _covers(given, row[0])]
    least, most = (pick(albedo for _, albedo in covered) for pick in (min, max))
    same = least >= (1 - SLACK) * most and (least <= 1) == (most <= 1)
    return same and all(row in rest and given.keys() <= row[0].keys() for row in covered)


def _covers(given: Mapping[str, Any], words: Mapping[str, Any]) -> bool:
    """Return whether no choice of a combination contradicts a row."""
    return all(words[name] in allowed for name, allowed in given.items() if name in words)
