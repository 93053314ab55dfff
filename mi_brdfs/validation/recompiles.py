"""The check that updates of parameters compile nothing."""

from __future__ import annotations

import drjit as dr

from ..measure.directions import hemisphere, on_side
from ..measure.kernels import launched_kernels
from ..measure.variates import random
from .outcome import Findings, Outcome
from .report import Finding
from .run import Run
from .traversal import restored, set_value, traced_floats


def recompiles(run: Run) -> Findings:
    """Check that a new value of a parameter compiles no kernel, after its first update."""
    probe, part = run.probe, run.probe.whole
    params, keys, findings = traced_floats(run, "recompiles")
    yield from findings
    wi, u = on_side(hemisphere(64, 1), part.sides[0]), random(64, 2)

    def launched() -> set[int]:
        return launched_kernels(lambda: probe.sample(part, wi, u))

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for key in keys:
            outcome = Outcome("recompiles", key)
            kernels: list[set[int]] = []
            with restored(params, key) as original:
                for step in range(4):
                    value = original * (0.97 - 0.01 * step) + 1e-4
                    dr.make_opaque(value)
                    set_value(params, key, value)
                    kernels.append(launched())
            fresh = len(set.union(*kernels) - kernels[0])
            if not kernels[0]:
                outcome.fault("no kernel was launched at all")
            if fresh:
                outcome.fault(f"{fresh} kernels are compiled for three new values")
            yield outcome.finding("No kernel is compiled for a new value.")
    if not keys and not findings:
        yield Finding("recompiles", "whole", "skip", "It has no parameters.")
