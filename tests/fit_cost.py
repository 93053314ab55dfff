"""What fits cost: CPU time by directions and materials, and memory over repeated fits.

python tests/fit_cost.py steps | memory

``steps`` measures one evaluation with its Jacobian and normal equations, which is what fits consist of, over more than
a decade of directions and of materials, kernels warm, in alternating rounds: each figure is the median of the CPU time
on one thread, which other processes hardly change. ``memory`` repeats fits of several models.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: threads that wait for work take CPU time

import argparse
import gc
import time
from collections.abc import Callable, Iterable
from statistics import median

import numpy as np
import psutil
from fits import MODELS, measured

from mi_brdfs.fit import METRICS, Observations, fit, observe
from mi_brdfs.fit.problem import Problem
from mi_brdfs.fit.unknowns import configurations
from mi_brdfs.mitsuba.registry import find_model

import drjit as dr  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip
import mitsuba as mi  # isort: skip

DIRECTIONS = 1000, 3000, 10_000, 30_000
MATERIALS = 1, 3, 10, 30, 100
ROUNDS = 25
REPEATS = 20
REPEATED = "lambert", "ward", "walter", "low"


def material(model: str, directions: int, seed: int = 1) -> Observations:
    """Three channels of noisy values, of which half the pairs are fitted: as many as there are ``directions``."""
    wi, wo, f = measured(model, MODELS[model].drawn(seed), 2 * directions, seed)
    noise = 1 + 0.05 * np.random.default_rng(seed).standard_normal((len(f), 3))
    return observe((wi, wo, f[:, None] * [1, 0.7, 0.4] * noise), pairs=2 * directions)


def problem(model: str, directions: int, materials: int) -> Problem:
    (configuration,) = configurations(find_model(model), MODELS[model].given, {}, 1, 3, False)
    alike = [material(model, directions, seed) for seed in range(min(materials, 3))]
    own = [alike[k % len(alike)] for k in range(materials)]
    return Problem(configuration.isotropic(), own, METRICS["log"])


def medians(calls: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the median CPU time of each call in seconds; each is made once before, and then once a round."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(ROUNDS):
        for name, call in calls.items():
            start = time.process_time()
            call()
            times[name].append(time.process_time() - start)
    return {name: median(own) for name, own in times.items()}


def report(what: str, found: dict[int, float]) -> None:
    """Print times by size with the line of the least relative deviations, and the largest of these."""
    x, y = np.array([*found]), np.array([*found.values()])
    slope, fixed = np.polyfit(x, y, 1, w=1 / y)
    deviation = np.abs((fixed + slope * x) / y - 1).max()
    cells = ", ".join(f"{size}: {seconds * 1e3:.1f}" for size, seconds in found.items())
    formula = f"{fixed * 1e3:.1f} ms + {slope * 1e6:.3g} µs each, within {deviation:.0%}"
    print(f"{what}  {cells} ms; about {formula}", flush=True)


def steps(model: str = "walter") -> None:
    """One step of fits of a model."""
    calls, point = {}, None
    for directions, materials in [*((n, 3) for n in DIRECTIONS), *((1000, m) for m in MATERIALS)]:
        it = problem(model, directions, materials)
        low, high = it.box
        point = (np.clip(low, -3, 3) + np.clip(high, -3, 3)) / 2
        points = np.tile(point, (materials, 1))
        calls[f"{directions} {materials}"] = lambda it=it, points=points: it.sums(range(len(points)), points)
    found = medians(calls)
    print(f"One step of {model}, three channels, {len(point)} unknowns:")
    report("  by directions, of 3 materials:   ", {n: found[f"{n} 3"] for n in DIRECTIONS})
    report("  by materials, of 1000 directions:", {m: found[f"1000 {m}"] for m in MATERIALS})


def memory(models: Iterable[str] = REPEATED, repeats: int = REPEATS) -> list[tuple[float, float]]:
    """Fit several models again and again; print and return ``(resident, the most that Dr.Jit held)`` in MiB after each
    round."""
    own = {name: material(name, 2000) for name in models}
    found = []
    for k in range(repeats):
        dr.detail.malloc_clear_statistics()
        for name, it in own.items():
            fit(it, name, given=MODELS[name].given, starts=2)
        gc.collect()
        resident = psutil.Process().memory_info().rss / 2**20
        found.append((resident, dr.detail.malloc_watermark(dr.JitBackend.LLVM) / 2**20))
        print(f"round {k + 1:2}: {found[-1][0]:.1f} MiB resident, Dr.Jit {found[-1][1]:.1f} MiB at most", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["steps", "memory"])
    what = parser.parse_args().what
    mi.set_variant("llvm_ad_rgb")
    if what == "steps":
        dr.set_thread_count(1)  # threads that wait for work take CPU time
    {"steps": steps, "memory": memory}[what]()


if __name__ == "__main__":
    main()
