"""The axes of grids, and what lies between their nodes, for NumPy and for Dr.Jit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from .arrays import NUMPY

Interpolation = Literal["trilinear", "nearest"]
MARGIN = 1e-5
"""By how much a float32 angle may miss the end of an axis."""


@dataclass(frozen=True)
class Axis:
    """An axis of a grid: increasing ``nodes``, between which values are interpolated, in the coordinate's unit.

    It was measured from ``low`` to ``high``, by default its outer nodes; cells reach beyond their centres. An axis with
    a ``period`` goes round: all of it was measured by default, and between its last node and the first one, a period
    later, values are interpolated in any case."""

    nodes: np.ndarray
    period: float | None = None
    low: float = np.nan
    high: float = np.nan

    def __post_init__(self) -> None:
        nodes = np.asarray(self.nodes, dtype=np.float64)
        if nodes.ndim != 1 or not len(nodes) or not np.all(np.isfinite(nodes)) or np.any(np.diff(nodes) <= 0):
            raise ValueError("The nodes of an axis must increase.")
        object.__setattr__(self, "nodes", nodes)
        for name, end in (("low", nodes[0]), ("high", nodes[-1] if self.period is None else nodes[0] + self.period)):
            if np.isnan(getattr(self, name)):
                object.__setattr__(self, name, float(end))

    @property
    def looped(self) -> np.ndarray:
        """The nodes, and behind them the first one, a period later, if the axis goes round."""
        return self.nodes if self.period is None else np.append(self.nodes, self.nodes[0] + self.period)

    def steps(self, x: Any, interpolation: Interpolation, xp: SimpleNamespace = NUMPY) -> list[tuple[Any, Any]]:
        """Return ``(index, share)`` of the two nodes that places are interpolated between, or of the nearest one."""
        last = len(self.looped) - 1
        if self.period is not None:
            x = x - self.period * xp.floor((x - self.nodes[0]) * (1 / self.period))
        position = self._position(x)
        if interpolation == "nearest" or not last:
            return [(self._index(xp.integer(xp.floor(position + 0.5)), xp), 1.0)]
        below = xp.minimum(xp.floor(position), last - 1)
        k, share = xp.integer(below), position - below
        return [(k, 1 - share), (self._index(k + 1, xp), share)]

    def _position(self, x: Any) -> Any:
        """Return where values lie among the looped nodes, counted in them."""
        return np.interp(x, self.looped, np.arange(len(self.looped)))

    def _index(self, k: Any, xp: SimpleNamespace) -> Any:
        """Return the index of a looped node."""
        return xp.select(k == len(self.nodes), 0, k) if self.period is not None else k

    @property
    def whole(self) -> bool:
        """Whether all of a period was measured."""
        return self.period is not None and self.high - self.low > self.period - MARGIN

    def measured(self, x: Any, xp: SimpleNamespace = NUMPY) -> Any:
        """Return whether values lie in the measured range, up to rounding."""
        if self.whole:
            return True
        if self.period is not None:
            x = x - self.period * xp.floor((x - self.low + MARGIN) * (1 / self.period))
        return (x >= self.low - MARGIN) & (x <= self.high + MARGIN)


def corners(
    places: Iterable[tuple[Axis, Any]], interpolation: Interpolation = "trilinear", xp: SimpleNamespace = NUMPY
) -> list[tuple[Any, Any]]:
    """Return ``(index, weight)`` of the nodes that the value at a place on each axis is the sum of; indices are those
    into the flat array."""
    found: list[tuple[Any, Any]] = [(0, 1.0)]
    for axis, place in places:
        steps = axis.steps(place, interpolation, xp)
        found = [(index * len(axis.nodes) + k, weight * share) for index, weight in found for k, share in steps]
    return found
