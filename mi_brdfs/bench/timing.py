"""The render time and noise of our BSDFs relative to the built-ins."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from ..probe.arrays import Array
from . import sizes
from .figure import Figure, Target
from .run import BenchRun
from .scenes import ALONE, BOX, SPHERE

ALONE_AT_MOST = {"walter alpha 0.5": 0.5, "walter alpha 1": 0.3}


def time(run: BenchRun) -> Iterator[Figure]:
    """Measure the time of rendering a sphere and the Cornell box, over that with the built-in: the median of
    alternating pairs, in one process, with its interval. It includes tracing, but not compiling.

    Target: 1.05.
    """
    for case in run.steps(run.beside):
        for scene in (SPHERE, BOX):
            renders = run.renders(case, scene)
            median, interval = median_interval(renders.slower)
            target = Target("≤", 1.05, case.other["type"])
            yield Figure("time", case.beside, scene, median, 2, "×", interval, (target,))
            for name, seconds in zip(("ours", "built-in"), renders.seconds, strict=True):
                yield Figure("time", case.beside, f"{scene}, {name}", 1e3 * float(np.median(seconds)), 0, " ms")


def variance(run: BenchRun) -> Iterator[Figure]:
    """Measure time × variance at equal numbers of samples, over that of the built-in: the relative time to a picture
    with the same noise. The variance is that of a pixel's luminance among pictures of different seeds, the same for
    both, relative to its squared mean, averaged over the pixels; the interval is a bootstrap over the seeds. The scenes
    are a sphere under a constant environment and the Cornell box, by ``path``; and the sphere with BSDF samples alone,
    where all noise comes from the sampler. If the built-in is another model of the same kind, only ``path`` is
    measured, and nothing is judged.

    Targets: 1 by ``path``; and for ``walter`` with BSDF samples alone 0.5 at α = 0.5 and 0.3 at α = 1.
    """
    for case in run.steps(run.beside):
        for scene in (ALONE, SPHERE, BOX) if case.same else (SPHERE, BOX):
            renders = run.renders(case, scene)
            noise = deviations(renders.pictures)
            if not noise[1].any():
                continue  # nothing to compare
            bound = ALONE_AT_MOST.get(case.name) if scene == ALONE else 1.0
            targets = (Target("≤", bound, case.other["type"]),) if case.same and bound else ()
            value, interval = time_variance(renders.slower, noise)
            yield Figure("variance", case.beside, scene, value, 2, "×", interval, targets)
            ours, theirs = noise.mean(axis=1)
            yield Figure("variance", case.beside, f"{scene}, variance", float(ours / theirs), 2, "×")


# --- Statistics -----------------------------------------------------------------------------------------------------


def median_interval(values: Array) -> tuple[float, tuple[float, float]]:
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
    black except in a seed or two. The mean over the seeds is the relative variance. Shape (2, seeds), for pictures of
    shape (2, seeds, pixels)."""
    mean, seeds = pictures.mean(axis=1, keepdims=True), pictures.shape[1]
    lit = mean > 1e-3 * mean.mean(axis=2, keepdims=True)
    relative = np.where(lit, pictures / np.where(lit, mean, 1) - 1, 0) ** 2
    return relative.sum(axis=2) / np.maximum(lit.sum(axis=2), 1) * seeds / (seeds - 1)


def time_variance(slower: Array, noise: Array) -> tuple[float, tuple[float, float]]:
    """Return time × variance of the first over that of the second, and its 95 % confidence interval."""

    def ratio(seeds: Array) -> Array:
        ours, theirs = noise[:, seeds].mean(axis=-1)
        return np.median(slower[seeds], axis=-1) * ours / theirs

    n = len(slower)
    resampled = np.random.default_rng(0).integers(0, n, (sizes.RESAMPLINGS, n))
    low, high = np.quantile(ratio(resampled), [0.025, 0.975])
    return float(ratio(np.arange(n))), (float(low), float(high))
