"""The intermediate of all formats: measured values on a grid, or at single pairs of directions."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

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

    def position(self, x: np.ndarray) -> np.ndarray:
        """Return where values lie among the nodes: k at node k, and between two nodes in proportion."""
        if self.period is not None:
            x = self.nodes[0] + np.mod(x - self.nodes[0], self.period)
        return np.interp(x, self.looped, np.arange(len(self.looped)))

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

    def __post_init__(self) -> None:
        shape = tuple(len(axis.nodes) for axis in self.axes)
        if len(self.axes) != len(self.coordinates.names) or self.values.shape[:-1] != shape:
            raise ValueError(f"Values of shape {self.values.shape} do not fit axes of {shape} nodes.")

    @property
    def anisotropic(self) -> bool:
        return self.coordinates.anisotropic

    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ``(wi, wo, f)`` of all nodes, also of those below the horizon: shapes (N, 3), (N, 3) and
        (N, channels)."""
        places = np.meshgrid(*(axis.nodes for axis in self.axes), indexing="ij")
        wi, wo = self.coordinates.directions(*(place.ravel() for place in places))
        _, scale = self.coordinates.locate_scaled(wi, wo, NUMPY)
        return stacked(wi), stacked(wo), np.reshape(scale, (-1, 1)) * self.values.reshape(-1, self.values.shape[-1])

    def evaluate(
        self,
        wi: np.ndarray,
        wo: np.ndarray,
        interpolation: Interpolation = "trilinear",
        extrapolate: Extrapolation = "hold",
    ) -> np.ndarray:
        """Return f, with negative and missing values as 0, for directions of shape (N, 3): shape (N, channels)."""
        places, scale = self.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
        values = usable(self.values)
        inside = np.ones(len(wi), dtype=bool)
        below, shares = [], []
        for axis, place in zip(self.axes, places, strict=True):
            inside &= axis.measured(place)
            position = axis.position(place)
            if interpolation == "nearest":
                position = np.floor(position + 0.5)
            k = np.minimum(position.astype(np.int64), max(len(axis.looped) - 2, 0))
            below.append(k)
            shares.append(position - k)
        result = np.zeros((len(wi), values.shape[-1]))
        for corner in itertools.product((0, 1), repeat=len(self.axes)):
            index, weight = [], np.ones(len(wi))
            for axis, k, share, step in zip(self.axes, below, shares, corner, strict=True):
                index.append((k + step) % len(axis.nodes))
                weight = weight * (share if step else 1 - share)
            used = weight > 0
            result[used] += weight[used, None] * values[tuple(k[used] for k in index)]
        if extrapolate == "zero":
            result = np.where(inside[:, None], result, 0)
        return result * np.reshape(scale, (-1, 1))


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
