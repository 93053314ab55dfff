"""A partition of the sphere that is fine where a density is, and the chi² test on it.

Cells are squares in the plane of two angles, the latitude γ about an axis in the horizon and the longitude t around
it: a pole at the normal would be a place of long cells where narrow lobes are, and horizon and plane of incidence are
lines of the grid. A cell is quartered while it holds more than its share of samples, and while its integral by Gauss
quadrature differs from that of its quarters; so no width of a lobe need be known, from a mirror to a diffuser.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from math import erfc, sqrt

import numpy as np

from ..math import gauss_legendre

FIRST_LEVEL, LAST_LEVEL = 3, 17
"""Cells at level L are 2^-L of the sphere's extent."""
NODES = 5
_NODES, _WEIGHTS = np.array(gauss_legendre(NODES)).T


@dataclass(frozen=True)
class Partition:
    """Cells that cover the sphere, along a space-filling curve, with a density's integral over each."""

    axis: np.ndarray
    """The azimuth that longitudes are measured from, as a unit vector (cosφ, sinφ): that of the plane of incidence, as
    a rule."""
    starts: np.ndarray
    level: np.ndarray
    x: np.ndarray
    y: np.ndarray
    integrals: np.ndarray

    def histogram(self, w) -> np.ndarray:
        """How many of the directions lie in each cell."""
        return np.bincount(self.cells(w), minlength=len(self.starts))

    def cells(self, w) -> np.ndarray:
        """The cell that each of the directions lies in."""
        points = (_to_square(w, self.axis) * (1 << LAST_LEVEL)).astype(np.int64).clip(0, (1 << LAST_LEVEL) - 1)
        return np.searchsorted(self.starts, _interleaved(points[:, 0], points[:, 1]), side="right") - 1

    @property
    def centres(self) -> np.ndarray:
        """A direction in the middle of each cell."""
        middles = np.stack([self.x + 0.5, self.y + 0.5], axis=-1) * 2.0 ** -self.level[:, None]
        return _to_sphere(middles, self.axis)[0]

    @property
    def solid_angles(self) -> np.ndarray:
        size = 2.0**-self.level
        latitude = np.pi * ((self.x + 0.5) * size - 0.5)
        return 4 * np.pi * size * np.cos(latitude) * np.sin(np.pi / 2 * size)

    def merged(self, level: int) -> np.ndarray:
        """The number that each cell gets when all that are finer than a level are merged into cells of that level."""
        ancestors = self.starts >> 2 * max(LAST_LEVEL - level, 0)
        return np.cumsum(np.diff(ancestors, prepend=-1) > 0) - 1


def azimuth(w) -> np.ndarray:
    """The azimuth of a direction, as a unit vector (cosφ, sinφ)."""
    length = np.hypot(w[0], w[1])
    return np.array([w[0], w[1]], np.float64) / length if length > 1e-4 else np.array([1.0, 0.0])


def partition(pdf: Callable, pilot: np.ndarray, wi: np.ndarray, count: int, cells: int = 1024) -> Partition:
    """The partition for a density.

    Args:
        pdf: the density of an array of directions.
        pilot: samples that say where the density is; they must not be those that are tested.
        wi: the direction of incidence, of which only the azimuth counts.
        count: how many samples will be tested: the integrals are precise to a part of their deviation.
        cells: no cell holds more than this part of the samples.
    """
    (made,) = partitions(lambda _, wo: pdf(wo), [pilot], [wi], count, cells)
    return made


def partitions(pdf: Callable, pilots: list, wis: list, count: int, cells: int) -> list[Partition]:
    """Those for a density of several directions of incidence: it is asked for one array of all directions at once, as
    ``pdf(of, wo)``, where ``of`` has the index of the direction of incidence of each."""
    growing = [_grow(pilot, wi, count, cells) for pilot, wi in zip(pilots, wis, strict=True)]
    made: list = [None] * len(growing)
    wanted = {k: next(one) for k, one in enumerate(growing)}
    while wanted:
        of = np.repeat(list(wanted), [len(wo) for wo in wanted.values()])
        density = pdf(of, np.concatenate(list(wanted.values())))
        ends = np.cumsum([len(wo) for wo in wanted.values()])
        for (k, _), found in zip(list(wanted.items()), np.split(density, ends[:-1]), strict=True):
            try:
                wanted[k] = growing[k].send(found)
            except StopIteration as stop:
                made[k] = stop.value
                del wanted[k]
    return made


