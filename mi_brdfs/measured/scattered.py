"""Scattered samples, and a grid of what lies between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .arrays import NUMPY, components, stacked
from .coordinates import HalfDifference, polar_angle
from .grid import Axis, Extrapolation, Grid

THINNEST = np.radians(6)
"""Half of the least range of angles that counts as measured."""
LEEWAY = 1e-3
"""By how much an angle may miss the range of samples, whose angles are written with few digits."""
NEIGHBOURS = 10
"""How many samples a value is interpolated between."""
NODES_PER_SAMPLE, LEAST_NODES, MOST_NODES = 100, 20_000, 120_000
MOST_VALUES = 1 << 23
"""The most nodes times channels: spectra with many wavelengths get fewer nodes."""
SHARES = {False: np.array([4.0, 4.0, 1.0]), True: np.array([2.0, 1.5, 1.5, 2.0])}
"""How finely √θh, θd, φd (of isotropic materials, only up to π/2) and φh are divided, compared with each other."""
PAIRS, CHUNK, CHUNK_VALUES = 1 << 14, 8192, 1 << 18
"""How many distances are computed at once, and how many nodes and values are interpolated at once."""
RIDGE = 1e-2
"""How much the weights prefer their start to balancing, in units of the neighbourhood: the samples around a node at the
rim of what was measured cannot balance."""


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


def as_grid(data: Grid | Samples, extrapolate: Extrapolation = "hold") -> Grid:
    """Return measured values on a grid, which has ``evaluate``: their own, or for samples one of half and difference
    angles, in which highlights stay in place.

    Each node has a mean of the ten nearest samples, with weights that are positive and sum to one, so that nothing
    rings: they are those of Franke and Little (R. Franke, Scattered data interpolation, Math. Comp. 38, 1982,
    doi:10.1090/S0025-5718-1982-0637296-4), which reproduce the samples, tilted with the least relative entropy such
    that the samples balance about the node (M. Arroyo and M. Ortiz, Local maximum-entropy approximation schemes,
    IJNME 65, 2006, doi:10.1002/nme.1534), which reproduces straight lines. Distances are those of :func:`embedded`:
    exchanging the directions, and mirroring both if the material is isotropic, change nothing. Samples that coincide
    are averaged. The axes are finer where samples are dense or bright.

    What was measured are pairs of polar angles within the ranges of the samples'. Beyond them, nodes have the mean of
    the nearest samples (``hold``), or no value (NaN, ``zero``), like those below the horizon.

    Raises:
        ValueError: if no sample has a value.
    """
    if isinstance(data, Grid):
        return data
    known = data.known
    if not np.any(known):
        raise ValueError("No sample has a value.")
    wi, wo, anisotropic = data.wi[known], data.wo[known], data.anisotropic
    points, values = merged(embedded(wi, wo, anisotropic), data.values[known])
    coordinates = HalfDifference(reciprocal=True, anisotropic=anisotropic)
    places = coordinates.locate(components(wi), components(wo), NUMPY)
    size = min(np.clip(NODES_PER_SAMPLE * len(points), LEAST_NODES, MOST_NODES), MOST_VALUES // values.shape[1])
    axes = spaced(places, np.maximum(data.values[known], 0).sum(axis=1), size)
    half = len(axes[2].nodes) // 2 + 1
    # Isotropic tables are symmetric about φd = π/2.
    counted = [axis.nodes if k != 2 or anisotropic else axis.nodes[:half] for k, axis in enumerate(axes)]
    light, view = coordinates.directions(*np.meshgrid(*counted, indexing="ij"))
    pairs = stacked(light), stacked(view)
    asked = data.measured(*pairs) if extrapolate == "zero" else (light.z > 0) & (view.z > 0)
    nodes = embedded(pairs[0][asked], pairs[1][asked], anisotropic)
    table = np.full((*asked.shape, values.shape[1]), np.nan)
    table[asked] = interpolated(points, values, nodes)
    if not anisotropic:
        table = np.concatenate([table, table[:, :, half - 2 : 0 : -1]], axis=2)
    return Grid(coordinates, axes, table)


def embedded(wi: np.ndarray, wo: np.ndarray, anisotropic: bool) -> np.ndarray:
    """Return pairs of directions, shape (…, 3), as points between which Euclid's distance says how much a BRDF can
    differ: θh and θd in units of π/2, and φd as far as turning d moves it about a tilted h. An anisotropic pair has the
    vector of θh and φh, and θd with twice the azimuth of the difference, which does not tell wi and wo apart."""
    root, theta_d, phi_d = HalfDifference().locate(components(wi), components(wo), NUMPY)
    theta_h, theta_d = root**2, theta_d / (np.pi / 2)
    if not anisotropic:
        turn = np.minimum(phi_d, np.pi - phi_d)
        return np.stack([theta_h, theta_d, theta_h * np.sin(theta_d * (np.pi / 2)) * turn], axis=-1)
    phi_h = np.arctan2(wi[..., 1] + wo[..., 1], wi[..., 0] + wo[..., 0])
    psi = 2 * np.arctan2(wi[..., 1] - wo[..., 1], wi[..., 0] - wo[..., 0])
    return np.stack(
        [theta_h * np.cos(phi_h), theta_h * np.sin(phi_h), theta_d * np.cos(psi), theta_d * np.sin(psi)], axis=-1
    )


def merged(points: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points that differ, and the means of the values there."""
    _, first, group = np.unique(np.round(points, 4), axis=0, return_index=True, return_inverse=True)
    group = group.ravel()
    total = np.zeros((len(first), values.shape[1]))
    np.add.at(total, group, values)
    return points[first], total / np.bincount(group)[:, None]


