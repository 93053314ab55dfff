"""Pearson's chi² test."""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, sqrt

import numpy as np

from .arrays import Array


@dataclass(frozen=True)
class ChiSquare:
    """The outcome of a chi² test."""

    p_value: float
    statistic: float
    degrees: int
    worst: int
    """The cell that deviates most."""


def chi_square(observed: Array, expected: Array, least: float = 5) -> ChiSquare:
    """Run Pearson's test on the counts in cells. Cells that expect less than ``least`` are pooled, in the order of what
    they expect, until they do not."""
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
    """Return the probability of a larger chi², by the cube root transform of Wilson and Hilferty (1931)."""
    spread = 2 / (9 * degrees)
    return 0.5 * erfc(((statistic / degrees) ** (1 / 3) - (1 - spread)) / sqrt(2 * spread))
