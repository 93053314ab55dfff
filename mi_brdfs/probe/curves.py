"""The figures' data: curves in the plane of incidence, maps of the hemisphere, meshes of the sphere.

Angles are in degrees. In the plane of incidence θ is signed: 0 is the normal, wi is at -θ_i and its mirror image at
θ_i; transmission lies beyond ±90. Values are the luminance of f |cosθ_o|, as ``eval`` returns it. Directions drawn by
the sampler locate narrow lobes: none is too narrow to be found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, luminance
from .bsdf import BSDFProbe
from .directions import direction, from_plane, on_side, to_plane
from .variates import lattice, random

GRAZING = 89.99
"""The last angle drawn above the horizon."""
MOST_POINTS = 20_000


class Curve(NamedTuple):
    """Values over the signed angle, in increasing order."""

    theta: Array
    value: Array


def transmits(probe: BSDFProbe) -> bool:
    """Return whether a part that is not a delta function transmits light."""
    return probe.whole.has(mi.BSDFFlags.Transmission)


def in_plane(theta: ArrayLike, azimuth: float) -> Array:
    """Return the directions at signed angles in the plane of incidence, shape (N, 3), float32."""
    return direction(-np.asarray(theta), np.full(np.shape(theta), azimuth)).T


def value(probe: BSDFProbe, wi: Array, wo: Array, channel: int | None = None) -> Array:
    """Return f |cosθ_o|, its luminance or a channel of it, shape (N,)."""
    return _reduced(probe.eval(probe.whole, wi, wo), channel) if len(wo) else np.zeros(0)


def _reduced(colours: Array, channel: int | None) -> Array:
    return luminance(colours) if channel is None else colours[..., channel]


def drawn(probe: BSDFProbe, wi: Array, count: int) -> Array:
    """Return directions drawn by the sampler, without those of black samples, shape (at most count, 3)."""
    samples = probe.sample(probe.whole, wi, random(count, 1))
    return samples.wo[samples.lit]


def largest(values: Iterable[Array]) -> float:
    """Return the largest finite value in some arrays, or 1 if none is above 0."""
    found = max(float(np.max(each, where=np.isfinite(each), initial=0)) for each in values)
    return found if found > 0 else 1.0


def decades(values: Iterable[Array], peak: float) -> tuple[int, float]:
    """Return the decade where a logarithmic scale begins, and the logarithm of its largest value. The scale shows nine
    tenths of the values above 0 in each array, but at least two decades and at most five."""
    high = float(np.log10(peak))
    return int(np.floor(np.clip(np.log10(dim(values)), high - 5, high - 2))), high


def dim(values: Iterable[Array]) -> float:
    """Return the least tenth percentile of the positive values of some arrays."""
    return min((np.quantile(each[each > 0], 0.1) for each in values if (each > 0).any()), default=1.0)


# --- Curves ---------------------------------------------------------------------------------------------------------


def in_plane_of_incidence(probe: BSDFProbe, theta_i: float, azimuth: float, channel: int | None = None) -> Curve:
    """Return the lobe in the plane of incidence, in both half-spaces if the BSDF transmits, with the finest steps where
    it bends most: straight lines between its points stay within 0.2 % of the peak and 2 % of the value."""
    wi = direction(theta_i, azimuth)
    wo = drawn(probe, wi, 4096)
    along = -(wo[:, 0] * np.cos(np.radians(azimuth)) + wo[:, 1] * np.sin(np.radians(azimuth)))
    seeds = np.degrees(np.arctan2(along, wo[:, 2]))
    seeds = np.quantile(seeds, np.linspace(0, 1, 129)) if len(seeds) else seeds
    seeds = np.concatenate([seeds, [-theta_i, 0, theta_i]])
    pieces = [(-GRAZING, GRAZING)]
    if transmits(probe):
        pieces = [(-180, GRAZING - 180), *pieces, (180 - GRAZING, 180)]
    curves = []
    for start, end in pieces:
        inside = seeds[(seeds > start) & (seeds < end)]
        theta = np.unique(np.concatenate([np.linspace(start, end, 2 * round(end - start) + 1), inside]))
        curves.append(refined(lambda angles: value(probe, wi, in_plane(angles, azimuth), channel), theta))
    return Curve(*(np.concatenate(column) for column in zip(*curves, strict=True)))


def refined(evaluate: Callable[[Array], Array], theta: Array) -> Curve:
    """Return a curve through points at these angles, and between them wherever it departs from the chord."""
    value, left = evaluate(theta), np.arange(len(theta) - 1)
    while len(left) and len(theta) < MOST_POINTS:
        width, between = theta[left + 1] - theta[left], (theta[left] + theta[left + 1]) / 2
        middle = evaluate(between)
        a, b, c = (np.nan_to_num(each, posinf=0) for each in (value[left], middle, value[left + 1]))
        theta, value = np.insert(theta, left + 1, between), np.insert(value, left + 1, middle)
        peak = np.nan_to_num(value, posinf=0).max()
        off = abs(b - (a + c) / 2) > 2e-3 * peak
        with np.errstate(divide="ignore"):
            a, b, c = (np.log(np.maximum(each, 1e-7 * peak)) if peak else each for each in (a, b, c))
        off |= abs(b - (a + c) / 2) > 0.02
        off &= width > 1e-4
        first = (left + np.arange(len(left)))[off]  # of the two halves, each as far on as there are new points before
        left = np.sort(np.concatenate([first, first + 1]))
    return Curve(theta, value)


def albedo(probe: BSDFProbe, azimuth: float, channel: int | None = None, log2_count: int = 9) -> Curve:
    """Return the fraction of light reflected or transmitted over the angle of incidence, delta functions included.

    It is the mean weight of samples of the BSDF's own sampler, with the same variates at each angle, so that the curve
    is smooth. Where measured data have none of the plane of incidence, it is NaN.
    """
    theta = np.concatenate([np.arange(0, 77.5, 2.5), np.arange(78, 88), [88, 88.5, 89, 89.5, 89.9]])
    points = lattice(log2_count, 5)
    wi = direction(theta, np.full(len(theta), azimuth)).T.repeat(len(points), axis=0)
    samples = probe.sample(probe.whole, wi, np.tile(points, (len(theta), 1)))
    weight = _reduced(samples.weight, channel) * samples.eta**2  # refraction compresses radiance, but not energy
    mean = weight.reshape(len(theta), -1).mean(axis=1)
    if probe.data is not None:
        wo = in_plane(np.arange(-89, 90), azimuth)
        seen = [probe.data.seen(direction(each, azimuth), wo).any() for each in theta]
        mean = np.where(seen, mean, np.nan)
    return Curve(theta, mean)


# --- Maps and meshes ------------------------------------------------------------------------------------------------


def disc(
    probe: BSDFProbe, theta_i: float, azimuth: float, side: int, resolution: int, channel: int | None = None
) -> Array:
    """Return a picture of the hemisphere above (1) or below (-1), in rows from the bottom, each pixel the mean over it.

    It is the disc of :func:`~mi_brdfs.probe.directions.to_plane` with wi on the left; pixels outside repeat its rim.
    Pixels with many samples are divided more finely. Where the middle of one is not among measured data, it is NaN.
    """
    wi, n, data = direction(theta_i, azimuth), resolution, probe.data
    probe = replace(probe, data=None)  # which asks for each of many samples
    axis = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    wo = drawn(probe, wi, 1 << 14)
    x, y = (
        np.clip(((each / 90 + 1) * n / 2).astype(int), 0, n - 1) for each in to_plane(wo[wo[:, 2] * side > 0], axis)
    )
    crowded = np.bincount(y * n + x, minlength=n * n) > len(wo) / 1000
    picture = np.zeros(n * n)

    def within(pixels: Array, parts: int) -> Array:
        step = np.stack(np.meshgrid(np.arange(parts), np.arange(parts)), axis=-1).reshape(-1, 2) + 0.5
        corner = np.stack([pixels % n, pixels // n], axis=-1)
        points = 90 * ((corner[:, None] + step / parts) * 2 / n - 1).reshape(-1, 2)
        points /= np.maximum(np.hypot(*points.T) / GRAZING, 1)[:, None]
        return from_plane(points[:, 0], points[:, 1], side, axis).astype(np.float32)

    for pixels, parts in ((np.flatnonzero(~crowded), 3), (np.flatnonzero(crowded), 48)):
        values = value(probe, wi, within(pixels, parts), channel)
        picture[pixels] = values.reshape(len(pixels), parts * parts).mean(axis=1)
    if data is not None:
        seen = data.seen(wi, within(np.arange(n * n), 1)).reshape(n, n)
        # What was measured in the plane of incidence alone is a line.
        seen[[(n - 1) // 2, n // 2]] |= data.seen(wi, in_plane(180 * (np.arange(n) + 0.5) / n - 90, azimuth))
        picture[~seen.ravel()] = np.nan
    return picture.reshape(n, n)


def meshes(
    probe: BSDFProbe, theta_i: float, azimuth: float, resolution: int, channel: int | None = None
) -> Iterator[tuple[Array, Array, Array]]:
    """Yield the lobe over all directions, ``(theta, phi, value)`` for each half-space into which it reflects or
    transmits: ``resolution`` parallels and twice as many meridians, and as many again where the sampler draws
    directions, and the values where they cross; θ is the angle to the normal or its opposite."""
    wi = direction(theta_i, azimuth)
    wo = drawn(probe, wi, 4096)
    for side in (1, -1) if transmits(probe) else (1,):
        mine = wo[wo[:, 2] * side > 0].astype(np.float64)
        theta = np.degrees(np.arctan2(np.hypot(mine[:, 0], mine[:, 1]), abs(mine[:, 2])))
        phi = np.degrees(np.arctan2(mine[:, 1], mine[:, 0])) % 360
        theta = _lines(np.linspace(0, GRAZING, resolution), theta, theta_i)
        phi = _lines(np.linspace(0, 360, 2 * resolution), phi, (azimuth + 180) % 360)
        grid = np.stack([angles.ravel() for angles in np.meshgrid(theta, phi, indexing="ij")])
        values = value(probe, wi, on_side(direction(*grid).T, side), channel)
        yield theta, phi, values.reshape(len(theta), len(phi))


def _lines(even: Array, sampled: Array, mirror: float) -> Array:
    """Return the angles of grid lines."""
    dense: Any = np.quantile(sampled, np.linspace(0, 1, len(even))) if len(sampled) else []
    return np.unique(np.concatenate([even, dense, [mirror]]).clip(even[0], even[-1]))
