"""The intermediate of all formats: measured values on a grid, or at single pairs of directions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .arrays import NUMPY, components, stacked
from .coordinates import Coordinates

Interpolation = Literal["trilinear", "nearest"]
Extrapolation = Literal["hold", "zero"]


class FileError(ValueError):
    """A file that cannot be read. The message is one sentence that names the file and, where there is one, the offset
    or the line."""


@dataclass(frozen=True)
class Axis:
    """An axis of a grid: increasing ``nodes``, between which values are interpolated, in the coordinate's unit.

    An axis with a ``period`` goes round. Another one was measured from ``low`` to ``high``, by default its outer nodes;
    cells reach beyond their centres."""

    nodes: np.ndarray
    period: float | None = None
    low: float = np.nan
    high: float = np.nan

    def __post_init__(self) -> None:
        nodes = np.asarray(self.nodes, dtype=np.float64)
        if nodes.ndim != 1 or not len(nodes) or not np.all(np.isfinite(nodes)) or np.any(np.diff(nodes) <= 0):
            raise ValueError("The nodes of an axis must increase.")
        object.__setattr__(self, "nodes", nodes)
        for name, end in (("low", nodes[0]), ("high", nodes[-1])):
            if np.isnan(getattr(self, name)):
                object.__setattr__(self, name, float(end))

    @property
    def looped(self) -> np.ndarray:
        """The nodes, and behind them the first one, a period later, if the axis goes round."""
        return self.nodes if self.period is None else np.append(self.nodes, self.nodes[0] + self.period)

    def steps(self, x: np.ndarray, interpolation: Interpolation) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return ``(index, share)`` of the two nodes that places are interpolated between, or of the nearest one."""
        nodes = self.looped
        if self.period is not None:
            x = nodes[0] + np.mod(x - nodes[0], self.period)
        position = np.interp(x, nodes, np.arange(len(nodes)))
        if interpolation == "nearest" or len(nodes) == 1:
            return [((position + 0.5).astype(np.int64) % len(self.nodes), np.ones(np.shape(position)))]
        k = np.minimum(position.astype(np.int64), len(nodes) - 2)
        return [(k, k + 1 - position), ((k + 1) % len(self.nodes), position - k)]

    def measured(self, x: np.ndarray) -> np.ndarray:
        """Return whether values lie in the measured range, up to rounding."""
        if self.period is not None:
            return np.ones(np.shape(x), dtype=bool)
        return (x >= self.low - MARGIN) & (x <= self.high + MARGIN)


MARGIN = 1e-5
"""By how much a float32 angle may miss the end of an axis."""


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
        """Return whether directions of shape (…, 3), or (3,) for one wi and many wo, are above the horizon, on all axes
        in the range that was measured, and nearest to a node with values in all channels: shape (…)."""
        places, _ = self.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
        inside, nearest = (wi[..., 2] > 0) & (wo[..., 2] > 0), []
        for axis, place in zip(self.axes, places, strict=True):
            inside = inside & axis.measured(place)
            nearest.append(axis.steps(place, "nearest")[0][0])
        return inside & np.isfinite(self.values[tuple(nearest)]).all(axis=-1)

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
        missing = np.flatnonzero(np.isnan(self.values))
        if not len(missing):
            return self.values
        values, stride = self.values.flatten(), self.values.size
        for axis in self.axes:
            count = len(axis.nodes)
            stride //= count
            k = missing // stride % count
            near = []
            for step in (-1, 1):
                other = (k + step) % count
                value = values[missing + (other - k) * stride]
                near.append(np.where((axis.period is not None) | (other == k + step), value, np.nan))
            lower, upper = near
            values[missing] = np.where(np.isnan(lower), upper, np.where(np.isnan(upper), lower, lower / 2 + upper / 2))
        return values.reshape(self.values.shape)

    def evaluate(
        self,
        wi: np.ndarray,
        wo: np.ndarray,
        interpolation: Interpolation = "trilinear",
        extrapolate: Extrapolation = "hold",
    ) -> np.ndarray:
        """Return f, with values that mean nothing as 0, for directions of shape (…, 3), or (3,) for one wi and many wo:
        shape (…, channels)."""
        places, scale = self.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
        grid = self if interpolation == "nearest" else self.closed
        values, inside = grid.usable, np.ones((), dtype=bool)
        corners: list[tuple[Any, Any]] = [(0, 1.0)]
        kept = 0
        for axis, place in zip(grid.axes, places, strict=True):
            inside = inside & axis.measured(place)
            steps = axis.steps(place, interpolation)
            if np.ndim(place) == 0:  # the same for all: one interpolation of the whole grid
                values = sum(share * values.take(k, axis=kept) for k, share in steps)
                continue
            kept += 1
            corners = [(index * len(axis.nodes) + k, weight * share) for index, weight in corners for k, share in steps]
        values = values.reshape(-1, values.shape[-1])
        result = sum(np.asarray(weight)[..., None] * values.take(index, axis=0) for index, weight in corners)
        if extrapolate == "zero":
            result = np.where(inside[..., None], result, 0)
        return result * np.asarray(scale)[..., None]


@dataclass(frozen=True)
class Samples:
    """Values at single pairs of directions: shapes (N, 3), (N, 3) and (N, channels)."""

    wi: np.ndarray
    wo: np.ndarray
    values: np.ndarray
    anisotropic: bool

    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.wi, self.wo, self.values


@dataclass(frozen=True)
class Measurement:
    """A measured BRDF.

    ``values`` of ``data`` are f in 1/sr, as the file has them up to its stated scale: negative ones, and NaN where
    nothing was measured, are kept. Whatever renders takes these as 0, whatever fits gives them no weight, and
    :func:`mi_brdfs.measured.summary.summarize` counts them.
    """

    path: Path
    format: str
    """MERL, RGL, Zemax, …"""
    data: Grid | Samples
    wavelengths: np.ndarray | None = None
    """In nm, one a channel; None where the channels are linear sRGB."""
    material: str = ""
    """What the file calls it."""
    quantity: Literal["f", "f cos"] = "f"
    """What the file holds; ``data`` is f in either case."""
    stated_albedos: dict[float, list[float]] = field(default_factory=dict)
    """The directional albedos (total integrated scatter, TIS) that the file states, by θi in radians: one for each
    angle of rotation, or a single one."""
    notes: dict[str, str] = field(default_factory=dict)
    """What else the file says of itself."""


def usable(values: np.ndarray) -> np.ndarray:
    """Return values with 0 in place of negative, infinite and missing ones."""
    return np.where(np.isfinite(values) & (values > 0), values, 0)
