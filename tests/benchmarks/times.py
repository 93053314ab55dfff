"""Times and noise relative to the built-ins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_brdfs.bench.pictures import SIZE, first_pictures, render, render_in_turn, sphere
from mi_brdfs.bench.statistics import deviations, in_turn, median_interval, time_variance
from mi_brdfs.probe.arrays import Array

from .cases import BUILT_INS, CASES, Case, Plugin, defaults, pairs
from .figure import Figure, Target

ALONE_AT_MOST = {"walter alpha 0.5": 0.5, "walter alpha 1": 0.3}
SCALAR_AT_MOST = {"lambert": 12, "walter": 40}
BSDF_SAMPLES = {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}
ALONE, SPHERE, BOX = "BSDF samples alone", "sphere", "Cornell box"
ALL = "all models"
FIRST_ROUNDS, FIRST_ROUNDS_OF_ALL = 6, 3
SCALAR_SIZE, SCALAR_SPP, SCALAR_ROUNDS = 16, 32, 5


def scene(bsdf: Plugin, name: str) -> dict[str, Any]:
    """Return the scene of one of the three names above. In the Cornell box, the BSDF replaces white."""
    if name != BOX:
        return sphere(bsdf, SIZE, **({"integrator": BSDF_SAMPLES} if name == ALONE else {}))
    box = mi.cornell_box()
    box["sensor"]["film"] |= {"width": SIZE // 2, "height": SIZE // 2, "rfilter": {"type": "box"}}
    return box | {"white": bsdf}


def pictures(cases: Sequence[Case] = CASES) -> Iterator[Figure]:
    """Measure the time of rendering a sphere and the Cornell box, which includes tracing, but not compiling; and time ×
    variance at equal numbers of samples, the relative time to a picture with the same noise; both over those of the
    built-in. The sphere is also rendered with BSDF samples alone, where all noise comes from the sampler. If the
    built-in is another model of the same kind, this is left out, and no noise is judged.

    Targets: 1.05 for times, 1 for time × variance by ``path``; and for ``walter`` with BSDF samples alone 0.5 at
    α = 0.5 and 0.3 at α = 1.
    """
    for case in cases:
        if not case.builtin:
            continue
        for name in (ALONE, SPHERE, BOX) if case.same else (SPHERE, BOX):
            seconds, luminance = render_in_turn([partial(scene, bsdf, name) for bsdf in (case.bsdf, case.builtin)])
            slower, noise = seconds[0] / seconds[1], deviations(luminance)
            if name != ALONE:
                target = Target("≤", 1.05, case.builtin["type"])
                yield from _compared("time", case.beside, name, 1e3 * seconds, target, 0, " ms", f"{name}, ")
            if not noise[1].any():
                continue  # nothing to compare
            bound = ALONE_AT_MOST.get(case.name) if name == ALONE else 1.0
            targets = (Target("≤", bound, case.builtin["type"]),) if case.same and bound else ()
            value, interval = time_variance(slower, noise)
            yield Figure("variance", case.beside, name, value, 2, "×", interval, targets)
            ours, theirs = noise.mean(axis=1)
            yield Figure("variance", case.beside, f"{name}, variance", float(ours / theirs), 2, "×")


def first() -> Iterator[Figure]:
    """Measure the time from loading a scene to its first, small picture, traced and compiled, over that with the
    built-in: in fresh processes, without cached kernels. The scenes are one sphere with the default parameters of a
    model, and one sphere for each model, compared with as many built-ins.

    Targets: 1.15 for one model, 1.3 for all of them.
    """
    for case in pairs():
        seconds = first_pictures([[case.bsdf], [case.builtin]], FIRST_ROUNDS)
        target = Target("≤", 1.15, case.builtin["type"])
        yield from _compared("first", case.name, "first picture", seconds, target, 2, " s")
    models = defaults()
    seconds = first_pictures([models, (2 * BUILT_INS)[: len(models)]], FIRST_ROUNDS_OF_ALL)
    target = Target("≤", 1.3, f"{len(models)} built-ins")
    yield from _compared("first", ALL, "first picture", seconds, target, 2, " s")


def scalar() -> Iterator[Figure]:
    """Measure the time of a small picture of a sphere in ``scalar_rgb`` with one thread, over that with the built-in.
    Almost all of it is spent in calls of the BSDF, which in Python is called sample by sample.

    Targets: 12 for ``lambert``, 40 for ``walter``.
    """
    threads = dr.thread_count()
    dr.set_thread_count(1)
    try:
        with mi.variant_context("scalar_rgb"):
            for case in (case for case in pairs() if case.name in SCALAR_AT_MOST):
                bsdfs, seconds = (case.bsdf, case.builtin), np.zeros((2, SCALAR_ROUNDS))
                for k, seed in in_turn(2, SCALAR_ROUNDS):
                    seconds[k, seed], _ = render(sphere(bsdfs[k], SCALAR_SIZE), seed, SCALAR_SPP)
                times = 1e6 * seconds / (SCALAR_SIZE**2 * SCALAR_SPP)
                target = Target("≤", SCALAR_AT_MOST[case.name], case.builtin["type"])
                yield from _compared("scalar", case.name, "time", times, target, 1, " µs a sample")
    finally:
        dr.set_thread_count(threads)


def _compared(
    section: str, subject: str, name: str, times: Array, target: Target, digits: int, unit: str, prefix: str = ""
) -> Iterator[Figure]:
    """Yield the median of the ratios with its interval, and both medians."""
    median, interval = median_interval(times[0] / times[1])
    yield Figure(section, subject, name, median, 2, "×", interval, (target,))
    for whose, each in zip(("ours", "built-in"), times, strict=True):
        yield Figure(section, subject, prefix + whose, float(np.median(each)), digits, unit)
