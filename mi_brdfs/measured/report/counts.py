"""How many values a measurement has, of what kind, and at which angles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import components
from ..coordinates import polar_angle
from ..grid import Grid
from ..scattered import Samples

AT_ONCE = 1 << 18
"""The most pairs of directions in memory together."""
HORIZON = 1e-6
"""The cosine up to which a direction is in the horizon."""
Range = tuple[float, float]


@dataclass(frozen=True)
class Counts:
    """How many values there are, one for each pair of directions and channel, and how many of a kind."""

    values: int = 0
    negative: int = 0
    missing: int = 0
    """Not a number, or infinite."""
    zero: int = 0


@dataclass(frozen=True)
class Census:
    """What :func:`census` counts."""

    above: Counts
    """Pairs of directions that are both above the horizon."""
    below: Counts
    """The others, also those in the horizon: grids have nodes there, where files hold anything."""
    least: float
    most: float
    """The least and the largest finite value above the horizon."""
    theta_i: Range
    theta_o: Range
    """The measured angles to the normal, in degrees: the ends of a grid's axis, all for half and difference angles,
    which no direction escapes, and else those of finite values above the horizon."""


def census(data: Grid | Samples) -> Census:
    """Count the values of a measurement. Where none is finite, the least is above the largest."""
    counts = np.zeros((2, 4), dtype=int)
    ranges = [(math.inf, -math.inf)] * 3
    for wi, wo, values in batches(data):
        # A node in the horizon is a rounding error above or below it.
        above = (wi[:, 2] > HORIZON) & (wo[:, 2] > HORIZON)
        finite = np.isfinite(values)
        kinds = np.stack([np.ones_like(finite), finite & (values < 0), ~finite, values == 0])
        counts += [kinds[:, side].sum(axis=(1, 2)) for side in (above, ~above)]
        known = above & finite.any(axis=1)
        numbers, angles = values[known], [np.degrees(polar_angle(components(w[known]))) for w in (wi, wo)]
        ranges = [
            (float(found.min(initial=low)), float(found.max(initial=high)))
            for (low, high), found in zip(ranges, (numbers[np.isfinite(numbers)], *angles), strict=True)
        ]
    upper, lower = (Counts(*of.tolist()) for of in counts)
    (least, most), theta_i, theta_o = ranges
    return Census(upper, lower, least, most, _ends(data, "theta_i", theta_i), _ends(data, "theta_o", theta_o))


def _ends(data: Grid | Samples, name: str, ends: Range) -> Range:
    """Return the measured range of an angle, whose values were seen between two ends."""
    if isinstance(data, Grid):
        if name in data.coordinates.names:
            axis = data.axes[data.coordinates.names.index(name)]
            ends = float(np.degrees(axis.low)), float(np.degrees(axis.high))
        elif "theta_d" in data.coordinates.names:
            return 0, 90
    return round(ends[0], 4), round(ends[1], 4)


def in_one_plane(data: Grid | Samples) -> bool:
    """Return whether all pairs of directions are in planes through the normal: beside those, a table only guesses."""
    return all(np.all(abs(wi[:, 0] * wo[:, 1] - wi[:, 1] * wo[:, 0]) < 1e-3) for wi, wo, _ in batches(data))


def batches(data: Grid | Samples) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    count = data.values[..., 0].size
    for start in range(0, count, AT_ONCE):
        yield data.pairs(slice(start, start + AT_ONCE))
