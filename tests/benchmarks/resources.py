"""The cost of BSDFs over time: kernels compiled after changes, time and memory lost to loading."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator, Sequence
from statistics import median
from time import thread_time

import drjit as dr
import mitsuba as mi
import numpy as np
import psutil

from mi_brdfs.bench.pictures import FIRST_SIZE, in_new_process, sphere
from mi_brdfs.probe.arrays import launched_kernels

from .cases import CASES, Case, Plugin, defaults
from .figure import Figure, Target

CYCLES = 300
"""The least number of scenes to load, render and discard."""
EDGE = 50
"""The least number of these, at the beginning and at the end, to compare."""


# --- Kernels --------------------------------------------------------------------------------------------------------


def recompiles(cases: Sequence[Case] = CASES) -> Iterator[Figure]:
    """Count the kernels compiled for a new value of each parameter in turn, and for loading the same scene again after
    discarding it, summed over all cases of a model. As compilation depends on what earlier runs cached on disk, kernels
    are identified by their hashes: those count that the first picture did not need.

    Target: 0.
    """
    counts: dict[str, np.ndarray] = {}
    for case in cases:
        model = case.bsdf["type"]
        counts[model] = counts.get(model, 0) + np.array(fresh_kernels(case.bsdf))
    for model, (parameters, changed, loaded) in counts.items():
        yield Figure("recompiles", model, "parameters changed", int(parameters), 0)
        for name, kernels in (("kernels for new values", changed), ("kernels for loading again", loaded)):
            yield Figure("recompiles", model, name, int(kernels), 0, targets=(Target("≤", 0, "no compilation"),))


def fresh_kernels(bsdf: Plugin) -> tuple[int, int, int]:
    """Return ``(parameters, changed, loaded)``: the number of parameters changed, and of kernels compiled for that and
    for loading the scene again."""
    scene = sphere(bsdf, FIRST_SIZE)
    gc.collect()  # every BSDF that lives is part of a kernel, and would end in the middle
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        loaded = mi.load_dict(scene)
        known = _launched(loaded)
        params = mi.traverse(loaded)
        keys = [key for key in params.keys() if ".bsdf." in key and dr.is_float_v(params[key])]
        changed = set()
        for key in keys:
            value = params[key] * 0.95 + 1e-4
            dr.make_opaque(value)
            params[key] = value
            params.update()
            changed |= _launched(loaded) - known
        del loaded, params
        return len(keys), len(changed), len(_launched(mi.load_dict(scene)) - known)


def _launched(scene: mi.Scene) -> set[int]:
    """Return the hashes of a picture's kernels."""
    return launched_kernels(lambda: dr.eval(mi.render(scene, spp=1)))


# --- Time and memory ------------------------------------------------------------------------------------------------


def cycles() -> Iterator[Figure]:
    """Load, render and discard scenes with one model each in a new process, in rounds over all models, and measure the
    time of the last rounds over that of the first after a warm-up, and the growth in memory. The time is that of the
    thread that loads and traces: each model's best, which other processes disturb least, then the median over the
    models. Memory is measured on Linux only.

    Targets: within 1.1 of the first rounds, and below 5 MB.
    """
    bsdfs = defaults()
    edge = -(-EDGE // len(bsdfs))
    rounds = max(2 * edge, -(-CYCLES // len(bsdfs)))
    seconds, memory = in_new_process(load_render_discard, bsdfs, rounds)
    subject = f"{rounds * len(bsdfs)} cycles"
    limit = (Target("≤", 1.1, "flat"),)
    yield Figure("cycles", subject, "last over first", slowdown(seconds, edge), 2, "×", targets=limit)
    if memory:
        yield Figure("cycles", subject, "growth", memory[-1] - memory[0], 1, " MB", targets=(Target("≤", 5, "flat"),))


def load_render_discard(bsdfs: list[Plugin], rounds: int) -> tuple[list[list[float]], list[float]]:
    """Return ``(seconds, memory)``: the time of each BSDF in each round after the first, which compiles, and the
    megabytes that the process holds before the first and after each of these rounds."""
    seconds: list[list[float]] = []
    memory: list[float] = []
    for seed in range(rounds + 1):
        seconds.append([])
        for bsdf in bsdfs:
            start = thread_time()
            dr.eval(mi.render(mi.load_dict(sphere(bsdf, FIRST_SIZE)), spp=1, seed=seed))
            dr.sync_thread()
            seconds[-1].append(thread_time() - start)
        if sys.platform == "linux":
            memory.append(psutil.Process().memory_info().rss / 2**20)
    return seconds[1:], memory


def slowdown(seconds: list[list[float]], edge: int) -> float:
    """Return the time of the last rounds over that of the first."""
    early, late = (np.min(part, axis=0) for part in (seconds[:edge], seconds[-edge:]))
    return float(median(late / early))
