"""What a fit sees of a material: pairs of directions with values, their weights, and which of them are held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..measured import Axis, Grid, Measurement, Samples, read
from ..measured.arrays import components, stacked
from ..measured.measurement import Quantity
from ..measured.report.summary import azimuths, scatter
from ..observer import to_srgb

Arrays: TypeAlias = tuple[ArrayLike, ArrayLike, ArrayLike]
Source: TypeAlias = str | Path | Measurement | Arrays
"""A file, what was read from it, or arrays (wi, wo, f)."""

CUT, PAIRS = 80.0, 4096
"""The largest angle to the normal, in degrees, and the most pairs of directions, where nothing else is asked for."""
DARKEST = 3e-6
"""The f below which no material is: that of a Lambertian surface with the least reflectance that is sought."""
TRIED = 8
"""Nodes of a large grid that are looked at for each pair that is wanted: many lie below the horizon."""
STEP = 1e-2
"""The part of a cell's width over which directions are differentiated."""


class FitError(ValueError):
    """Data and a model that cannot be fitted. The message is one sentence that says why."""


@dataclass(frozen=True, kw_only=True)
class Data:
    """What fits tell of the data."""

    file: str
    """The file, or "arrays"."""
    anisotropic: bool
    negative: int
    """Values below 0 within the cut, which have no weight."""
    missing: int
    """Values within the cut that are no numbers, which have none either."""
    cut: float
    """The largest angle of wi and wo to the normal, in degrees."""
    quantity: Quantity
    """What the file holds, by itself or because that was asked for."""
    scatter: list[tuple[float, float, float]]
    """``(θi, albedo that the file states, what its values integrate to)``, θi in degrees, at the first azimuth, where
    it states any."""


@dataclass(frozen=True, kw_only=True)
class Observations(Data):
    """Usable pairs of directions of a material, at random: the first ``fitted`` are fitted, the others held out."""

    wi: np.ndarray
    """Float32, shape (N, 3), as ``wo``."""
    wo: np.ndarray
    f: np.ndarray
    """Shape (N, channels), of one channel or linear sRGB; 0 where it has no weight."""
    usable: np.ndarray
    """Which of these have a weight, shape (N, channels)."""
    solid_angle: np.ndarray
    """What each pair stands for, dωi dωo up to a common scale, shape (N,)."""
    fitted: int

    @property
    def channels(self) -> int:
        return self.f.shape[1]


def observe(source: Source, cut: float = CUT, pairs: int = PAIRS, seed: int = 0) -> Observations:
    """Return at most ``pairs`` random pairs of a material with both angles up to ``cut`` degrees.

    Raises:
        FitError: if there is none, or arrays have other shapes.
        FileError: if a file cannot be read.
    """
    if isinstance(source, (str, Path)):
        source = read(source)
    elif not isinstance(source, Measurement):
        source = _of_arrays(source)
    name, data, rng = str(source.path), source.data, np.random.default_rng(seed)
    stated = []
    if isinstance(data, Grid):
        wi, wo, f, solid_angle = _nodes(data, pairs, rng)
        stated = scatter(source, data, azimuths(data)[:1])
    else:
        wi, wo, f = data.pairs()
        solid_angle = np.ones(len(f))
    f, converted = _colours(f, source.wavelengths)
    signed = converted or (isinstance(data, Grid) and data.signed)
    within = np.minimum(wi[:, 2], wo[:, 2]) >= math.cos(math.radians(cut))
    kept = rng.permutation(np.flatnonzero(within & (solid_angle > 0)))[:pairs]
    wi, wo, f, solid_angle = wi[kept], wo[kept], f[kept], solid_angle[kept]
    missing = ~np.isfinite(f)
    negative = ~missing & (f < 0) & (not signed)
    usable = ~missing & ~negative
    some = np.flatnonzero(usable.any(axis=1))
    if len(some) < 2 or not np.any(abs(f[usable]) > DARKEST):
        raise FitError(
            f"{name}: there are no two pairs of directions above the horizon, and within the cut at {cut:g}°, whose "
            f"values are above {DARKEST:g}/sr, as those of the darkest materials are."
        )
    some, fitted = _halves(some, np.where(usable, f, 0).sum(axis=1)[some] * wi[some, 2], rng)
    return Observations(
        file=name,
        wi=wi[some].astype(np.float32),
        wo=wo[some].astype(np.float32),
        f=np.where(usable, f, 0)[some],
        usable=usable[some],
        solid_angle=solid_angle[some],
        anisotropic=data.anisotropic,
        fitted=fitted,
        negative=int(negative.sum()),
        missing=int(missing.sum()),
        cut=cut,
        quantity=source.quantity,
        scatter=[(it.theta_i, it.stated, it.integrated) for it in stated],
    )


