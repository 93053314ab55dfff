"""The time of the calls that a path tracer makes."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import numpy as np

from ..probe.arrays import Array, interaction, sample_arguments, vectors
from ..probe.bsdf import BSDFProbe
from ..probe.directions import hemisphere
from ..probe.variates import random
from .statistics import in_turn

LANES = 1 << 20
ROUNDS = 31


def call_times(probes: Sequence[BSDFProbe]) -> Array:
    """Return the nanoseconds that ``eval_pdf_sample`` takes for a lane, in kernels of each BSDF in turn, compiled
    before; shape (BSDFs, rounds). Tracing does not count."""
    si, wo, variates = interaction(hemisphere(LANES, 1)), vectors(hemisphere(LANES, 2)), random(LANES, 3)
    u, v = sample_arguments(variates)
    times = np.zeros((len(probes), ROUNDS))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for k, each in in_turn(len(probes), 1 + ROUNDS):
            dr.kernel_history_clear()
            probe = probes[k]
            value, pdf, bs, weight = probe.bsdf.eval_pdf_sample(probe.whole.context, si, wo, u, v, True)
            dr.eval(dr.sum(value) + pdf + dr.sum(weight) + bs.pdf + dr.sum(bs.wo))
            if each:  # the first round compiles
                kernels = dr.kernel_history([dr.KernelType.JIT])
                times[k, each - 1] = 1e6 / LANES * sum(kernel["execution_time"] for kernel in kernels)
    return times
