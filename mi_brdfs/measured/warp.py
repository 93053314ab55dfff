"""The inversion method for tabulated densities on the unit square: in NumPy, and as Mitsuba's own classes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import getitem
from typing import Any

import mitsuba as mi
import numpy as np

from .grid import Axis, corners


class Warp:
    """Map the unit square onto itself so that uniform points get a density that is bilinear between its values on a
    regular grid, shape (nodes of each parameter, rows, columns). Between the nodes of further parameters the normalized
    densities are interpolated.

    The method is that of Mitsuba's ``MarginalContinuous2D``, in float64: the marginal density picks y, the conditional
    one x.
    """

    def __init__(self, density: np.ndarray, nodes: Sequence[np.ndarray]) -> None:
        height, width = density.shape[-2:]
        slices = density.reshape(-1, height, width).astype(np.float64)
        rows = cumulated(slices)
        columns = cumulated(rows[..., -1])
        total = columns[:, -1:].copy()
        for table in (slices, rows):
            table /= total[..., None]
        columns /= total
        self._density, self._rows, self._columns = slices, rows, columns
        self._axes = [Axis(each) for each in nodes]

    def invert(self, x: np.ndarray, y: np.ndarray, parameters: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
        """Return the uniform point that is mapped to (x, y)."""
        look = self._interpolated(parameters)
        height, width = self._density.shape[1:]
        row, y = patch(y, height)
        column, x = patch(x, width)
        low, high = (self._across(look, self._density, row, y)(column + step) for step in (0, 1))
        along = self._across(look, self._rows, row, y)
        u = (along(column) + integral(x, low, high) / (width - 1)) / along(width - 1)
        low, high = (look(self._rows, row + step, width - 1) for step in (0, 1))
        return u, look(self._columns, row) + integral(y, low, high) / (height - 1)

    def sample(self, u: np.ndarray, v: np.ndarray, parameters: Sequence[Any]) -> tuple[np.ndarray, ...]:
        """Return the point (x, y) to which the uniform point (u, v) is mapped, and the density there."""
        look = self._interpolated(parameters)
        height, width = self._density.shape[1:]
        row = last_below(lambda k: look(self._columns, k), v, height)
        low, high = (look(self._rows, row + step, width - 1) for step in (0, 1))
        y = end_of(low, high, (v - look(self._columns, row)) * (height - 1))
        along = self._across(look, self._rows, row, y)
        u = u * along(width - 1)
        column = last_below(along, u, width)
        low, high = (self._across(look, self._density, row, y)(column + step) for step in (0, 1))
        x = end_of(low, high, (u - along(column)) * (width - 1))
        return (column + x) / (width - 1), (row + y) / (height - 1), (1 - x) * low + x * high

    def _interpolated(self, parameters: Sequence[Any]) -> Callable[..., Any]:
        """Return a look-up in tables of all slices at an index, interpolated between the slices."""
        slices = corners(zip(self._axes, parameters, strict=True))
        return lambda table, *index: sum(weight * getitem(table, (slice, *index)) for slice, weight in slices)

    @staticmethod
    def _across(look: Callable[..., Any], table: np.ndarray, row: Any, y: Any) -> Callable[[Any], Any]:
        """Return a look-up by column between two rows."""
        return lambda column: (1 - y) * look(table, row, column) + y * look(table, row + 1, column)


class MitsubaWarp:
    """The same for Dr.Jit, in the active variant."""

    def __init__(self, density: np.ndarray, nodes: Sequence[np.ndarray]) -> None:
        kind = {1: mi.MarginalContinuous2D1, 2: mi.MarginalContinuous2D2}[len(nodes)]
        self.table = kind(density, [axis.tolist() for axis in nodes])
        self._parameters = {1: mi.Vector1f, 2: mi.Vector2f}[len(nodes)]

    def invert(self, x: Any, y: Any, parameters: Sequence[Any]) -> tuple[Any, Any]:
        uniform, _ = self.table.invert(mi.Point2f(x, y), self._parameters(*parameters))
        return uniform.x, uniform.y


class Map:
    """Values on a regular grid over the unit square, shape (rows, columns), interpolated between."""

    def __init__(self, values: np.ndarray) -> None:
        self._values = values.astype(np.float64).ravel()
        self._axes = [Axis(np.linspace(0, 1, count)) for count in values.shape]

    def eval(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return sum(weight * self._values[k] for k, weight in corners(zip(self._axes, (y, x), strict=True)))


class MitsubaMap:
    """The same for Dr.Jit, in the active variant."""

    def __init__(self, values: np.ndarray) -> None:
        self.table = mi.MarginalContinuous2D0(values, normalize=False, enable_sampling=False)

    def eval(self, x: Any, y: Any) -> Any:
        return self.table.eval(mi.Point2f(x, y))


def cumulated(values: np.ndarray) -> np.ndarray:
    """Return the integrals over [0, 1] of piecewise linear functions up to each of their nodes, the last axis."""
    result = np.zeros_like(values)
    for slice, sums in zip(values, result, strict=True):  # for want of memory not all at once
        np.cumsum((slice[..., 1:] + slice[..., :-1]) / (2 * (values.shape[-1] - 1)), axis=-1, out=sums[..., 1:])
    return result


def patch(x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return between which of ``count`` nodes a number in [0, 1] lies, and where between the two."""
    position = np.clip(x, 0, 1) * (count - 1)
    below = np.minimum(position.astype(np.int64), count - 2)
    return below, position - below


def integral(t: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the integral over [0, t] of what goes from ``low`` to ``high`` over [0, 1]."""
    return t * (low + 0.5 * t * (high - low))


def end_of(low: np.ndarray, high: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return t of an :func:`integral`, by the root of its quadratic that does not cancel."""
    root = low + np.sqrt(np.maximum(low * low + 2 * area * (high - low), 0))
    return np.clip(2 * area / np.maximum(root, np.finfo(np.float64).tiny), 0, 1)


def last_below(table: Callable[[Any], np.ndarray], value: np.ndarray, count: int) -> np.ndarray:
    """Return the last of an increasing table's nodes, but for its outermost one, that is not above a value."""
    low, high = np.zeros(np.shape(value), dtype=np.int64), np.full(np.shape(value), count - 1)
    for _ in range(int(count).bit_length()):
        middle = (low + high) // 2
        below = (table(middle) <= value) & (middle < count - 1)
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return low
