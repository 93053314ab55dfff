"""The checks of updates of parameters: they take effect, and compile nothing."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.arrays import numbers
from ..probe.bsdf import BSDFProbe, load
from ..probe.directions import angles_of, hemisphere, on_side
from ..probe.kernels import launched_kernels
from ..probe.variates import random
from .outcome import Findings, Outcome, relative
from .report import Finding
from .run import Run
from .traversal import restored, set_value, traced_floats

COUNT = 1000


def updates(run: Run) -> Findings:
    """Check that a parameter that is set by ``mi.traverse`` and updated acts as it does if the BSDF is loaded with that
    value: ``eval`` and ``pdf`` are the same to float32's rounding. For this the BSDF must be given as a dict."""
    probe, part = run.probe, run.probe.whole
    if run.given is None:
        yield Finding("updates", "whole", "skip", "To load it with another value, its dict is needed.")
        return
    params, keys, _ = traced_floats(run, "updates")
    wi = on_side(hemisphere(COUNT, 91), part.sides[0])
    wo = probe.sample(part, wi, random(COUNT, 92)).wo
    tried = 0
    for key in keys:
        name, _, rest = key.partition(".")
        outcome = Outcome("updates", key)
        with restored(params, key) as original:
            if rest not in ("", "value") or dr.width(original) != 1:
                continue
            value = original * 0.95 + 1e-3
            number = numbers(value, 1)[0]
            given = float(number[0]) if len(number) == 1 else {"type": "rgb", "value": number.tolist()}
            if len(number) != 1 and not mi.is_rgb:  # spectral variants keep the coefficients of a spectrum
                continue
            try:
                with unwrapped_ctrl_c():
                    fresh = BSDFProbe(load(run.given | {name: given}))
            except (RuntimeError, TypeError):  # it is given otherwise
                continue
            set_value(params, key, value)
            tried += 1
            for word, got, expected in (
                ("eval", probe.eval(part, wi, wo), fresh.eval(part, wi, wo)),
                ("pdf", probe.pdf(part, wi, wo)[:, None], fresh.pdf(part, wi, wo)[:, None]),
            ):
                error = relative(got, expected)
                if error.max() > 10 * run.rounding(part):
                    k, channel = np.unravel_index(int(np.argmax(error)), error.shape)
                    shown = ", ".join(f"{each:.4g}" for each in number)
                    outcome.fault(
                        f"once it is set to {shown}, {word} is {got[k, channel]:.4g} for light from "
                        f"{angles_of(wi[k])}, but {expected[k, channel]:.4g} if it is loaded with that",
                        error.max(),
                        wi=wi[k],
                        wo=wo[k],
                    )
        yield outcome.finding("Set and updated, it acts as loaded.")
    if not tried:
        yield Finding("updates", "whole", "skip", "It has no parameters that could be given as a number or a colour.")


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
