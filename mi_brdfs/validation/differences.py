"""Derivatives by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..probe.arrays import Array

ROUNDING = 4e-7
"""The relative error of the difference of two values by rounding."""


class Differences(NamedTuple):
    """Derivatives, with what is known of them."""

    low: Array
    high: Array
    """The bounds of each."""
    trusted: Array
    """Which of them the two steps agree on."""
    noise: Array
    """The error of each."""


def differences(
    at: Callable[[float], Array], step: float, rounding: float = ROUNDING, leads_back: bool = True
) -> Differences:
    """Return the derivatives of some values for a parameter, by differences of two steps, extrapolated, where ``at``
    returns the values for a shift of the parameter, with that relative ``rounding`` error.

    The bounds are the same, except where the differences to the two sides do not approach each other: at a kink any
    derivative between them will do. Where one side changes nothing, the other counts, if that is so of most, as at the
    end of a range, where the derivative ``leads_back``: where it is so of some, they may be reflected totally.
    """
    centre = at(0)

    def quotients(h: float) -> tuple[Array, Array]:
        return (at(h) - centre) / h, (centre - at(-h)) / h

    (above, below), (nearer_above, nearer_below) = quotients(step), quotients(step / 2)
    noise = rounding * abs(centre) / step
    up, down = 2 * nearer_above - above, 2 * nearer_below - below
    lone = (above == 0) != (below == 0)
    if lone.sum() > 0.5 * ((above != 0) | (below != 0)).sum():
        up, down = np.where(above == 0, down, up), np.where(below == 0, up, down)
    else:
        lone[:] = False

    def agree(far: Array, near: Array) -> Array:
        return abs(near - far) <= 0.3 * np.maximum(abs(near), abs(far)) + 4 * noise

    gap, nearer_gap = abs(above - below), abs(nearer_above - nearer_below)
    kink = ~lone & agree(above, nearer_above) & agree(below, nearer_below)
    kink &= (nearer_gap > 0.75 * gap) & (nearer_gap > 0.05 * abs(nearer_above) + 4 * noise)
    first, second = (above + below) / 2, (nearer_above + nearer_below) / 2
    smooth = np.where(lone, up, (4 * second - first) / 3)
    change = np.where(lone, up - np.where(above == 0, below, above), first - second)
    # Across a peak far narrower than the steps the two sides cancel, but each grows as the step shrinks.
    grows = nearer_gap > 1.5 * gap + 4 * noise
    trusted = (kink | (abs(change) <= 0.05 * abs(smooth) + 4 * noise)) & np.where(lone, leads_back, ~grows)
    noise = noise + np.where(kink, 0, 0.5 * abs(change))
    low, high = (np.where(kink, choose(up, down), smooth) for choose in (np.minimum, np.maximum))
    return Differences(low, high, trusted & np.isfinite(low) & np.isfinite(high), noise)
