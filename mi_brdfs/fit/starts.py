"""Where fits start: at settings that suit the data best among many, at random ones, and at published materials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..mitsuba.registry import MODELS, presets
from ..parameters.published import preset
from ..probe.arrays import Array
from .observations import Observations
from .problem import Problem
from .solver import solve
from .unknowns import Configuration, Unknown, default_words

CANDIDATES = 256
"""Settings that are compared with the data, of a Latin hypercube."""
ADVANCED, STEPS = 32, 8
"""How many of them go on by some steps, and by how many: the best of the candidates may be near to no good end."""
COMPARED = 512
"""The pairs of directions at which they are."""
DIFFUSE = "diffuse_reflectance"
"""The colour that is guessed from the darker directions."""


def candidates(problem: Problem, material: Observations, rng: np.random.Generator) -> Array:
    """Return points of shape (CANDIDATES, K) that fill the ranges, but for colours, which have the hue of the data, and
    the diffuse one, which has also their level."""
    unknowns = problem.configuration.unknowns
    strata = rng.permuted(np.tile(np.arange(CANDIDATES), (len(unknowns), 1)), axis=1).T
    shares = (strata + rng.random(strata.shape)) / CANDIDATES
    hue, level = _hue_and_level(material)
    jitter = {u.name: rng.normal(0, 0.5, CANDIDATES) for u in unknowns}
    first = {u.name: k for k, u in reversed(list(enumerate(unknowns)))}
    points = np.empty(shares.shape)
    for k, unknown in enumerate(unknowns):
        low, high = _spread(unknown)
        u = low + (high - low) * shares[:, first[unknown.name]]
        if unknown.quantity.colour:
            channel = unknown.channel or 0
            x = unknown.from_scale(u) * hue[channel]
            if unknown.name == DIFFUSE:
                x = level[channel] * np.exp(jitter[unknown.name])
            u = unknown.to_scale(x)
        points[:, k] = u
    return points


def _spread(unknown: Unknown) -> tuple[float, float]:
    """Return from where to where an unknown is tried on its scale."""
    low, high = unknown.ends
    if unknown.scale == "logit":
        return max(low, -4), min(high, 3)
    if unknown.scale == "log" and unknown.quantity.colour:
        return max(low, np.log(1e-3)), min(high, np.log(1e3))
    if unknown.scale == "turns":
        return -np.pi, np.pi
    return low, high


def _hue_and_level(material: Observations) -> tuple[Array, Array]:
    """Return the colour of the mean of f cosθo, its largest channel 1, and π times f at its 30th percentile."""
    rows = slice(0, material.fitted)
    f, usable = material.f[rows], material.usable[rows]
    mean = (f * usable * material.wo[rows, 2:]).sum(axis=0) / np.maximum(usable.sum(axis=0), 1)
    dark = [np.quantile(f[usable[:, c], c], 0.3) if usable[:, c].any() else 0 for c in range(f.shape[1])]
    return np.clip(mean / max(mean.max(), 1e-30), 1e-2, 1), np.clip(np.pi * np.array(dark), 1e-4, 0.99)


def warm(configuration: Configuration, given: Mapping[str, Any]) -> dict[int, float] | None:
    """Return the unknowns that a plugin dict gives, by index; None if it has what they do not describe."""
    usual, found = default_words(configuration.model) | configuration.words, dict[int, float]()
    for name, value in given.items():
        if name == "type":
            if value not in configuration.model.plugins:
                return None
            continue
        indices = configuration.indices(name) if name in configuration.names else []
        if not indices:
            if configuration.given.get(name, usual.get(name)) != value:
                return None
            continue
        numbers = np.ravel(value["value"] if isinstance(value, dict) else value).astype(float)
        if len(numbers) != len(indices):
            numbers = np.full(len(indices), numbers.mean())
        found |= dict(zip(indices, map(float, numbers), strict=True))
    return found


def published(configuration: Configuration) -> list[dict[int, float]]:
    """Return the published materials that the unknowns describe."""
    if MODELS.get(configuration.plugin) is not configuration.model:
        return []
    found = (warm(configuration, preset(name)) for name in presets(configuration.plugin))
    return [values for values in found if values]


def starts(problem: Problem, count: int, given: list[Mapping[str, Any]], seed: int) -> tuple[Array, Array, int]:
    """Return ``(materials, points, warm)``: the index of the material of each start, the points of shape (P, K), and
    how many of a material's starts, its first ones, are warm: those that are ``given``, and the best published one.
    Half of the other ``count`` are the candidates that suit the data best after some steps on a part of them, and half
    are any of these."""
    configuration = problem.configuration
    unknowns = len(configuration.unknowns)
    known = published(configuration)
    own = [values for values in (warm(configuration, each) for each in given) if values is not None]
    owners, points = [], []
    for m, material in enumerate(problem.materials):
        rng = np.random.default_rng(seed)  # the same with other materials beside
        tried = _advanced(problem, m, candidates(problem, material, rng), max(ADVANCED, 2 * count), rng)
        order = _best_first(problem, m, tried)
        chosen = [_completed(problem, tried[order[0]], values) for values in own]
        if known:
            warm_points = np.array([_completed(problem, tried[order[0]], values) for values in known])
            chosen.append(warm_points[_best_first(problem, m, warm_points)[0]])
        best = -(-count // 2)
        rest = order[best:]  # none, where more starts are asked for than there are candidates
        others = rng.choice(rest, min(count - best, len(rest)), replace=False)
        chosen += [tried[k] for k in (*order[:best], *others)]
        owners += [m] * len(chosen)
        points += chosen
    return np.array(owners), np.array(points).reshape(-1, unknowns), len(own) + bool(known)


def _advanced(problem: Problem, m: int, tried: Array, count: int, rng: np.random.Generator) -> Array:
    """Return some of the candidates, half of them the best ones, some steps on."""
    order = _best_first(problem, m, tried)
    best = order[: count // 2]
    others = rng.choice(order[len(best) :], min(count - len(best), len(order) - len(best)), replace=False)
    points = tried[[*best, *others]]
    low, high = problem.box
    return solve(lambda which, at: problem.sums([m] * len(which), at, COMPARED), points, low, high, steps=STEPS)[0]


def _best_first(problem: Problem, m: int, points: Array) -> Array:
    return np.argsort(problem.costs([m] * len(points), points, COMPARED), kind="stable")


def _completed(problem: Problem, point: Array, values: dict[int, float]) -> Array:
    """Return a point with some unknowns at given values."""
    point = point.copy()
    for k, value in values.items():
        point[k] = problem.configuration.unknowns[k].to_scale(value)
    return point
