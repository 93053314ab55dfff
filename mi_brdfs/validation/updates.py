"""The checks of updates of parameters: they take effect, and compile nothing."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.arrays import Array, launched_kernels, numbers
from ..probe.bsdf import BSDFProbe, Value, load
from ..probe.variates import random
from .outcome import Findings, Outcome, relative
from .report import Finding
from .run import Run
from .traced import Parameter, traced_floats

COUNT = 1000
SEED = 92
UNNOTICED = "parameters_changed without names must take up any change"


class Drawn(NamedTuple):
    """Pairs of directions that a BSDF draws, and the variates."""

    wi: Array
    wo: Array
    u: Array


def updates(run: Run) -> Findings:
    """Check that a parameter that is set by ``mi.traverse`` and updated acts as it does if the BSDF is loaded with that
    value: ``eval``, ``pdf`` and the weights of delta functions are the same to float32's rounding, and so are
    directions drawn and their weights, but for few. And what is set of one changes no other BSDF of the plugin; and
    ``parameters_changed`` without names takes up any change, and no more than with the names of texels, of tables, and
    of all parameters that are set together, as optimisers do. For this the BSDF must be given as a dict."""
    described = run.described("To load it with another value")
    parameters, _ = traced_floats(run, "updates")
    wi, u = run.probe.whole.around(COUNT, 91), random(COUNT, SEED)
    drawn = Drawn(wi, run.probe.sample(run.probe.whole, wi, u).wo, u)
    findings = [finding for each in parameters if (finding := _updated(run, each, described, drawn))]
    if len(findings) > 1:
        findings.append(_together(run, parameters, drawn))
    words = "It has no parameters that could be given as a number or a colour."
    yield from findings or [Finding("updates", "whole", "skip", words)]


def _updated(run: Run, parameter: Parameter, described: dict[str, Any], drawn: Drawn) -> Finding | None:
    """Return what is found of updates of a parameter, or None if no dict gives it another value."""
    outcome, (name, _, rest) = Outcome("updates", parameter.key), parameter.key.partition(".")
    with parameter.restored() as original:
        if rest not in ("", "value") or dr.width(original) != 1:
            entries = np.array(original)
            parameter.set(entries * np.linspace(0.7, 1, entries.size, dtype=entries.dtype).reshape(entries.shape))
            _check_taken_up(run, outcome, drawn, "once it is changed,")
            return outcome.finding("Once it is changed, all of it is taken up.")
        value = original * 0.95 + 1e-3
        number = numbers(value, 1)[0]
        if len(number) > 1 and not mi.is_rgb:  # spectral variants keep the coefficients of a spectrum
            return None
        given = float(number[0]) if len(number) == 1 else {"type": "rgb", "value": number.tolist()}
        before = run.probe.values(drawn.wi, drawn.wo)
        if (other := loaded_or_none(described | {name: given})) is None:  # it is given otherwise
            return None
        told = ", ".join(f"{each:.4g}" for each in number)
        why = "before: they share something"
        fresh, after = BSDFProbe(other), run.probe.values(drawn.wi, drawn.wo)
        _compare(run, outcome, drawn, f"once another is loaded with {told},", after, before, why)
        first = fresh.values(drawn.wi, drawn.wo)
        parameter.set(value)
        last = fresh.values(drawn.wi, drawn.wo)
        _compare(run, outcome, drawn, f"once it is set to {told}, of another with that", last, first, why)
        _check_as_loaded(run, outcome, fresh, drawn, f"once it is set to {told},")
        parameter.params[parameter.key] = original
        run.probe.bsdf.parameters_changed([])
        back = run.probe.values(drawn.wi, drawn.wo)
        _compare(run, outcome, drawn, "once it is set back,", back, before, f"before: {UNNOTICED}")
    return outcome.finding("Set and updated, it acts as loaded.")


def _together(run: Run, parameters: list[Parameter], drawn: Drawn) -> Finding:
    """Return what is found as all parameters are set before one update."""
    outcome = Outcome("updates", "whole")
    with ExitStack() as stack:
        originals = [stack.enter_context(each.restored()) for each in parameters]
        for each, original in zip(parameters, originals, strict=True):
            each.params[each.key] = original * 0.95 + 1e-3
        parameters[0].params.update()
        _check_taken_up(run, outcome, drawn, "once all are changed together,")
    return outcome.finding("Changed together, all are taken up.")


def _compare(
    run: Run, outcome: Outcome, drawn: Drawn, once: str, got: list[Value], expected: list[Value], why: str
) -> None:
    for one, other in zip(got, expected, strict=True):
        name, tolerance = f"{once} {one.name}", 10 * run.rounding(run.probe.whole)
        outcome.differing(tolerance, name, one.value, other.value, why, drawn.wi, one.wo, seed=SEED)


def _check_as_loaded(run: Run, outcome: Outcome, fresh: BSDFProbe, drawn: Drawn, once: str) -> None:
    """Check that the BSDF acts as a fresh one, which was loaded with its parameters."""
    part, (wi, wo, u), as_loaded = run.probe.whole, drawn, "if it is loaded with that"
    one, other = ([*each.values(wi, wo), Value("pdf", wo, each.pdf(part, wi, wo))] for each in (run.probe, fresh))
    _compare(run, outcome, drawn, once, one, other, as_loaded)
    ours, loaded = (each.sample(part, wi, u) for each in (run.probe, fresh))
    tolerance = 10 * run.rounding(part)
    # What sample keeps of former values shows beside pdf, which has the new ones.
    if np.quantile(relative(loaded.pdf, loaded.density, unknown=0) * loaded.lit, 0.99) <= tolerance:
        why = "is the density that sample states"
        outcome.differing(
            tolerance, f"{once} pdf", ours.pdf, ours.density, why, wi, ours.wo, unknown=0, where=ours.lit, seed=SEED
        )
    # A choice among lobes may fall otherwise where a rounding error decides it.
    name, pair, both = f"{once} a sample's weight", (ours.weight, loaded.weight), ours.lit & loaded.lit
    outcome.differing(tolerance, name, *pair, as_loaded, wi, ours.wo, where=both, but_for=0.1, seed=SEED)
    got, expected = (each.wo * each.lit[:, None] for each in (ours, loaded))
    outcome.astray(once, got, expected, f"by the same variates {as_loaded}", wi, SEED, but_for=0.1)


def _check_taken_up(run: Run, outcome: Outcome, drawn: Drawn, once: str) -> None:
    """Check that new values, texels or entries of a table are all taken up once they are set: then
    ``parameters_changed`` without names changes nothing more."""
    probe = run.probe

    def found() -> list[Value]:
        samples = probe.sample(probe.whole, drawn.wi, drawn.u)
        density = Value("pdf", drawn.wo, probe.pdf(probe.whole, drawn.wi, drawn.wo))
        drawn_density = Value("a sample's density", samples.wo, samples.density)
        return [*probe.values(drawn.wi, drawn.wo), density, drawn_density]

    named = found()
    probe.bsdf.parameters_changed([])
    why = "after parameters_changed without names: what is kept of it is out of date"
    _compare(run, outcome, drawn, once, named, found(), why)


def recompiles(run: Run) -> Findings:
    """Check that a new value of a parameter compiles no kernel, after its first update."""
    parameters, findings = traced_floats(run, "recompiles")
    yield from findings
    wi, u = run.probe.whole.around(64, 1), random(64, 2)

    def launched(parameter: Parameter, value: Any) -> set[int]:
        dr.make_opaque(value)
        parameter.set(value)
        return launched_kernels(lambda: run.probe.sample(run.probe.whole, wi, u))

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for each in parameters:
            outcome = Outcome("recompiles", each.key)
            with each.restored() as original:
                first, *later = [launched(each, original * (0.97 - 0.01 * step) + 1e-4) for step in range(4)]
            if fresh := set.union(*later) - first:
                outcome.fault(f"{len(fresh)} kernels are compiled for three new values")
            yield outcome.finding("No kernel is compiled for a new value.")


def loaded_or_none(given: dict[str, Any]) -> Any:
    """Return what a dict stands for, or None if the plugin refuses it."""
    try:
        with unwrapped_ctrl_c():
            return load(given)
    except (RuntimeError, TypeError):
        return None
