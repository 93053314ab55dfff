"""The checks of updates of parameters: they take effect, and compile nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.arrays import Array, launched_kernels, numbers
from ..probe.bsdf import BSDFProbe, load
from ..probe.directions import angles_of, hemisphere, on_side
from ..probe.variates import random
from .outcome import Findings, Outcome, relative
from .report import Finding
from .run import Run

COUNT = 1000


def updates(run: Run) -> Findings:
    """Check that a parameter that is set by ``mi.traverse`` and updated acts as it does if the BSDF is loaded with that
    value: ``eval`` and ``pdf`` are the same to float32's rounding, and so are directions drawn, but for few. And what
    is set of one changes no other BSDF of the plugin; and ``parameters_changed`` without names takes up any change, and
    of texels and tables no more than with their names. For this the BSDF must be given as a dict."""
    probe, part = run.probe, run.probe.whole
    described = run.described("To load it with another value")
    params, keys, _ = traced_floats(run, "updates")
    wi, u = on_side(hemisphere(COUNT, 91), part.sides[0]), random(COUNT, 92)
    wo = probe.sample(part, wi, u).wo
    tried, tolerance = 0, 10 * run.rounding(part)
    for key in keys:
        name, _, rest = key.partition(".")
        outcome = Outcome("updates", key)
        with restored(params, key) as original:
            if rest not in ("", "value") or dr.width(original) != 1:
                _check_taken_up(run.probe, outcome, tolerance, params, key, wi, wo, u)
                tried += 1
                yield outcome.finding("Once it is changed, all of it is taken up.")
                continue
            value = original * 0.95 + 1e-3
            number = numbers(value, 1)[0]
            given = float(number[0]) if len(number) == 1 else {"type": "rgb", "value": number.tolist()}
            if len(number) != 1 and not mi.is_rgb:  # spectral variants keep the coefficients of a spectrum
                continue
            before = probe.eval(part, wi, wo)
            if (other := loaded_or_none(described | {name: given})) is None:  # it is given otherwise
                continue
            fresh = BSDFProbe(other)
            told = ", ".join(f"{each:.4g}" for each in number)
            after, first = (each.eval(part, wi, wo) for each in (probe, fresh))
            set_value(params, key, value)
            tried += 1
            once, as_loaded = f"once it is set to {told}, ", "if it is loaded with that"
            shared, unnoticed = "they share something", "parameters_changed without names must take up any change"
            mine, last = (each.eval(part, wi, wo) for each in (probe, fresh))
            pdf, expected_pdf = (each.pdf(part, wi, wo) for each in (probe, fresh))
            params[key] = original
            probe.bsdf.parameters_changed()
            back = probe.eval(part, wi, wo)
            for row in (
                (f"{once}eval", mine, last, as_loaded),
                (f"{once}pdf", pdf, expected_pdf, as_loaded),
                (f"{once}eval of another that was loaded with that", last, first, f"before: {shared}"),
                (f"once another is loaded with {told}, eval", after, before, f"before: {shared}"),
                ("once it is set back, eval", back, before, f"before: {unnoticed}"),
            ):
                outcome.differing(tolerance, *row, wi, wo)
            set_value(params, key, value)
            ours, loaded = (each.sample(part, wi, u) for each in (probe, fresh))
            # What sample keeps of former values shows beside pdf, which has the new ones.
            error, others = (relative(each.pdf, each.density, unknown=0) * each.lit for each in (ours, loaded))
            over = error * (error > tolerance) * (np.quantile(others, 0.99) <= tolerance)
            why = "is the density that sample states"
            outcome.wrong(over, f"{once}pdf", ours.pdf, why, wi, ours.wo, expected=ours.density, seed=92)
            turned = np.linalg.norm(ours.wo - loaded.wo, axis=1) * (ours.lit & loaded.lit)
            # A choice among lobes may fall otherwise where a rounding error decides it.
            if np.quantile(turned, 0.9) > 1e-3:
                k = int(np.argmax(turned))
                words = f"{once}sample draws {angles_of(ours.wo[k])} for light from {angles_of(wi[k])}"
                other = f"but {angles_of(loaded.wo[k])} by the same variates {as_loaded}"
                outcome.fault(f"{words}, {other}", turned.sum(), wi=wi[k], seed=92)
        yield outcome.finding("Set and updated, it acts as loaded.")
    if not tried:
        yield Finding("updates", "whole", "skip", "It has no parameters that could be given as a number or a colour.")


def _check_taken_up(
    probe: BSDFProbe,
    outcome: Outcome,
    tolerance: float,
    params: mi.SceneParameters,
    key: str,
    wi: Array,
    wo: Array,
    u: Array,
) -> None:
    """Check that new texels or entries of a table, which no dict need give, are all taken up once they are set: then
    ``parameters_changed`` without names changes nothing more."""
    value = np.array(params[key])
    set_value(params, key, value * np.linspace(0.7, 1, value.size, dtype=value.dtype).reshape(value.shape))

    def found() -> list[tuple[str, Array, Array]]:
        samples = probe.sample(probe.whole, wi, u)
        values, densities = probe.eval(probe.whole, wi, wo), probe.pdf(probe.whole, wi, wo)
        return [("eval", wo, values), ("pdf", wo, densities), ("a sample's density", samples.wo, samples.density)]

    named = found()
    probe.bsdf.parameters_changed()
    why = "after parameters_changed without names: what is kept of it is out of date"
    for (name, towards, got), (_, _, expected) in zip(named, found(), strict=True):
        outcome.differing(tolerance, f"once it is changed, {name}", got, expected, why, wi, towards, seed=92)


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


def loaded_or_none(given: dict[str, Any]) -> Any:
    """Return what a dict stands for, or None if the plugin refuses it."""
    try:
        with unwrapped_ctrl_c():
            return load(given)
    except (RuntimeError, TypeError):
        return None


# --- The parameters, as mi.traverse lists them ----------------------------------------------------------------------


def traced_floats(run: Run, check: str) -> tuple[mi.SceneParameters, list[str], list[Finding]]:
    """Return ``(params, keys, findings)``: the parameters that are floats, and what a check says of the others."""
    params = mi.traverse(run.probe.bsdf)
    keys, findings = [], []
    for key in params.keys():
        if not _is_traced(params, key):
            findings.append(Finding(check, key, "skip", "Not a number of floating point that Dr.Jit traces."))
        elif check in ("gradients", "active") and int(params.flags(key)) & int(mi.ParamFlags.NonDifferentiable):
            findings.append(Finding(check, key, "skip", "Declared not differentiable."))
        else:
            keys.append(key)
    return params, keys, findings


def _is_traced(params: mi.SceneParameters, key: str) -> bool:
    try:
        value = params[key]
    except TypeError:  # it may be None, which Mitsuba does not expect itself
        return False
    is_float = dr.is_arithmetic_v(value) and dr.is_float_v(value) and dr.is_jit_v(value)
    return is_float and not dr.is_matrix_v(value) and dr.width(value) > 0


def value_of(params: mi.SceneParameters, key: str) -> Any:
    """Return a copy of the value of a parameter."""
    return type(params[key])(params[key])


def set_value(params: mi.SceneParameters, key: str, value: Any) -> None:
    """Set a parameter to a copy of a value."""
    params[key] = type(params[key])(value)
    params.update()


def attach(params: mi.SceneParameters, key: str) -> None:
    """Make a parameter what derivatives are taken for."""
    value = type(params[key])(dr.detach(params[key]))
    dr.enable_grad(value)
    params[key] = value
    params.update()


@contextmanager
def restored(params: mi.SceneParameters, key: str) -> Iterator[Any]:
    """Yield the value of a parameter, and set the parameter to it in the end."""
    original = value_of(params, key)
    try:
        yield original
    finally:
        set_value(params, key, original)
