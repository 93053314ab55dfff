"""The largest directional albedo of a model: a search over the direction of view and all of its free numbers.

A setting is a point of the unit cube, with a side for each axis (:mod:`.parameter_space`). The search takes the
brightest of a Latin hypercube of points, and climbs from each by steps that shrink. Free numbers are textures with a
value for each lane, so that one kernel evaluates thousands of settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import mitsuba as mi
import numpy as np

from .arrays import Array, floats, held, luminance, per_lane
from .bsdf import BSDFProbe
from .directions import angles_of, direction
from .parameter_space import VIEW, accepted, axes, load, view
from .variates import sobol

if TYPE_CHECKING:
    from ..model import Model

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
