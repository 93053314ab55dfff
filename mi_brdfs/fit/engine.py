"""Fits of one configuration to several materials, all in the same kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from ..probe.arrays import Array, luminance
from .metrics import METRICS
from .observations import Data, Observations
from .problem import Problem
from .result import Fit, Starts
from .solver import solve
from .starts import starts
from .unknowns import Configuration

AGREEMENT = 1.02
"""The error, relative to the best, up to which a start agrees with it."""

BLIND = 1e-10
"""The part of the largest eigenvalue of JᵀJ, its columns of length 1, below which a direction is rounding."""


def fit_configuration(
    configuration: Configuration,
    materials: Sequence[Observations],
    metric: str,
    count: int,
    given: list[Mapping[str, Any]],
    seed: int,
    advance: Callable[[int], None],
) -> list[Fit]:
    """Return the best fit for each of some materials with the same number of channels."""
    problem = Problem(configuration, materials, METRICS[metric])
    owners, points, warm = starts(problem, count, given, seed)
    low, high = problem.box
    points, costs = solve(lambda which, at: problem.sums(owners[which], at), points, low, high, advance)
    best = [int(np.flatnonzero(owners == m)[costs[owners == m].argmin()]) for m in range(len(materials))]
    # At the end of its range a number may take the influence of another one: near to it this has some.
    found = np.array([configuration.shown(x) for x in problem.values_of(points[best])])
    every = range(len(materials))
    errors = problem.errors(every, found)
    spread = [_uncertainty(problem, found[m], *sums) for m, *sums in problem.residuals(every, found)]
    fits = []
    for m, material in enumerate(materials):
        x, own = found[m], costs[owners == m]
        residuals = int(material.usable[: material.fitted].sum())
        fits.append(Fit(
            **{it.name: getattr(material, it.name) for it in fields(Data)},
            model=configuration.title,
            metric=metric,
            bsdf=configuration.bsdf(x),
            errors=errors[m],
            **spread[m],
            starts=Starts(len(own), warm, int((own <= AGREEMENT**2 * own.min() + 1e-16).sum())),
            bic=float(residuals * np.log(max(own.min(), 1e-300)) + len(x) * np.log(residuals)),
            pairs=material.fitted,
            in_highlight=_in_highlight(problem, material, x),
            fixed=configuration.fixed,
        ))  # fmt: skip
    return fits


def _uncertainty(problem: Problem, values: Array, residuals: Array, jacobian: Array) -> dict[str, Any]:
    """Return what a fit says of its uncertainty (``bounds``, ``sigma``, ``correlations`` and ``undetermined``), from
    the Jacobian and from how far the data are from the model at each pair of directions, so that noise may differ from
    pair to pair and be common to the channels.

    Unknowns at the end of their range are anywhere in it as far as the data allow: where the others stand depends on
    that. They are given the variance of a uniform distribution beforehand.

    J. G. MacKinnon, H. White, Some heteroskedasticity-consistent covariance matrix estimators with improved finite
    sample properties, Journal of Econometrics 29(3), 1985, doi:10.1016/0304-4076(85)90158-7.
    """
    unknowns, channels = problem.configuration.unknowns, problem.lanes.channels
    residuals, jacobian = np.nan_to_num(residuals), np.nan_to_num(jacobian)
    labels, ended = [u.label for u in unknowns], [u.at_end(float(x)) for u, x in zip(unknowns, values, strict=True)]
    scale = np.sqrt((jacobian**2).sum(axis=0))
    scale = np.where(scale > 0, scale, 1)
    scaled = jacobian / scale
    normal = scaled.T @ scaled
    lengths, axes = np.linalg.eigh(normal)
    blind = lengths <= BLIND * lengths.max()
    lost = (np.abs(axes[:, blind]) > 0.1).any(axis=1)
    ranges, variance = np.array([u.high - u.low for u in unknowns]), residuals @ residuals / len(residuals)
    before = np.diag(np.where(ended, 12 * variance / (ranges * scale) ** 2, 0))
    lengths, axes = np.linalg.eigh(normal + before)
    bread = (axes / np.where(lengths <= BLIND * lengths.max(), np.inf, lengths)) @ axes.T
    leverage = ((scaled @ bread) * scaled).sum(axis=1).reshape(-1, channels).sum(axis=1)
    scores = (scaled * residuals[:, None]).reshape(len(leverage), channels, -1).sum(axis=1)
    scores = scores / np.maximum(1 - leverage, 0.1)[:, None]  # a pair with weight pulls the model to itself
    covariance = bread @ (scores.T @ scores + variance * before) @ bread / np.outer(scale, scale)
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0))
    ratio = covariance / np.maximum(np.outer(deviations, deviations), 1e-300)
    lost |= deviations > ranges
    lost |= np.count_nonzero(jacobian.any(axis=1)) <= len(unknowns)  # through so few values goes any model
    known = [k for k in range(len(unknowns)) if not ended[k] and not lost[k]]
    rows = {labels[k]: {labels[j]: float(np.clip(ratio[k, j], -1, 1)) for j in known} for k in known}
    sigma: dict[str, Any] = {}
    for name in problem.configuration.names:
        own = [float(deviations[k]) if k in known else None for k in problem.configuration.indices(name)]
        sigma[name] = own[0] if len(own) == 1 else own
    bounds, undetermined = ([labels[k] for k in np.flatnonzero(it)] for it in (ended, lost))
    return {"bounds": bounds, "sigma": sigma, "correlations": rows, "undetermined": undetermined}


def _in_highlight(problem: Problem, material: Observations, x: Array) -> int:
    """Return the number of pairs of directions with more than half of the value at the mirror direction."""
    mirror = material.wi * np.array([-1, -1, 1], np.float32)
    settings, count = np.stack([x, x]), len(material.wi)
    pairs = [(material.wi, material.wo), (material.wi, mirror)]
    values, _ = problem.lanes.evaluate(settings, pairs, derivatives=False)
    values = luminance(values)
    own, at_mirror = values[:count] / material.wo[:, 2], values[count:] / mirror[:, 2]
    return int((own > 0.5 * at_mirror).sum())