def _grow(pilot, wi, count: int, cells: int) -> Generator[np.ndarray, np.ndarray, Partition]:
    """A partition; yields the directions of which it needs the density."""
    axis = azimuth(wi)
    points = _to_square(pilot, axis)
    side = 1 << FIRST_LEVEL
    x, y = (index.ravel() for index in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    integrals = yield from _integrals(axis, x, y, FIRST_LEVEL)
    done = []
    for level in range(FIRST_LEVEL, LAST_LEVEL + 1):
        held, points = _count(points, x, y, level)
        quarters = [(2 * x + i, 2 * y + j) for i in (0, 1) for j in (0, 1)]
        qx, qy = (np.stack(index, axis=1) for index in zip(*quarters, strict=True))
        parts = (yield from _integrals(axis, qx.ravel(), qy.ravel(), level + 1)).reshape(-1, 4)
        precise = parts.sum(axis=1)
        error = count * abs(precise - integrals)
        split = (held * cells > len(pilot)) | (error > 0.2 * np.sqrt(np.maximum(count * precise, 1)))
        if level == LAST_LEVEL:
            split[:] = False
        done.append((np.full((~split).sum(), level), x[~split], y[~split], precise[~split]))
        x, y, integrals = qx[split].ravel(), qy[split].ravel(), parts[split].ravel()
        if not len(x):
            break
    level, x, y, integrals = (np.concatenate(column) for column in zip(*done, strict=True))
    shift = LAST_LEVEL - level
    starts = _interleaved(x << shift, y << shift)
    order = np.argsort(starts)
    return Partition(axis, starts[order], level[order], x[order], y[order], integrals[order])


@dataclass(frozen=True)
class ChiSquare:
    """The outcome of a chi² test."""

    p_value: float
    statistic: float
    degrees: int
    worst: int
    """The cell that deviates most."""


def chi_square(observed: np.ndarray, expected: np.ndarray, least: float = 5) -> ChiSquare:
    """Pearson's test of the counts in cells. Cells that expect less than ``least`` are pooled, in the order of what
    they expect, until they do."""
    small = expected < least
    order = np.flatnonzero(small)[np.argsort(expected[small], kind="stable")[::-1]]
    pool = np.floor(np.cumsum(expected[order]) / (2 * least)).astype(int)
    pools = pool.max(initial=-1) + 1
    e = np.concatenate([expected[~small], np.bincount(pool, expected[order], pools)])
    o = np.concatenate([observed[~small], np.bincount(pool, observed[order], pools)])
    # What is left over expects less, down to nothing: give it to the last pool that does not.
    few = e < least
    if few.any() and not few.all():
        last = np.flatnonzero(~few)[-1]
        e[last] += e[few].sum()
        o[last] += o[few].sum()
        e, o = e[~few], o[~few]
    statistic = float(((o - e) ** 2 / np.maximum(e, 1e-9)).sum())
    degrees = max(len(e) - 1, 1)
    worst = int(np.argmax((observed - expected) ** 2 / np.maximum(expected, 1)))
    return ChiSquare(_survival(statistic, degrees), statistic, len(e) - 1, worst)


def _survival(statistic: float, degrees: int) -> float:
    """The probability of a larger chi², by the cube root transform of Wilson and Hilferty (1931)."""
    spread = 2 / (9 * degrees)
    return 0.5 * erfc(((statistic / degrees) ** (1 / 3) - (1 - spread)) / sqrt(2 * spread))


def _count(points, x, y, level):
    """How many points lie in each of some cells of a level, and the points that do."""
    indices = (points * (1 << level)).astype(np.int64).clip(0, (1 << level) - 1)
    keys, cells = indices[:, 0] << 32 | indices[:, 1], x.astype(np.int64) << 32 | y
    order = np.argsort(cells)
    slot = np.searchsorted(cells[order], keys).clip(0, len(cells) - 1)
    inside = cells[order][slot] == keys
    held = np.zeros(len(cells), int)
    held[order] = np.bincount(slot[inside], minlength=len(cells))
    return held, points[inside]


def _integrals(axis, x, y, level):
    """The integrals of a density over cells; yields the directions of which it needs the density."""
    size = 2.0**-level
    px = (x[:, None, None] + _NODES[:, None]) * size + np.zeros(NODES)
    py = (y[:, None, None] + _NODES[None, :]) * size + np.zeros((NODES, 1))
    w, jacobian = _to_sphere(np.stack([px.ravel(), py.ravel()], axis=-1), axis)
    density = ((yield w.astype(np.float32)) * jacobian).reshape(-1, NODES, NODES)
    return np.einsum("kij,i,j->k", density, _WEIGHTS, _WEIGHTS) * size * size


def _to_sphere(points, axis):
    """Directions of points of the unit square, and the solid angle of its unit area there."""
    latitude, longitude = np.pi * (points[:, 0] - 0.5), 2 * np.pi * points[:, 1]
    cos = np.cos(latitude)
    along, across, up = cos * np.cos(longitude), np.sin(latitude), cos * np.sin(longitude)
    w = np.stack([axis[0] * along - axis[1] * across, axis[1] * along + axis[0] * across, up], axis=-1)
    return w, 2 * np.pi**2 * cos


def _to_square(w, axis):
    w = np.asarray(w, np.float64)
    along, across = axis[0] * w[:, 0] + axis[1] * w[:, 1], axis[0] * w[:, 1] - axis[1] * w[:, 0]
    latitude = np.arctan2(across, np.hypot(along, w[:, 2]))
    longitude = np.arctan2(w[:, 2], along) / (2 * np.pi)
    return np.stack([latitude / np.pi + 0.5, np.where(longitude < 0, longitude + 1, longitude)], axis=-1)


def _interleaved(x, y):
    """The place of a cell along the Z-order curve."""

    def spread(v):
        v = v.astype(np.int64)
        for shift, mask in ((16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F),
                            (2, 0x3333333333333333), (1, 0x5555555555555555)):  # fmt: skip
            v = (v | v << shift) & mask
        return v

    return spread(x) | spread(y) << 1
