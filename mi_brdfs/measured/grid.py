"""Measured values on a grid: its axes, and what lies between their nodes, for NumPy and for Dr.Jit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from .arrays import NUMPY, components, stacked
from .coordinates import Coordinates

Interpolation = Literal["trilinear", "nearest"]
Extrapolation = Literal["hold", "zero"]
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


@dataclass(frozen=True)
class Grid:
    """Values at the nodes of axes, shape (nodes of each axis in the order of ``coordinates.names``, channels): f up to
    the scale of the coordinates."""

    coordinates: Coordinates
    axes: tuple[Axis, ...]
    values: np.ndarray
    signed: bool = False
    """Whether negative channels are colours outside sRGB, and not errors."""
    is_closed: bool = False
    """Whether this is the ``closed`` one."""

    def __post_init__(self) -> None:
        shape = tuple(len(axis.nodes) for axis in self.axes)
        if len(self.axes) != len(self.coordinates.names) or self.values.shape[:-1] != shape:
            raise ValueError(f"Values of shape {self.values.shape} do not fit axes of {shape} nodes.")

    @property
    def anisotropic(self) -> bool:
        return self.coordinates.anisotropic

    def pairs(self, chosen: np.ndarray | slice = slice(None)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ``(wi, wo, f)`` of all nodes, also of those below the horizon, or of some by their indices into the
        flat array: shapes (N, 3), (N, 3) and (N, channels)."""
        shape = self.values.shape[:-1]
        indices = np.unravel_index(np.arange(math.prod(shape))[chosen], shape)
        places = (axis.nodes[index] for axis, index in zip(self.axes, indices, strict=True))
        wi, wo = self.coordinates.directions(*places)
        _, scale = self.coordinates.locate_scaled(wi, wo, NUMPY)
        values = self.values.reshape(-1, self.values.shape[-1])[chosen]
        return stacked(wi), stacked(wo), np.reshape(scale, (-1, 1)) * values

    def measured(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Return whether unit vectors of shape (…, 3), or (3,) for one wi and many wo, are above the horizon, on all
        axes in the range that was measured, and nearest to a node with values in all channels: shape (…).

        Raises:
            ValueError: if a direction is no unit vector.
        """
        light, view = components(wi), components(wo)
        places, _ = self.coordinates.locate_scaled(light, view, NUMPY)
        inside, nearest = (light.z > 0) & (view.z > 0), []
        for axis, place in zip(self.axes, places, strict=True):
            inside = inside & axis.measured(place)
            nearest.append(axis.steps(place, "nearest")[0][0])
        return inside & self._known[tuple(nearest)]

    def seen(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Return whether directions were measured, and the value there is of no node that is missing or 0, unless all
        are: files have zeros where an instrument saw nothing."""
        measured = self.measured(wi, wo)
        if self._lit is None:
            return measured
        lit, all_lit = np.moveaxis(self._lit.evaluate(wi, wo), -1, 0)
        return measured & (lit > (1 - MARGIN) * all_lit)

    @cached_property
    def _lit(self) -> Grid | None:
        """1 where nodes have a value that is not 0, and beside it 1 everywhere, as coordinates may have a scale."""
        lit = np.nan_to_num(self.values).any(axis=-1)
        return replace(self, values=np.stack([lit, np.ones_like(lit)], axis=-1).astype(float)) if lit.any() else None

    @cached_property
    def _known(self) -> np.ndarray:
        """Which nodes have values in all channels."""
        return np.isfinite(self.values).all(axis=-1)

    @cached_property
    def usable(self) -> np.ndarray:
        """The values with 0 in place of those that mean nothing."""
        return np.where(np.isfinite(self.values), self.values, 0) if self.signed else usable(self.values)

    @cached_property
    def closed(self) -> Grid:
        """The grid to interpolate in. A missing value next to measured ones is their mean, or f would sink towards it.
        Values at poles do not depend on the azimuth: they are the mean over it of the innermost nodes."""
        if self.is_closed:
            return self
        axes, values = list(self.axes), self._filled()
        for polar, azimuth in self.coordinates.poles:
            axis = axes[polar]
            innermost = np.take(values, [0], axis=polar)
            count = np.isfinite(innermost).sum(axis=azimuth, keepdims=True)
            mean = np.nansum(innermost, axis=azimuth, keepdims=True, dtype=np.float64) / np.maximum(count, 1)
            mean = np.broadcast_to(mean, innermost.shape)
            at_pole = axis.nodes[0] == 0
            rest = np.delete(values, 0, axis=polar) if at_pole else values
            values = np.concatenate([mean.astype(values.dtype), rest], axis=polar)
            axes[polar] = axis if at_pole else replace(axis, nodes=np.append(0, axis.nodes))
        return replace(self, axes=tuple(axes), values=values, is_closed=True)

    def _filled(self) -> np.ndarray:
        """Return the values, with the mean of the measured neighbours along an axis in place of missing ones: one axis
        after the other, which also reaches the corners of cells."""
        values, missing = self.values, np.isnan(self.values)
        for k, axis in enumerate(self.axes if missing.any() else ()):
            near = []
            for step, end in ((1, 0), (-1, -1)):
                other = np.roll(values, step, axis=k)
                if axis.period is None:
                    np.moveaxis(other, k, 0)[end] = np.nan
                near.append(other)
            lower, upper = near
            mean = np.where(np.isnan(upper), lower, lower / 2 + upper / 2)
            values = np.where(missing, np.where(np.isnan(lower), upper, mean), values)
        return values

    def evaluate(
        self,
        wi: np.ndarray,
        wo: np.ndarray,
        interpolation: Interpolation = "trilinear",
        extrapolate: Extrapolation = "hold",
    ) -> np.ndarray:
        """Return f, with values that mean nothing as 0, as below the horizon, for unit vectors of shape (…, 3), or (3,)
        for one wi and many wo: shape (…, channels).

        Raises:
            ValueError: if a direction is no unit vector.
        """
        values, corners = self._corners(wi, wo, interpolation, extrapolate)
        return sum(weight[..., None] * values.take(index, axis=0) for index, weight in corners)

    def integrated(
        self, wi: np.ndarray, wo: np.ndarray, weight: np.ndarray, extrapolate: Extrapolation = "hold"
    ) -> np.ndarray:
        """Return the sum of :meth:`evaluate` over directions, each times a weight, shape (channels,): the nodes are
        weighed first, so that memory and time for many channels are those of the table, not of the directions."""
        values, corners = self._corners(wi, wo, "trilinear", extrapolate)
        index = np.concatenate([np.broadcast_to(k, weight.shape) for k, _ in corners])
        total = np.bincount(index, np.concatenate([share * weight for _, share in corners]), len(values))
        lit = np.flatnonzero(total)
        return total[lit] @ values[lit]

    def _corners(
        self, wi: np.ndarray, wo: np.ndarray, interpolation: Interpolation, extrapolate: Extrapolation
    ) -> tuple[np.ndarray, list[tuple[Any, np.ndarray]]]:
        """Return ``(values, corners)``: nodes' values, shape (nodes, channels), and the ``(index, weight)`` of those
        that f is the sum of."""
        light, view = components(wi), components(wo)
        places, scale = self.coordinates.locate_scaled(light, view, NUMPY)
        grid = self if interpolation == "nearest" else self.closed
        values, inside, varying = grid.usable, np.ones((), dtype=bool), []
        for axis, place in zip(grid.axes, places, strict=True):
            inside = inside & axis.measured(place)
            if np.ndim(place):
                varying.append((axis, place))
            else:  # the same for all: one interpolation of the whole grid
                steps = axis.steps(place, interpolation)
                values = sum(share * values.take(k, axis=len(varying)) for k, share in steps)
        above = (light.z > -MARGIN) & (view.z > -MARGIN)
        scale = np.where(above & (inside | (extrapolate == "hold")), scale, 0)
        weighed = [(index, np.asarray(weight * scale)) for index, weight in corners(varying, interpolation)]
        return values.reshape(-1, values.shape[-1]), weighed


def usable(values: np.ndarray) -> np.ndarray:
    """Return values with 0 in place of negative, infinite and missing ones."""
    return np.where(np.isfinite(values) & (values > 0), values, 0)
