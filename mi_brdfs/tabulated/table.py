"""Grids in the active variant: look-ups in kernels."""

from __future__ import annotations

import itertools
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import clamp
from ..measured.arrays import DRJIT
from ..measured.measurement import MARGIN, Axis, Grid
from ..variants import is_scalar


class Table:
    """A grid whose values and nodes are arrays of the active variant.

    ``values`` is a tensor of the grid's shape. The channels are what they are in the grid; with ``wavelengths`` in nm,
    which :meth:`evaluate` then interpolates between, they are a further axis.
    """

    def __init__(self, grid: Grid, wavelengths: np.ndarray | None, nearest: bool, hold: bool) -> None:
        self.coordinates, self.nearest, self.hold = grid.coordinates.prepared(), nearest, hold
        self.axes = [TableAxis(axis) for axis in grid.axes]
        self.spectrum = None if wavelengths is None else TableAxis(Axis(wavelengths))
        self.values = mi.TensorXf(np.ascontiguousarray(grid.usable, dtype=np.float32))
        self.channels = grid.values.shape[-1]

    @property
    def captured(self) -> list[Any]:
        """Everything that a kernel reads."""
        axes = [*self.axes, *([self.spectrum] if self.spectrum else [])]
        nodes = [axis.nodes for axis in axes if axis.nodes is not None]
        return [self.values, *nodes, *self.coordinates.captured]

    def evaluate(self, wi: mi.Vector3f, wo: mi.Vector3f, wavelengths: Any = None) -> list[Any]:
        """Return f for each channel or, where channels are a spectrum, for each of the ``wavelengths``."""
        places, scale = self.coordinates.locate_scaled(wi, wo, DRJIT)
        inside, corners = True, [(0, 1)]
        stride = self.channels
        for axis, place in zip(reversed(self.axes), reversed(places), strict=True):
            if not self.hold:
                inside = inside & axis.measured(place)
            steps = axis.steps(place, self.nearest)
            corners = [
                (index + k * stride, weight * share)
                for (k, share), (index, weight) in itertools.product(steps, corners)
            ]
            stride *= axis.count
        if self.spectrum is None:
            read = [[(channel, 1)] for channel in range(self.channels)]
        else:
            read = [self.spectrum.steps(wavelength, False) for wavelength in wavelengths]
        scale = dr.select(inside, scale, 0)
        found = []
        for channels in read:
            total = 0
            for (index, weight), (k, share) in itertools.product(corners, channels):
                total = total + fetch(self.values.array, index + k) * (weight * share)
            found.append(total * scale)
        return found


class TableAxis:
    """An axis in the active variant."""

    def __init__(self, axis: Axis) -> None:
        looped = axis.looped
        self.count, self.last = len(axis.nodes), len(looped) - 1
        self.period, self.low, self.high = axis.period, axis.low, axis.high
        self.first, self.step = float(looped[0]), float(np.mean(np.diff(looped))) if self.last else 1.0
        even = np.allclose(np.diff(looped), self.step, rtol=0, atol=1e-6 * self.step)
        self.nodes = None if even else array(looped)

    def steps(self, x: Any, nearest: bool) -> list[tuple[Any, Any]]:
        """Return ``(index, share)`` of the nodes that a place is interpolated between, or of the nearest one."""
        if not self.last:
            return [(0, 1)]
        position = self._position(x)
        if nearest:
            k = mi.UInt32(dr.floor(position + 0.5))
            return [(self._index(k), 1)]
        k = mi.UInt32(dr.minimum(dr.floor(position), self.last - 1))
        share = position - mi.Float(k)
        return [(k, 1 - share), (self._index(k + 1), share)]

    def measured(self, x: Any) -> Any:
        """Return whether a place lies in the measured range."""
        if self.period is not None:
            return True
        return (x >= self.low - MARGIN) & (x <= self.high + MARGIN)

    def _position(self, x: Any) -> Any:
        if self.period is not None:
            x = x - self.period * dr.floor((x - self.first) * (1 / self.period))
        if self.nodes is None:
            return clamp((x - self.first) * (1 / self.step), 0, self.last)
        k = dr.binary_search(1, self.last, lambda k: fetch(self.nodes, k) <= x)
        below, above = fetch(self.nodes, k - 1), fetch(self.nodes, k)
        return mi.Float(k - 1) + clamp((x - below) / (above - below), 0, 1)

    def _index(self, k: Any) -> Any:
        """Return the index of a looped node."""
        return dr.select(k == self.count, 0, k) if self.period is not None else k


def array(values: np.ndarray) -> Any:
    """Return numbers as an array that kernels of the active variant read by :func:`fetch`."""
    return mi.TensorXf(np.ascontiguousarray(values, dtype=np.float32).ravel()).array


def fetch(values: Any, index: Any) -> Any:
    """Return the number at an index; scalar variants have no gather."""
    return values[index] if is_scalar() else dr.gather(mi.Float, values, index)
