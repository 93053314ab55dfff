"""Pearson's chi² test, and a test of the cell that deviates most."""

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


def in_words(p_value: float) -> str:
    """Return a p-value as text; what float64 has no digits for is less than 1e-300."""
    return "p < 1e-300" if p_value < 1e-300 else f"p = {p_value:.2g}"


def lone_cell(observed: Array, expected: Array) -> float:
    """Return how probable it is that one of some counts is as far from what is expected as the farthest one. They may
    overlap.

    By Chernoff's bound a Poisson count of mean e is at most exp(-(o ln(o/e) - o + e)) likely to be as far out as o;
    Bonferroni's factor is that of the cells and of both sides. One wrong cell of a thousand is lost in the sum of chi².
    """
    farthest = np.max(surprise(observed, expected), initial=0)
    return float(min(2 * len(observed) * np.exp(-farthest), 1))


def surprise(observed: Array, expected: Array) -> Array:
    """Return the negative logarithm of that bound for each count. What is expected is an integral over the cell, which
    may miss a sliver of it."""
    o, e = np.asarray(observed, np.float64), np.maximum(expected, 0.05)
    return o * np.log(np.where(o > 0, o, 1) / e) - o + e


def _survival(statistic: float, degrees: int) -> float:
    """Return the probability of a larger chi², by the cube root transform of Wilson and Hilferty (1931)."""
    spread = 2 / (9 * degrees)
    return 0.5 * erfc(((statistic / degrees) ** (1 / 3) - (1 - spread)) / sqrt(2 * spread))
