"""Scattered samples as a grid: what lies between them."""

from __future__ import annotations

import numpy as np

from .arrays import NUMPY, components, stacked
from .coordinates import HalfDifference, polar_angle
from .measurement import Axis, Extrapolation, Grid, Samples

NEIGHBOURS = 10
"""How many samples a value is interpolated between."""
NODES_PER_SAMPLE, LEAST_NODES, MOST_NODES = 12, 8_000, 200_000
SHARES = np.array([2.0, 1.5, 1.0, 1.5])
"""How finely √θh, θd, φd in [0, π/2] and φh are divided, compared with each other."""
BLOCK = 128
"""How many nodes next to each other are interpolated at once."""
RIDGE = 1e-2
"""How much the weights prefer their start to balancing, in units of the neighbourhood: the samples around a node at the
rim of what was measured cannot balance."""


def gridded(samples: Samples, extrapolate: Extrapolation = "hold") -> Grid:
    """Return samples as a grid of half and difference angles, in which highlights stay in place.

    Each node has a mean of the ten nearest samples, with weights that are positive and sum to one, so that nothing
    rings: they are those of Franke and Little (R. Franke, Scattered data interpolation, Math. Comp. 38, 1982,
    doi:10.1090/S0025-5718-1982-0637296-4), which reproduce the samples, tilted with the least relative entropy such
    that the samples balance about the node (M. Arroyo and M. Ortiz, Local maximum-entropy approximation schemes,
    IJNME 65, 2006, doi:10.1002/nme.1534), which reproduces straight lines. Distances are those of :func:`embedded`:
    exchanging the directions, and mirroring both if the material is isotropic, change nothing. Samples that coincide
    are averaged. The axes are as fine as the samples are dense.

    What was measured are pairs of polar angles within the ranges of the samples'. Beyond them, nodes have the mean of
    the nearest samples (``hold``), or no value (NaN, ``zero``).

    Raises:
        ValueError: if no sample has a value.
    """
    known = np.all(np.isfinite(samples.values), axis=1)
    if not np.any(known):
        raise ValueError("No sample has a value.")
    wi, wo, anisotropic = samples.wi[known], samples.wo[known], samples.anisotropic
    points, values = merged(embedded(wi, wo, anisotropic), samples.values[known])
    coordinates = HalfDifference(reciprocal=True, anisotropic=anisotropic)
    axes = spaced(coordinates.locate(components(wi), components(wo), NUMPY), len(points))
    half = len(axes[2].nodes) // 2 + 1
    # Isotropic tables are symmetric about φd = π/2.
    counted = [axis.nodes if k != 2 or anisotropic else axis.nodes[:half] for k, axis in enumerate(axes)]
    directions = coordinates.directions(*np.meshgrid(*counted, indexing="ij"))
    shape = tuple(len(nodes) for nodes in counted)
    nodes = embedded(stacked(directions[0]), stacked(directions[1]), anisotropic).reshape(-1, points.shape[1])
    table = interpolated(points, values, nodes, shape).reshape(*shape, -1)
    if extrapolate == "zero":
        table[~measured(wi, wo, *(polar_angle(w) for w in directions))] = np.nan
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


def spaced(places: tuple[np.ndarray, ...], count: int) -> tuple[Axis, ...]:
    """Return axes for ``count`` samples, half of whose nodes are spread evenly, and half as the samples' places are."""
    shares = SHARES[: len(places)]
    size = np.clip(NODES_PER_SAMPLE * count, LEAST_NODES, MOST_NODES)
    numbers = np.maximum(np.round(shares * (size / np.prod(shares)) ** (1 / len(shares))), 4).astype(int)
    root, theta_d = (
        Axis(spread(place, end, number), low=0, high=end)
        for place, end, number in zip(places, (1.0, np.pi / 2), numbers, strict=False)
    )
    azimuths = [Axis(np.arange(n) * (period / n), period=period) for n, period in ((2 * numbers[2], np.pi),)]
    if len(places) > 3:
        azimuths.append(Axis(np.arange(2 * numbers[3]) * (np.pi / numbers[3]), period=2 * np.pi))
    return (root, theta_d, *azimuths)


