"""Rows of directions and values, as text files have them: a grid where they fill one, and single samples otherwise.

Angles are θi, φi, θo and φo in radians, four arrays of shape (N,)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from .arrays import stacked
from .coordinates import TWO_PI, Spherical, spherical, wrapped
from .files import TextFile
from .grid import Axis, Grid
from .measurement import Measurement
from .scattered import Samples

Angles: TypeAlias = Sequence[np.ndarray]
SAME = 1e-6
"""By how much, in radians, angles of one node may differ."""
ONE_AZIMUTH = math.radians(0.5)
"""And azimuths of a light that stays where it is, as encoders read them."""
COARSE = math.radians(25)
"""The step from which half and difference angles interpolate rough highlights as well as a table or better."""
WIDE = math.radians(40)
"""The gap between azimuths of incidence of which reports tell."""
LEAST_COSINE = 1e-4
"""Below it, f cosθ says nothing of f."""


def measured(
    file: TextFile, format: str, angles: Angles, values: np.ndarray, wavelengths: np.ndarray | None, **said: Any
) -> Measurement:
    """Return the rows of a file, of values of shape (N, channels), as a measurement, with what else is ``said`` of it.
    Values of f cosθ are divided by the cosine. Raise a FileError for angles that no direction above the surface has."""
    for name, column, most in zip("θφθφ", angles, (90, 720, 90, 720), strict=True):
        good = abs(column) <= math.radians(most) + SAME
        if not np.all(good):
            k = int(np.argmin(good))
            angle = math.degrees(column[k])
            raise file.error(f"{name} is {angle:.4g}°; it must be from -{most}° to {most}°", file.row_lines[k])
    if said.get("quantity") == "f cos":
        values = without_cosine(values, np.cos(angles[2]))
    said["material"] = said.get("material") or file.path.stem
    return Measurement(file.path, format, arranged(angles, values), wavelengths, **said)


def arranged(angles: Angles, values: np.ndarray) -> Grid | Samples:
    """Return rows as a grid of :class:`~mi_brdfs.measured.coordinates.Spherical` angles if each of them is there with
    each other, and as samples if not. Rows of a single φi or φo, or of two that are opposite, are of an isotropic
    material. A negative θ means the other side of the normal. Values of the same angles are averaged, with a warning if
    one is more than twice another."""
    warn_of_contradictions(angles, values)
    theta_i, phi_i, theta_o, phi_o = angles
    theta_i, phi_i = upright(theta_i, phi_i)
    theta_o, phi_o = upright(theta_o, phi_o)
    turned_i, turned_o = phi_i[theta_i > SAME], phi_o[theta_o > SAME]
    anisotropic = not (is_single(turned_i) or (len(turned_o) and is_single(turned_o)))
    if not anisotropic:
        # At the normal the azimuth means nothing, and files have any there.
        phi_o = phi_o - np.where(theta_i > SAME, phi_i, turned_i[:1].sum())
        phi_i = np.zeros_like(phi_i)
    else:
        warn_of_a_sector(nodes_of(around_zero(turned_i))[0])
    return gathered((theta_i, phi_i, theta_o, phi_o), values, anisotropic) or Samples(
        stacked(spherical(theta_i, phi_i)), stacked(spherical(theta_o, phi_o)), values, anisotropic
    )


def warn_of_contradictions(angles: Angles, values: np.ndarray) -> None:
    """Warn of rows that say of the same directions what is no noise: two runs in one file, perhaps."""
    order = np.lexsort(angles)
    one, next_ = order[:-1], order[1:]
    again = np.logical_and.reduce([angle[one] == angle[next_] for angle in angles])
    low, high = values[one[again]], values[next_[again]]
    np.abs(low, out=low)
    np.abs(high, out=high)
    apart = (high > 2 * low) | (low > 2 * high)
    brightest = np.max(values, where=np.isfinite(values), initial=0)
    apart &= np.maximum(low, high, out=high) > 0.01 * brightest
    if count := int(np.any(apart, axis=1).sum()):
        warnings.warn(
            "Rows with the angles of others, and more than twice or less than half their values, are averaged: "
            f"{count:,}.", stacklevel=2,
        )  # fmt: skip


def warn_of_a_sector(phi_i: np.ndarray) -> None:
    """Warn of azimuths of incidence in [0, 2π) that leave out a wide part of the turn."""
    start = sector_start(phi_i)
    if start is not None and (phi_i[start] - phi_i[start - 1]) % TWO_PI > WIDE:
        low, high = np.degrees(phi_i[[start, start - 1]])
        warnings.warn(f"Light from φi = {low:.4g}° to {high:.4g}° was measured; from elsewhere, f is interpolated.",
                      stacklevel=2)  # fmt: skip


def is_single(azimuths: np.ndarray) -> bool:
    """Return whether there is at most one azimuth, but for its opposite."""
    away = wrapped(azimuths - azimuths[:1] + np.pi / 2, np.pi) - np.pi / 2
    return bool(np.all(abs(away) < ONE_AZIMUTH))


def upright(theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return directions with a polar angle that is not negative."""
    return (abs(theta), np.where(theta < 0, phi + np.pi, phi)) if np.any(theta < 0) else (theta, phi)