def _halves(rows: np.ndarray, values: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """Return rows in random order, a half of them first, and how many that are: of each two whose values are next to
    each other by size, one is in either half, so that narrow highlights are in both."""
    sorted_rows = rows[np.argsort(values, kind="stable")]
    first = np.zeros(len(rows), bool)
    first[::2] = rng.random(len(first[::2])) < 0.5
    first[1::2] = ~first[: len(first[1::2]) * 2 : 2]
    fitted = first.sum()
    return np.concatenate([rng.permutation(sorted_rows[first]), rng.permutation(sorted_rows[~first])]), int(fitted)


def _of_arrays(source: Any) -> Measurement:
    """Return checked arrays as a measurement."""
    if not isinstance(source, tuple) or len(source) != 3:
        raise FitError(f"Data are files, measurements or tuples of arrays (wi, wo, f), not {type(source).__name__}.")
    wi, wo, f = (np.asarray(array, np.float64) for array in source)
    f = f[:, None] if f.ndim == 1 else f
    if not wi.shape == wo.shape == (*f.shape[:1], 3) or f.shape[1:] not in ((1,), (3,)):
        shapes = ", ".join(str(np.shape(array)) for array in source)
        raise FitError(
            f"Arrays (wi, wo, f) have the shapes (N, 3), (N, 3) and (N,), or (N, 3) of linear sRGB, not {shapes}."
        )
    for directions in (wi, wo):
        try:
            components(directions)
        except ValueError as error:
            raise FitError(f"Arrays (wi, wo, f): {error}.") from None
    return Measurement(Path("arrays"), "arrays", Samples(wi, wo, f, anisotropic=False))


def _colours(f: np.ndarray, wavelengths: np.ndarray | None) -> tuple[np.ndarray, bool]:
    """Return one channel, or linear sRGB where there are several that have wavelengths, and whether it is converted:
    then a negative channel is a colour outside sRGB, and a spectrum with a negative value is missing."""
    if f.shape[1] == 1 or wavelengths is None:
        return f, False
    return np.where(f < 0, np.nan, f) @ to_srgb(wavelengths), True


def _nodes(grid: Grid, pairs: int, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Return ``(wi, wo, f, solid angle)`` of random nodes of a grid, or of all if there are few."""
    shape = grid.values.shape[:-1]
    total, wanted = math.prod(shape), TRIED * pairs
    chosen = np.arange(total) if total <= 2 * wanted else np.unique(rng.integers(total, size=wanted))
    wi, wo, f = grid.pairs(chosen)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    places = np.unravel_index(chosen[above], shape)
    return wi[above], wo[above], f[above], solid_angles(grid, places)


def solid_angles(grid: Grid, indices: Sequence[np.ndarray]) -> np.ndarray:
    """Return dωi dωo of the cells about some nodes, by their indices on each axis: the volume that directions sweep
    over a cell in its coordinates, and over a turn about the normal where the coordinates leave that out."""
    ends = [_cells(axis, k) for axis, k in zip(grid.axes, indices, strict=True)]
    centres = [(low + high) / 2 for low, high in ends]
    tangents = []
    for k, (low, high) in enumerate(ends):
        step = STEP * (high - low)
        ahead, behind = (
            _directions(grid, [centre + sign * step * (j == k) for j, centre in enumerate(centres)]) for sign in (1, -1)
        )
        tangents.append((ahead - behind) / (2 * STEP))
    if len(tangents) < 4:
        w = _directions(grid, centres)
        tangents.append(np.stack([-w[..., 1], w[..., 0], 0 * w[..., 0]], axis=-1))
    matrix = np.stack([t.reshape(len(t), 6) for t in tangents], axis=1)
    volume = np.sqrt(np.maximum(np.linalg.det(matrix @ matrix.transpose(0, 2, 1)), 0))
    return np.where(np.isfinite(volume), volume, 0)


def _directions(grid: Grid, places: Sequence[np.ndarray]) -> np.ndarray:
    """Return wi and wo, shape (N, 2, 3)."""
    return np.stack([stacked(w) for w in grid.coordinates.directions(*places)], axis=1)


def _cells(axis: Axis, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the cells about nodes: half way to the next, or the end of the axis."""
    nodes = axis.nodes
    if len(nodes) == 1:
        return nodes[k] - 0.5, nodes[k] + 0.5
    between = (nodes[1:] + nodes[:-1]) / 2
    low, high = min(axis.low, nodes[0]), max(axis.high, nodes[-1])
    if axis.period is not None and axis.whole:
        high = (nodes[-1] + nodes[0] + axis.period) / 2
        low = high - axis.period
    edges = np.concatenate([[low], between, [high]])
    return edges[k], edges[k + 1]