def spread(places: np.ndarray, end: float, count: int) -> np.ndarray:
    """Return nodes from 0 to ``end``, whose density is the mean of a constant one and of that of some places."""
    x = np.linspace(0, end, 8 * count + 1)
    share = (x / end + np.searchsorted(np.sort(places), x, side="right") / len(places)) / 2
    share[0], share[-1] = 0, 1
    return np.interp(np.linspace(0, 1, count), share, x)


def measured(
    wi: np.ndarray, wo: np.ndarray, theta_i: np.ndarray, theta_o: np.ndarray, margin: float = 1e-3
) -> np.ndarray:
    """Return which polar angles lie within those of samples, exchanged or not."""
    ranges = [(angles.min() - margin, angles.max() + margin) for angles in map(polar_angle, map(components, (wi, wo)))]

    def within(*angles: np.ndarray) -> np.ndarray:
        return np.all([(low <= a) & (a <= high) for a, (low, high) in zip(angles, ranges, strict=True)], axis=0)

    return within(theta_i, theta_o) | within(theta_o, theta_i)


def interpolated(points: np.ndarray, values: np.ndarray, nodes: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return values at nodes, shape (nodes, channels), which are those of a grid of some shape: blocks of it are near
    each other."""
    count = min(NEIGHBOURS, len(points) - 1)
    if count < 1:
        return np.repeat(values, len(nodes), axis=0)
    result = np.empty((len(nodes), values.shape[1]))
    for block in blocks(shape):
        near = candidates(points, nodes[block], count + 1)
        squared = np.sum((nodes[block][:, None] - points[near]) ** 2, axis=-1)
        nearest = np.argpartition(squared, count, axis=1)[:, : count + 1]
        index = near[nearest]
        weight = weights(points[index] - nodes[block][:, None], np.take_along_axis(squared, nearest, axis=1))
        result[block] = np.einsum("nk,nkc->nc", weight, values[index])
    return result


def blocks(shape: tuple[int, ...]) -> list[np.ndarray]:
    """Return the flat indices of the nodes of a grid, in cubes of about ``BLOCK``."""
    side = max(round(BLOCK ** (1 / len(shape))), 1)
    cells = np.meshgrid(*(np.arange(n) // side for n in shape), indexing="ij")
    cell = np.ravel_multi_index(tuple(cells), tuple(-(-n // side) for n in shape)).ravel()
    order = np.argsort(cell, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)


def candidates(points: np.ndarray, nodes: np.ndarray, count: int) -> np.ndarray:
    """Return the indices of points among which are the nearest of each node: no further from the middle of the nodes
    than its own nearest and twice the nodes' reach."""
    middle = (nodes.min(axis=0) + nodes.max(axis=0)) / 2
    reach = np.sqrt(np.max(np.sum((nodes - middle) ** 2, axis=1)))
    distance = np.sqrt(np.sum((points - middle) ** 2, axis=1))
    return np.flatnonzero(distance <= np.partition(distance, count - 1)[count - 1] + 2 * reach + 1e-12)


def weights(offsets: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """Return weights for points at offsets from a node, shape (nodes, points, dimensions): see :func:`gridded`."""
    distance = np.sqrt(np.maximum(squared, 1e-18))
    radius = np.max(distance, axis=1, keepdims=True) * 1.0001
    start = 2 * np.log((radius - distance) / (radius * distance))
    offsets = offsets / radius[..., None]
    tilt = np.zeros((len(offsets), offsets.shape[-1]))
    ridge = RIDGE * np.eye(offsets.shape[-1])
    for _ in range(10):  # Newton's method, for the root of the tilted mean
        weight = softmax(start + np.einsum("nkd,nd->nk", offsets, tilt))
        mean = np.einsum("nk,nkd->nd", weight, offsets)
        spread = np.einsum("nk,nkd,nke->nde", weight, offsets, offsets) - mean[:, :, None] * mean[:, None, :] + ridge
        step = np.linalg.solve(spread, (mean + RIDGE * tilt)[..., None])[..., 0]
        tilt -= step * np.minimum(1, 2 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))
    return softmax(start + np.einsum("nkd,nd->nk", offsets, tilt))


def softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max(axis=1, keepdims=True))
    return e / e.sum(axis=1, keepdims=True)
