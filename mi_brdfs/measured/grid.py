"""Measured values on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from .arrays import NUMPY, components, stacked
from .axis import MARGIN, Axis, Interpolation, corners
from .coordinates import Coordinates

Extrapolation = Literal["hold", "zero"]


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
        """Return f, with values that mean nothing as 0, for unit vectors of shape (…, 3), or (3,) for one wi and many
        wo: shape (…, channels).

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
        places, scale = self.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
        grid = self if interpolation == "nearest" else self.closed
        values, inside, varying = grid.usable, np.ones((), dtype=bool), []
        for axis, place in zip(grid.axes, places, strict=True):
            inside = inside & axis.measured(place)
            if np.ndim(place):
                varying.append((axis, place))
            else:  # the same for all: one interpolation of the whole grid
                steps = axis.steps(place, interpolation)
                values = sum(share * values.take(k, axis=len(varying)) for k, share in steps)
        if extrapolate == "zero":
            scale = np.where(inside, scale, 0)
        weighed = [(index, np.asarray(weight * scale)) for index, weight in corners(varying, interpolation)]
        return values.reshape(-1, values.shape[-1]), weighed


def usable(values: np.ndarray) -> np.ndarray:
    """Return values with 0 in place of negative, infinite and missing ones."""
    return np.where(np.isfinite(values) & (values > 0), values, 0)
