"""Medians, ratios and their intervals."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from ..probe.arrays import Array

RESAMPLINGS = 2000
"""Bootstrap resamplings of the pictures, for the interval of time × variance."""

Interval = tuple[float, float]


def in_turn(subjects: int, rounds: int) -> Iterator[tuple[int, int]]:
    """Yield (subject, round), with another subject first in each round."""
    for each in range(rounds):
        for k in range(subjects)[:: 1 if each % 2 else -1]:
            yield k, each


def median_interval(values: Array) -> tuple[float, Interval]:
    """Return the median and its 95 % confidence interval, for any distribution: the k-th smallest and the k-th largest
    value, as each lies beyond the true median with the probability that fewer than k of n coins fall heads. For fewer
    than six values it is their range, at lower confidence."""
    ordered = np.sort(values)
    n, k, beyond = len(ordered), 0, 0.0
    while (beyond := beyond + comb(n, k) / 2**n) <= 0.025:
        k += 1
    k = max(k, 1)
    return float(np.median(ordered)), (float(ordered[k - 1]), float(ordered[n - k]))


def deviations(pictures: Array) -> Array:
    """Return the deviation of each seed's picture from the mean over the seeds: the squared difference of a pixel over
    its squared mean, averaged over the pixels brighter than a thousandth of the picture, as a pixel in a shadow may be
    black except in a seed or two. The mean over the seeds is the relative variance. Shape (BSDFs, seeds), for pictures
    of shape (BSDFs, seeds, pixels)."""
    mean, seeds = pictures.mean(axis=1, keepdims=True), pictures.shape[1]
    lit = mean > 1e-3 * mean.mean(axis=2, keepdims=True)
    relative = np.where(lit, pictures / np.where(lit, mean, 1) - 1, 0) ** 2
    return relative.sum(axis=2) / np.maximum(lit.sum(axis=2), 1) * seeds / (seeds - 1)


def time_variance(slower: Array, noise: Array) -> tuple[float, Interval]:
    """Return time × variance of the first over that of the second, and its 95 % interval, by bootstrap over seeds."""

    def ratio(seeds: Array) -> Array:
        ours, theirs = noise[:, seeds].mean(axis=-1)
        return np.median(slower[seeds], axis=-1) * ours / theirs

    n = len(slower)
    resampled = np.random.default_rng(0).integers(0, n, (RESAMPLINGS, n))
    low, high = np.quantile(ratio(resampled), [0.025, 0.975])
    return float(ratio(np.arange(n))), (float(low), float(high))
