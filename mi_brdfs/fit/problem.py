"""One configuration and several materials as sums of squares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from ..probe.arrays import Array
from .lanes import Lanes
from .metrics import METRICS, Metric
from .observations import Observations
from .solver import Normal
from .unknowns import Configuration


class Problem:
    """Materials with the same number of channels, the metric, and the model's values for them."""

    def __init__(self, configuration: Configuration, materials: Sequence[Observations], metric: Metric):
        self.configuration, self.materials, self.metric = configuration, materials, metric
        self.lanes = Lanes(configuration, materials[0].channels)
        self.targets = [_Target(material, metric) for material in materials]

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The ends of the unknowns on their scales; turns have none."""
        ends = np.array([u.ends if u.scale != "turns" else (-np.inf, np.inf) for u in self.configuration.unknowns])
        return ends[:, 0], ends[:, 1]

    def values_of(self, points: Array) -> Array:
        """Return the values of the unknowns at points of shape (…, K) on their scales."""
        columns = [u.from_scale(points[..., k]) for k, u in enumerate(self.configuration.unknowns)]
        return np.stack(columns, axis=-1)

    def sums(self, which: Sequence[int] | Array, points: Array, pairs: int | None = None) -> Normal:
        """Return the sums over the fitted pairs of some materials, or the first of them, at points of shape (P, K)."""
        count, unknowns = len(points), points.shape[1]
        found = Normal(np.zeros(count), np.zeros((count, unknowns)), np.zeros((count, unknowns, unknowns)))
        values = self.values_of(points)
        slopes = np.stack([u.slope(values[:, k]) for k, u in enumerate(self.configuration.unknowns)], axis=-1)
        for p, residuals, jacobian in self.residuals(which, values, pairs):
            found.cost[p] = residuals @ residuals
            found.gradient[p] = jacobian.T @ residuals * slopes[p]
            found.matrix[p] = jacobian.T @ jacobian * np.outer(slopes[p], slopes[p])
        return found

    def residuals(
        self, which: Sequence[int] | Array, values: Array, pairs: int | None = None
    ) -> Iterator[tuple[int, Array, Array]]:
        """Yield ``(setting, residuals, derivatives by the unknowns)`` of the fitted pairs, of shapes (N channels,) and
        (N channels, K): their squares add to the square of the error."""
        targets = [self.targets[m] for m in which]
        given = [(t.fitted[0][:pairs], t.fitted[1][:pairs]) for t in targets]
        for batch in self.lanes.batches(given):
            own = targets[batch.start : batch.stop]
            model, jacobian = self.lanes.evaluate(values[batch.start : batch.stop], given[batch.start : batch.stop])
            first = 0
            for p, target in zip(batch, own, strict=True):
                last = first + len(given[p][0])
                yield p, *target.compared(model[first:last], jacobian[first:last], self.metric)
                first = last

    def costs(self, which: Sequence[int] | Array, values: Array, pairs: int) -> Array:
        """Return the squares of the errors on the first of the fitted pairs alone."""
        targets, found = [self.targets[m] for m in which], np.empty(len(values))
        given = [(t.fitted[0][:pairs], t.fitted[1][:pairs]) for t in targets]
        for batch in self.lanes.batches(given):
            own = given[batch.start : batch.stop]
            model, _ = self.lanes.evaluate(values[batch.start : batch.stop], own, derivatives=False)
            first = 0
            for p, (wi, _) in zip(batch, own, strict=True):
                found[p] = targets[p].cost(model[first : first + len(wi)], self.metric)
                first += len(wi)
        return np.where(np.isfinite(found), found, np.inf)

    def errors(self, which: Sequence[int] | Array, values: Array) -> list[dict[str, dict[str, float]]]:
        """Return the errors of settings in every metric, on the fitted pairs and on those held out."""
        found = []
        for m, setting in zip(which, values, strict=True):
            material = self.materials[m]
            model = np.concatenate([
                self.lanes.evaluate(setting[None], [(material.wi[batch], material.wo[batch])], derivatives=False)[0]
                for batch in np.array_split(np.arange(len(material.wi)), -(-len(material.wi) // 65536))
            ])  # fmt: skip
            parts = {"fitted": slice(0, material.fitted), "held_out": slice(material.fitted, None)}
            found.append({
                name: {part: _error(material, model, rows, metric) for part, rows in parts.items()}
                for name, metric in METRICS.items()
            })  # fmt: skip
        return found


class _Target:
    """The fitted pairs of a material, transformed as a metric does."""

    def __init__(self, material: Observations, metric: Metric):
        rows = slice(0, material.fitted)
        self.fitted = material.wi[rows], material.wo[rows]
        self.factor = _cosines(material)[rows]
        self.transformed = metric.transform(material.f[rows] * material.wi[rows, 2:])
        self.root = np.sqrt(_weights(material, metric, rows))

    def compared(self, model: Array, jacobian: Array, metric: Metric) -> tuple[Array, Array]:
        """Return the residuals and their derivatives by the unknowns, flat, of the first of the pairs, as many as there
        are values."""
        root, factor = self.root[: len(model)], self.factor[: len(model)]
        seen = model.astype(np.float64) * factor
        residuals = root * (metric.transform(seen) - self.transformed[: len(model)])
        scale = root * metric.derivative(seen) * factor
        return residuals.ravel(), (scale[..., None] * jacobian).reshape(residuals.size, -1)

    def cost(self, model: Array, metric: Metric) -> float:
        """Return the square of the error on the first of the pairs, as many as there are values."""
        n = len(model)
        root, seen = self.root[:n], model.astype(np.float64) * self.factor[:n]
        difference = root * (metric.transform(seen) - self.transformed[:n])
        return float((difference**2).sum() / max((root**2).sum(), 1e-300))


def _cosines(material: Observations) -> Array:
    """Return cosθi / cosθo, which turns what a plugin returns into what metrics compare."""
    return material.wi[:, 2:].astype(np.float64) / material.wo[:, 2:]


def _weights(material: Observations, metric: Metric, rows: slice) -> Array:
    """Return weights that add to 1, shape (N, channels)."""
    weights = metric.weights(material.wo[rows].astype(np.float64), material.solid_angle[rows])
    weights = weights[:, None] * material.usable[rows]
    return weights / max(weights.sum(), 1e-300)


def _error(material: Observations, model: Array, rows: slice, metric: Metric) -> float:
    seen = (model.astype(np.float64) * _cosines(material))[rows]
    difference = metric.transform(seen) - metric.transform((material.f * material.wi[:, 2:])[rows])
    return float(np.sqrt((_weights(material, metric, rows) * difference**2).sum()))
