"""The time to the first picture of a process: tracing and compiling."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

import drjit as dr
import mitsuba as mi
import numpy as np

from . import sizes
from .cases import Plugin, built_ins, defaults, pairs
from .figure import Figure, Target
from .process import in_new_process
from .run import BenchRun
from .scenes import PATH, sphere, spheres
from .timing import median_interval

ALL = "all models"
SIZE = 16


def first(run: BenchRun) -> Iterator[Figure]:
    """Measure the time from loading a scene to its first, small picture, traced and compiled, over that with the
    built-in: the median of pairs of fresh processes, alternating, without cached kernels. The scenes are one sphere
    with the default parameters of a model, and one sphere for each model, compared with as many built-ins.

    Targets: 1.15 for one model, 1.3 for all of them.
    """
    singles = [(case.name, [case.bsdf], [case.other], case.other["type"]) for case in pairs(run.cases)]
    models = defaults(run.cases)
    scenes = [*singles, (ALL, models, built_ins(len(models)), f"{len(models)} built-ins")]
    for name, ours, theirs, beside in run.steps(scenes):
        count = sizes.FIRST_ALL_PAIRS if name == ALL else sizes.FIRST_PAIRS
        seconds = np.array([_pair(ours, theirs, k % 2 == 1) for k in range(count)]).T
        median, interval = median_interval(seconds[0] / seconds[1])
        target = Target("≤", 1.3 if name == ALL else 1.15, beside)
        yield Figure("first", name, "first picture", median, 2, "×", interval, (target,))
        yield Figure("first", name, "ours", float(np.median(seconds[0])), 2, " s")
        yield Figure("first", name, "built-in", float(np.median(seconds[1])), 2, " s")


def _pair(ours: list[Plugin], theirs: list[Plugin], ours_first: bool) -> tuple[float, float]:
    order = (ours, theirs) if ours_first else (theirs, ours)
    seconds = [in_new_process(first_picture, bsdfs) for bsdfs in order]
    return tuple(seconds if ours_first else seconds[::-1])


def first_picture(bsdfs: list[Plugin]) -> float:
    """Return the seconds from loading a scene with some BSDFs to its picture, in a process that has rendered
    nothing."""
    scene = spheres(bsdfs, SIZE) if len(bsdfs) > 1 else sphere(bsdfs[0], PATH, SIZE)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        start = perf_counter()
        dr.eval(mi.render(mi.load_dict(scene), spp=1))
        dr.sync_thread()
        seconds = perf_counter() - start
        kernels = dr.kernel_history([dr.KernelType.JIT])
    if any(kernel["cache_disk"] for kernel in kernels):
        raise RuntimeError("kernels compiled by earlier runs were found")
    return seconds
