"""The intermediate of all formats: measured values on a grid, or at single pairs of directions."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from ..observer import observer
from ..parameters.messages import brief, printable
from ..probe.arrays import luminance
from .arrays import NUMPY, components, stacked
from .coordinates import Coordinates, polar_angle

Interpolation = Literal["trilinear", "nearest"]
Extrapolation = Literal["hold", "zero"]
Quantity = Literal["stated", "f", "f cos"]
"""What a file holds: what it states, or f or f cosθo where it states nothing."""
MOST = 1e36
"""The largest value: float32 holds it times a solid angle."""
LEAST_NM = 12.0
"""In nm, between the 10.6 µm of carbon dioxide lasers and the 13.5 nm of extreme ultraviolet light."""
MOST_UNSEEN = 0.2
"""The share of the luminance that spectra may leave out without a warning."""


class FileError(ValueError):
    """A file that cannot be read. The message is one sentence that names the file and, where there is one, the offset
    or the line, without what would control a terminal in the file's name or its text."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


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


MOST_CHANNELS = 4096
MARGIN = 1e-5
"""By how much a float32 angle may miss the end of an axis."""
THINNEST = np.radians(6)
"""Half of the least range of angles that counts as measured."""
LEEWAY = 1e-3
"""By how much an angle may miss the range of samples, whose angles are written with few digits."""


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


@dataclass(frozen=True)
class Samples:
    """Values at single pairs of directions: shapes (N, 3), (N, 3) and (N, channels)."""

    wi: np.ndarray
    wo: np.ndarray
    values: np.ndarray
    anisotropic: bool

    def pairs(self, chosen: np.ndarray | slice = slice(None)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.wi[chosen], self.wo[chosen], self.values[chosen]

    @cached_property
    def known(self) -> np.ndarray:
        """Which samples have values in all channels."""
        return np.isfinite(self.values).all(axis=1)

    def measured(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Return whether directions are above the horizon, and their polar angles, exchanged or not, within the ranges
        of the samples' own. Shapes are those of :meth:`Grid.measured`."""
        (low_i, high_i), (low_o, high_o) = self._ranges
        theta_i, theta_o = polar_angle(components(wi)), polar_angle(components(wo))

        def within(first: np.ndarray, second: np.ndarray) -> np.ndarray:
            return (low_i <= first) & (first <= high_i) & (low_o <= second) & (second <= high_o)

        above = (theta_i < np.pi / 2) & (theta_o < np.pi / 2)
        return above & (within(theta_i, theta_o) | within(theta_o, theta_i))

    seen = measured
    """Samples are no table that has zeros where nothing was measured."""

    @cached_property
    def _ranges(self) -> list[tuple[float, float]]:
        """The ends of the polar angles of wi and of wo, and a little more: nodes between samples of a single angle are
        next to it."""
        angles = [polar_angle(components(it[self.known])) for it in (self.wi, self.wo)]
        margins = [max(LEEWAY, THINNEST - np.ptp(each) / 2) for each in angles]
        return [(each.min() - more, each.max() + more) for each, more in zip(angles, margins, strict=True)]


@dataclass(frozen=True)
class Measurement:
    """A measured BRDF.

    ``values`` of ``data`` are f in 1/sr, as the file has them up to its stated scale: negative ones, and NaN where
    nothing was measured, are kept. Whatever renders takes these as 0, whatever fits gives them no weight, and
    :func:`mi_brdfs.measured.report.summary.summarize` counts them.
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

    def __post_init__(self) -> None:
        # What a file calls itself must not control a terminal.
        object.__setattr__(self, "material", brief(self.material))
        lines = {name: " ".join(text.split()) for name, text in self.notes.items()}
        object.__setattr__(self, "notes", {printable(name): printable(text) for name, text in lines.items()})


def usable(values: np.ndarray) -> np.ndarray:
    """Return values with 0 in place of negative, infinite and missing ones."""
    return np.where(np.isfinite(values) & (values > 0), values, 0)


def representable(measurement: Measurement) -> Measurement:
    """Return a measurement that can be rendered, with NaN in place of values beyond ``MOST``, infinite ones among them.
    Raise a FileError if no value is left that is positive, or wavelengths are too many, no numbers, the same or in
    micrometres. Warn of spectra that leave out much of what the eye sees."""
    values, nm = measurement.data.values, measurement.wavelengths
    if values.shape[-1] > MOST_CHANNELS:
        raise FileError(
            f"{measurement.path} has {values.shape[-1]:,} wavelengths, of which at most {MOST_CHANNELS:,} can be read; "
            "keep every second one, or fewer."
        )
    if nm is not None and len(nm) > 1 and not np.all((np.diff(nm) > 0) & np.isfinite(nm[1:])):
        raise FileError(f"{measurement.path}: its wavelengths must be numbers that differ.")
    if nm is not None and nm[-1] < LEAST_NM:
        numbers = f"{nm[0]:g} to {nm[-1]:g}" if len(nm) > 1 else f"{nm[0]:g}"
        raise FileError(f"{measurement.path}: wavelengths of {numbers} look like micrometres; write nm.")
    if nm is not None and len(nm) > 1 and (share := _unseen(nm[0], nm[-1])) > MOST_UNSEEN:
        warnings.warn(
            f"{measurement.path}: its wavelengths of {nm[0]:g} to {nm[-1]:g} nm leave out {share:.0%} of what the eye "
            "sees; there, the value of the nearest one is shown.", stacklevel=2,
        )  # fmt: skip
    values[~((values >= -MOST) & (values <= MOST))] = np.nan
    # Samples with a missing channel are left out where others are interpolated.
    kept = values if isinstance(measurement.data, Grid) else values[np.isfinite(values).all(axis=1)]
    if not np.any(kept > np.finfo(np.float32).tiny):
        raise FileError(f"{measurement.path}: no value is positive and at most {MOST:g}; there is nothing to render.")
    return measurement


def _unseen(low: float, high: float) -> float:
    """Return the share of a white reflectance's luminance that lies below or above two wavelengths in nm."""
    fine, weights = observer()
    return float(luminance(weights)[(fine < low) | (fine > high)].sum())