def spaced(places: tuple[np.ndarray, ...], brightness: np.ndarray, size: int) -> tuple[Axis, ...]:
    """Return axes for samples at some places of some brightness, with about ``size`` nodes to interpolate at."""
    shares = SHARES[len(places) > 3]
    root, theta_d, *azimuths = np.maximum(shares * (size / np.prod(shares)) ** (1 / len(shares)), 4).astype(int)
    halves = [(azimuths[0], np.pi), (azimuths[1], 2 * np.pi)] if len(azimuths) > 1 else [(2 * azimuths[0], np.pi)]
    return (
        Axis(spread(places[0], brightness, 1, root), low=0, high=1),
        Axis(spread(places[1], brightness, np.pi / 2, theta_d), low=0, high=np.pi / 2),
        *(Axis(np.arange(n) * (period / n), period=period) for n, period in halves),
    )


def spread(places: np.ndarray, brightness: np.ndarray, end: float, count: int) -> np.ndarray:
    """Return nodes from 0 to ``end``: a third spread evenly, a third as samples are, a third as their brightness is."""
    x = np.linspace(0, end, 8 * count + 1)
    order = np.argsort(places)
    share = x / end
    for weight in (np.ones(len(places)), brightness + 1e-9):
        below = np.append(0, np.cumsum(weight[order]))
        share = share + below[np.searchsorted(places[order], x, side="right")] / below[-1]
    share[0], share[-1] = 0, 3
    return np.interp(np.linspace(0, 3, count), share, x)


def interpolated(points: np.ndarray, values: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return values at nodes, shape (nodes, channels)."""
    if len(points) == 1:
        return np.repeat(values, len(nodes), axis=0)
    index = nearest(points, nodes, min(NEIGHBOURS + 1, len(points)))
    result = np.empty((len(nodes), values.shape[1]))
    step = max(1, min(CHUNK, CHUNK_VALUES // values.shape[1]))
    for start in range(0, len(nodes), step):
        chunk = slice(start, start + step)
        weight = weights(points[index[chunk]] - nodes[chunk, None])
        result[chunk] = np.einsum("nk,nkc->nc", weight, values[index[chunk]])
    return result


def nearest(points: np.ndarray, nodes: np.ndarray, count: int) -> np.ndarray:
    """Return the indices of the nearest points of each node, shape (nodes, count).

    Nodes are halved until few are left, and with them the points in question: those of a group are no further from its
    box than the middle's own are from that, and the reach of the group."""
    index = np.empty((len(nodes), count), dtype=np.int64)
    groups = [(np.arange(len(nodes)), np.arange(len(points)))]
    while groups:
        group, near = groups.pop()
        low, high = nodes[group].min(axis=0), nodes[group].max(axis=0)
        middle = (low + high) / 2
        reach = np.sqrt(np.max(np.sum((nodes[group] - middle) ** 2, axis=1)))
        offset = abs(points[near] - middle)
        own = np.partition(np.einsum("nd,nd->n", offset, offset), count - 1)[count - 1]
        outside = np.maximum(offset - (high - low) / 2, 0)
        near = near[np.einsum("nd,nd->n", outside, outside) <= (np.sqrt(own) + reach + 1e-12) ** 2]
        if len(group) * len(near) > PAIRS and len(group) > 1:
            order = np.argsort(nodes[group, np.argmax(high - low)])
            groups += [(group[half], near) for half in np.array_split(order, 2)]
        else:
            squared = np.sum((nodes[group][:, None] - points[near]) ** 2, axis=-1)
            index[group] = near[np.argpartition(squared, count - 1, axis=1)[:, :count]]
    return index


def weights(offsets: np.ndarray) -> np.ndarray:
    """Return weights for points at offsets from a node, shape (nodes, points, dimensions): see :func:`as_grid`."""
    distance = np.maximum(np.sqrt(np.sum(offsets**2, axis=-1)), 1e-9)
    radius = np.max(distance, axis=1, keepdims=True) * 1.0001
    start = 2 * np.log((radius - distance) / (radius * distance))
    offsets = offsets / radius[..., None]
    transposed = np.swapaxes(offsets, 1, 2)
    tilt = np.zeros((len(offsets), offsets.shape[-1], 1))
    ridge = RIDGE * np.eye(offsets.shape[-1])
    for _ in range(8):  # Newton's method, for the root of the tilted mean
        weight = softmax(start + (offsets @ tilt)[..., 0])[..., None]
        mean = transposed @ weight
        spread = transposed @ (offsets * weight) - mean @ np.swapaxes(mean, 1, 2) + ridge
        step = np.linalg.solve(spread, mean + RIDGE * tilt)
        tilt -= step * np.minimum(1, 2 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))
    return softmax(start + (offsets @ tilt)[..., 0])


def softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)
