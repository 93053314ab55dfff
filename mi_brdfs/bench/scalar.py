"""The time in scalar variants, where a BSDF in Python is called sample by sample."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

import drjit as dr
import mitsuba as mi
import numpy as np

from . import sizes
from .cases import Plugin, pairs
from .figure import Figure, Target
from .run import BenchRun
from .scenes import PATH, sphere
from .timing import median_interval

AT_MOST = {"lambert": 12, "walter": 40}


def scalar(run: BenchRun) -> Iterator[Figure]:
    """Measure the time of a small picture of a sphere in ``scalar_rgb`` with one thread, over that with the built-in:
    the median of alternating pairs. Almost all of it is spent in calls of the BSDF.

    Targets: 12 for ``lambert``, 40 for ``walter``.
    """
    threads = dr.thread_count()
    dr.set_thread_count(1)
    try:
        with mi.variant_context("scalar_rgb"):
            for case in run.steps([case for case in pairs(run.cases) if case.name in AT_MOST]):
                seconds = np.array([[_seconds(bsdf, seed) for bsdf in (case.bsdf, case.other)]
                                    for seed in range(sizes.SCALAR_PAIRS)]).T  # fmt: skip
                median, interval = median_interval(seconds[0] / seconds[1])
                target = Target("≤", AT_MOST[case.name], case.other["type"])
                yield Figure("scalar", case.name, "time", median, 1, "×", interval, (target,))
                samples = sizes.SCALAR_PICTURE**2 * sizes.SCALAR_SPP
                for name, of_one in zip(("ours", "built-in"), seconds, strict=True):
                    yield Figure("scalar", case.name, name, 1e6 * float(np.median(of_one)) / samples, 1, " µs a sample")
    finally:
        dr.set_thread_count(threads)


def _seconds(bsdf: Plugin, seed: int) -> float:
    scene = mi.load_dict(sphere(bsdf, PATH, sizes.SCALAR_PICTURE))
    start = perf_counter()
    mi.render(scene, spp=sizes.SCALAR_SPP, seed=seed)
    return perf_counter() - start