def gathered(angles: Angles, values: np.ndarray, anisotropic: bool) -> Grid | None:
    """Return the grid that rows fill, None if they do not, or if isotropic ones are so far apart, as in the plane of
    incidence or with a single θi, that highlights of a table would stay where they were measured."""
    theta_i, phi_i, theta_o, phi_o = angles
    delta = np.pi - around_zero(np.pi - phi_o + phi_i)
    mirrored = not anisotropic and bool(np.all(delta > -SAME) or np.all((delta < SAME) | (delta > np.pi - SAME)))
    delta = abs(delta) if mirrored else around_zero(delta)
    nodes, place, size = [], np.zeros(len(values), dtype=np.int64), 1
    for column in (theta_i, theta_o, delta, *([around_zero(phi_i)] if anisotropic else [])):
        different, rank = nodes_of(column)
        nodes.append(different)
        size *= len(different)
        if size > 2 * len(values) + 4:  # more than single rows at poles could stand for
            return None
        place = place * len(different) + rank
    if not anisotropic and any(np.diff(it).max(initial=np.pi * (len(it) == 1)) > COARSE for it in nodes):
        return None
    shape = tuple(len(each) for each in nodes)
    seen = np.isfinite(values)
    rows = np.bincount(place, minlength=size).reshape(*shape, 1)
    table, count = np.zeros((size, values.shape[1])), np.zeros((size, values.shape[1]), np.int32)
    np.add.at(table, place, np.where(seen, values, 0))
    np.add.at(count, place, seen)
    table, count = table.reshape(*shape, -1), count.reshape(*shape, -1)
    for polar in (0, 1):
        if nodes[polar][0] < SAME and not anisotropic:
            # A row at the pole stands for all azimuths.
            pole = (slice(None),) * polar + (slice(0, 1),)
            for each in (rows, table, count):
                each[pole] = each[pole].sum(axis=2, keepdims=True)
    if not np.all(rows):
        return None
    axes = [Axis(each) for each in nodes]
    for k in range(3 if mirrored else 2, len(axes)):
        if shape[k] == 1:
            continue
        if sector_start(nodes[k]) is not None:
            return None
        axes[k] = Axis(nodes[k], TWO_PI)
    with np.errstate(invalid="ignore"):  # of what no row has a value for
        return Grid(Spherical(mirrored, anisotropic), tuple(axes), table / count)


def around_zero(angle: np.ndarray) -> np.ndarray:
    """Return an azimuth in [0, 2π), or negative by rounding."""
    return wrapped(angle + SAME / 2, TWO_PI) - SAME / 2


def nodes_of(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different angles, and which of them each one is."""
    order = np.argsort(angles, kind="stable")
    rank = np.empty(len(angles), dtype=np.int64)
    rank[order] = np.append(0, np.cumsum(np.diff(angles[order]) > SAME))
    return np.bincount(rank, angles) / np.bincount(rank), rank


def sector_start(nodes: np.ndarray) -> int | None:
    """Return the index of the azimuth behind a gap much larger than all others, None if those in [0, 2π) go round."""
    gaps = np.diff(np.append(nodes, nodes[0] + TWO_PI))
    widest = int(gaps.argmax())
    return (widest + 1) % len(nodes) if gaps[widest] > 1.5 * np.delete(gaps, widest).max(initial=0) else None


def without_cosine(values: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return f for f cosθo, and NaN where the cosine is next to 0."""
    seen = cosine >= LEAST_COSINE
    with np.errstate(over="ignore"):
        return np.where(seen[:, None], values / np.where(seen, cosine, 1)[:, None], np.nan)
