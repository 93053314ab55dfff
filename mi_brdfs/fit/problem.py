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
        self.targets = [_Target(material, slice(0, material.fitted), metric) for material in materials]

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The ends of the unknowns on their scales."""
        ends = np.array([u.ends for u in self.configuration.unknowns])
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

    def costs(self, which: Sequence[int] | Array, points: Array, pairs: int) -> Array:
        """Return the same sums of squares without derivatives, infinite where they are no numbers."""
        found = np.empty(len(points))
        for p, residuals, _ in self.residuals(which, self.values_of(points), pairs, derivatives=False):
            found[p] = residuals @ residuals
        return np.where(np.isfinite(found), found, np.inf)

    def residuals(
        self, which: Sequence[int] | Array, values: Array, pairs: int | None = None, derivatives: bool = True
    ) -> Iterator[tuple[int, Array, Array]]:
        """Yield ``(setting, residuals, derivatives by the unknowns)`` of the fitted pairs, of shapes (N channels,) and
        (N channels, K): their squares add to the square of the error."""
        targets = [self.targets[m] for m in which]
        given = [(t.wi[:pairs], t.wo[:pairs]) for t in targets]
        for batch in self.lanes.batches(given):
            own = slice(batch.start, batch.stop)
            model, jacobian = self.lanes.evaluate(values[own], given[own], derivatives)
            first = 0
            for p in batch:
                last = first + len(given[p][0])
                yield p, *targets[p].compared(model[first:last], jacobian[first:last])
                first = last

    def errors(self, which: Sequence[int] | Array, values: Array) -> list[dict[str, dict[str, float]]]:
        """Return the errors of settings in every metric, on the fitted pairs and on those held out."""
        found = []
        for m, setting in zip(which, values, strict=True):
            material = self.materials[m]
            model, _ = self.lanes.evaluate(setting[None], [(material.wi, material.wo)], derivatives=False)
            parts = {"fitted": slice(0, material.fitted), "held_out": slice(material.fitted, None)}
            found.append({
                name: {part: _Target(material, rows, metric).error(model[rows]) for part, rows in parts.items()}
                for name, metric in METRICS.items()
            })  # fmt: skip
        return found


class _Target:
    """Some pairs of a material, transformed as a metric does, with the roots of weights that add to 1."""

    def __init__(self, material: Observations, rows: slice, metric: Metric):
        self.metric, self.wi, self.wo = metric, material.wi[rows], material.wo[rows]
        self.factor = self.wi[:, 2:].astype(np.float64) / self.wo[:, 2:]  # of what a plugin returns, f cosθo
        self.transformed = metric.transform(material.f[rows] * self.wi[:, 2:])
        weights = metric.weights(self.wo.astype(np.float64), material.solid_angle[rows])
        weights = weights[:, None] * material.usable[rows]
        self.root = np.sqrt(weights / max(weights.sum(), 1e-300))

    def compared(self, model: Array, jacobian: Array) -> tuple[Array, Array]:
        """Return the residuals of the first pairs, as many as there are values, and their derivatives, both flat."""
        root, factor = self.root[: len(model)], self.factor[: len(model)]
        seen = model.astype(np.float64) * factor
        residuals = root * (self.metric.transform(seen) - self.transformed[: len(model)])
        scale = root * self.metric.derivative(seen) * factor
        return residuals.ravel(), (scale[..., None] * jacobian).reshape(residuals.size, jacobian.shape[-1])

    def error(self, model: Array) -> float:
        residuals, _ = self.compared(model, np.empty((*model.shape, 0)))
        return float(np.sqrt(residuals @ residuals))
