"""A partition of the sphere that is fine where a density is.

Cells are squares in the plane of two angles, the latitude γ about an axis in the horizon and the longitude t around
it: a pole at the normal would be a place of long cells where narrow lobes are, and horizon and plane of incidence are
lines of the grid. A cell is quartered while it holds more than its share of samples, while its integral by Gauss
quadrature differs from that of its quarters, from how many samples it holds, or misses a line so narrow that the
density of a sample far exceeds that of all nodes; so no width of a lobe need be known, from a mirror to a diffuser.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..math import gauss_legendre
from .arrays import Array
from .directions import azimuth_axis

FIRST_LEVEL, LAST_LEVEL = 3, 17
"""Cells at level L are 2^-L of the sphere's extent."""
MOST = 1 << 11
"""Cells of a level that are quartered, the most urgent ones; lines 1000 times as long as wide need less."""
NODES, FINE = 5, 64
_NODES, _WEIGHTS = np.array(gauss_legendre(NODES)).T


@dataclass(frozen=True)
class Partition:
    """Cells that cover the sphere, along a space-filling curve, with a density's integral over each."""

    axis: Array
    """The azimuth of longitude 0, as (cosφ, sinφ): as a rule, that of the plane of incidence."""
    starts: Array
    """The place of each cell along the curve, in cells of the last level."""
    level: Array
    x: Array
    y: Array
    """The place of each cell in the grid of its level."""
    integrals: Array
    errors: Array
    """How far these were off with fewer nodes, or what they may miss of a line that none of the nodes is on."""

    def refined(self, density: Callable[[Array], Array], cells: Array) -> Partition:
        """Return it with the integrals over some cells by far more nodes: those of Gauss's rule see a jump or a line
        across a cell to a tenth of it only."""
        coarse, fine = (self._means(density, cells, count) for count in (FINE // 2, FINE))
        integrals, errors = self.integrals.copy(), self.errors.copy()
        integrals[cells], errors[cells] = fine, abs(fine - coarse)
        return replace(self, integrals=integrals, errors=errors)

    def _means(self, density: Callable[[Array], Array], cells: Array, count: int) -> Array:
        """Return the integrals over some cells by the mean of so many nodes along each side."""
        nodes = (np.arange(count) + 0.5) / count
        size = 2.0 ** -self.level[cells]
        w, jacobian = _to_sphere(*_nodes(self.x[cells], self.y[cells], nodes, size), self.axis)
        return (density(w.reshape(-1, 3)).reshape(w.shape[:-1]) * jacobian).mean(axis=(1, 2)) * size * size

    def only(self, cells: Array) -> Partition:
        """Return some of its cells, which cover less than the sphere."""
        fields = ("starts", "level", "x", "y", "integrals", "errors")
        return replace(self, **{name: getattr(self, name)[cells] for name in fields})

    def histogram(self, w: Array) -> Array:
        """Count the directions in each cell."""
        return np.bincount(self.cells(w), minlength=len(self.starts))

    def cells(self, w: Array) -> Array:
        """Return the cell that each of the directions lies in."""
        return np.searchsorted(self.starts, _interleaved(*_places(w, self.axis)), side="right") - 1

    @property
    def centres(self) -> Array:
        """A direction in the middle of each cell, shape (cells, 3)."""
        size = 2.0**-self.level
        return _to_sphere((self.x + 0.5) * size, (self.y + 0.5) * size, self.axis)[0]

    @property
    def solid_angles(self) -> Array:
        """The solid angle of each cell, in sr."""
        size = 2.0**-self.level
        latitude = np.pi * ((self.x + 0.5) * size - 0.5)
        return 4 * np.pi * size * np.cos(latitude) * np.sin(np.pi / 2 * size)

    def merged(self, level: int) -> Array:
        """Return the number that each cell gets when all that are finer than a level are merged into cells of it."""
        ancestors = self.starts >> 2 * max(LAST_LEVEL - level, 0)
        return np.cumsum(np.diff(ancestors, prepend=-1) > 0) - 1


def partitions(
    pdf: Callable[[Array, Array], Array], pilots: Sequence[Array], wis: Sequence[Array], count: int, cells: int = 1024
) -> list[Partition]:
    """Return the partition for each of several directions of incidence.

    Args:
        pdf: the density, evaluated for one array of all directions at once, as ``pdf(of, wo)``, where ``of`` has the
            index of the direction of incidence of each.
        pilots: samples that say where the densities are; they must not be those that are tested.
        wis: the directions of incidence, of which only the azimuths count.
        count: how many samples will be tested: the integrals are precise to a part of their deviation.
        cells: no cell holds more than this part of the samples.
    """
    growing = [_grow(pilot, wi, count, cells) for pilot, wi in zip(pilots, wis, strict=True)]
    made: dict[int, Partition] = {}
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
    return [made[k] for k in range(len(growing))]


def _grow(pilot: Array, wi: Array, count: int, cells: int) -> Generator[Array, Array, Partition]:
    """Return a partition; yield the directions whose density it needs."""
    axis = azimuth_axis(wi)
    places, heights = _places(pilot, axis), (yield pilot) if len(pilot) else np.zeros(0)
    side = 1 << FIRST_LEVEL
    x, y = (index.ravel() for index in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    integrals, _ = yield from _integrals(axis, x, y, FIRST_LEVEL)
    slots, done = places[0] >> LAST_LEVEL - FIRST_LEVEL << FIRST_LEVEL | places[1] >> LAST_LEVEL - FIRST_LEVEL, []
    for level in range(FIRST_LEVEL, LAST_LEVEL + 1):
        held, peaks = np.bincount(slots, minlength=len(x)), np.zeros(len(x))
        np.maximum.at(peaks, slots, heights)
        quarters = [(2 * x + i, 2 * y + j) for i in (0, 1) for j in (0, 1)]
        qx, qy = (np.stack(index, axis=1) for index in zip(*quarters, strict=True))
        found = yield from _integrals(axis, qx.ravel(), qy.ravel(), level + 1)
        parts, highest = (each.reshape(-1, 4) for each in found)
        precise = parts.sum(axis=1)
        error = count * abs(precise - integrals)
        split = (held * cells > len(pilot)) | (error > 0.2 * np.sqrt(np.maximum(count * precise, 1)))
        missed = np.where(peaks > 2 * highest.max(axis=1), count * peaks * 2 * np.pi**2 * 4.0**-level, 0)
        share = len(pilot) * precise
        surplus = abs(held - share)
        split |= (missed > 1) | (surplus > 3 * np.sqrt(np.maximum(share, 0) + 1) + 2)
        if split.sum() > MOST:  # singular along a line, or wrong everywhere
            urgency = split * np.maximum(np.maximum(error, missed), surplus)
            split &= urgency >= np.partition(urgency, -MOST)[-MOST]
        if level == LAST_LEVEL:
            split[:] = False
        whole = ~split
        doubt = np.maximum(error, missed) / count
        done.append((np.full(whole.sum(), level), *(field[whole] for field in (x, y, precise, doubt))))
        x, y, integrals = qx[split].ravel(), qy[split].ravel(), parts[split].ravel()
        if not len(x):
            break
        inside = split[slots]
        places, heights, parents = places[:, inside], heights[inside], (np.cumsum(split) - 1)[slots[inside]]
        i, j = places >> LAST_LEVEL - level - 1 & 1
        slots = 4 * parents + 2 * i + j
    levels, x, y, integrals, errors = (np.concatenate(column) for column in zip(*done, strict=True))
    shift = LAST_LEVEL - levels
    starts = _interleaved(x << shift, y << shift)
    order = np.argsort(starts)
    return Partition(axis, starts[order], *(field[order] for field in (levels, x, y, integrals, errors)))


def _integrals(axis: Array, x: Array, y: Array, level: int) -> Generator[Array, Array, tuple[Array, Array]]:
    """Return the integrals of a density over cells, and its largest value at a node of each; yield the directions whose
    density is needed."""
    size = 2.0**-level
    w, jacobian = _to_sphere(*_nodes(x, y, _NODES, size), axis)
    density = (yield w.reshape(-1, 3)).reshape(w.shape[:-1])
    integrals = np.einsum("kij,i,j->k", density * jacobian, _WEIGHTS, _WEIGHTS) * size * size
    return integrals, density.max(axis=(1, 2), initial=0)


def _nodes(x: Array, y: Array, nodes: Array, size: Array | float) -> tuple[Array, Array]:
    """Return the coordinates of nodes of cells, shapes (cells, nodes, 1) and (cells, 1, nodes)."""
    px, py = ((at[:, None] + nodes) * np.reshape(size, (-1, 1)) for at in (x, y))
    return px[:, :, None], py[:, None, :]


def _to_sphere(px: Array, py: Array, axis: Array) -> tuple[Array, Array]:
    """Return the directions, in float32, of points of the unit square, and the solid angle of its unit area there."""
    latitude, longitude = np.pi * (px - 0.5), 2 * np.pi * py
    cos, across, right, up = np.cos(latitude), np.sin(latitude), np.cos(longitude), np.sin(longitude)
    # Coordinate by coordinate, as Dr.Jit's arrays are.
    w = np.empty((3, *np.broadcast_shapes(px.shape, py.shape)), np.float32)
    w[0] = axis[0] * cos * right - axis[1] * across
    w[1] = axis[1] * cos * right + axis[0] * across
    w[2] = cos * up
    return np.moveaxis(w, 0, -1), 2 * np.pi**2 * cos


def _places(w: Array, axis: Array) -> Array:
    """Return the cells of the last level that directions lie in, shape (2, N)."""
    w = np.asarray(w, np.float64)
    along, across = axis[0] * w[:, 0] + axis[1] * w[:, 1], axis[0] * w[:, 1] - axis[1] * w[:, 0]
    latitude = np.arctan2(across, np.hypot(along, w[:, 2]))
    longitude = np.arctan2(w[:, 2], along) / (2 * np.pi)
    points = np.stack([latitude / np.pi + 0.5, np.where(longitude < 0, longitude + 1, longitude)])
    return (points * (1 << LAST_LEVEL)).astype(np.int64).clip(0, (1 << LAST_LEVEL) - 1)


def _interleaved(x: Array, y: Array) -> Array:
    """Return the place of cells along the Z-order curve."""

    def spread(v: Array) -> Array:
        v = v.astype(np.int64)
        for shift, mask in ((16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F),
                            (2, 0x3333333333333333), (1, 0x5555555555555555)):  # fmt: skip
            v = (v | v << shift) & mask
        return v

    return spread(x) | spread(y) << 1
