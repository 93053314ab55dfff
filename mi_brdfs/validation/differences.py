"""Derivatives by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array
from .traversal import set_value, value_of


class Differences(NamedTuple):
    """Derivatives, with what is known of them."""

    low: Array
    high: Array
    """The bounds of each."""
    trusted: Array
    """Which of them the two steps agree on."""
    noise: Array
    """The error of each."""


def differences(params: mi.SceneParameters, key: str, values: Callable[[], Array], step: float) -> Differences:
    """Return the derivatives of some values for a parameter, by differences of two steps, extrapolated.

    The bounds are the same, except where the differences to the two sides do not approach each other: at a kink any
    derivative between them will do. Where one side changes nothing, the other counts, if that is so of most, as at the
    end of a range: where it is so of some, they may be reflected totally.
    """
    original, centre = value_of(params, key), values()

    def at(shift: float) -> Array:
        set_value(params, key, original + shift)
        return values()

    def quotients(h: float) -> tuple[Array, Array]:
        return (at(h) - centre) / h, (centre - at(-h)) / h

    (above, below), (nearer_above, nearer_below) = quotients(step), quotients(step / 2)
    noise = 4e-7 * abs(centre) / step
    up, down = 2 * nearer_above - above, 2 * nearer_below - below
    lone = (above == 0) != (below == 0)
    if lone.sum() > 0.5 * ((above != 0) | (below != 0)).sum():
        up, down = np.where(above == 0, down, up), np.where(below == 0, up, down)
    else:
        lone[:] = False
    gap, nearer_gap = abs(above - below), abs(nearer_above - nearer_below)
    slopes = (above, nearer_above), (below, nearer_below)
    settled = [abs(near - far) <= 0.3 * np.maximum(abs(near), abs(far)) + 4 * noise for far, near in slopes]
    kink = (
        ~lone
        & settled[0]
        & settled[1]
        & (nearer_gap > 0.75 * gap)
        & (nearer_gap > 0.05 * abs(nearer_above) + 4 * noise)
    )
    first, second = (above + below) / 2, (nearer_above + nearer_below) / 2
    smooth = np.where(lone, up, (4 * second - first) / 3)
    change = np.where(lone, up - np.where(above == 0, below, above), first - second)
    # Across a peak far narrower than the steps the two sides cancel, but each grows as the step shrinks.
    grows = nearer_gap > 1.5 * gap + 4 * noise
    trusted = (kink | (abs(change) <= 0.05 * abs(smooth) + 4 * noise)) & (lone | ~grows)
    noise = noise + np.where(kink, 0, 0.5 * abs(change))
    low, high = (np.where(kink, choose(up, down), smooth) for choose in (np.minimum, np.maximum))
    # Float32 must know the values to far less than a step.
    fine = np.spacing(np.abs(np.array(original, np.float32)).max()) < 0.01 * step
    return Differences(low, high, fine & trusted & np.isfinite(low) & np.isfinite(high), noise)
