"""Checks of what an optimiser needs: derivatives for the parameters, and updates that compile nothing."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from .outcome import Findings, Outcome
from .report import Finding
from .subject import direction, hemisphere, interaction, numbers, on_side, random, vectors

TOLERANCE = 0.02
COUNT = 2000


def _floats(run, check: str):
    """``(params, keys, findings)``: the parameters that are floats, and what to say of the others."""
    params = mi.traverse(run.subject.bsdf)
    keys, findings = [], []
    for key in params.keys():
        if not (dr.is_arithmetic_v(params[key]) and dr.is_float_v(params[key]) and dr.is_jit_v(params[key])):
            findings.append(Finding(check, key, "skip", "Not a number of floating point that Dr.Jit traces."))
        elif check == "gradients" and int(params.flags(key)) & int(mi.ParamFlags.NonDifferentiable):
            findings.append(Finding(check, key, "skip", "Declared not differentiable."))
        else:
            keys.append(key)
    return params, keys, findings


def _value(params, key):
    return type(params[key])(params[key])


def _set(params, key, value):
    params[key] = type(params[key])(value)
    params.update()


def gradients(run) -> Findings:
    """The derivatives of ``eval`` for each parameter are finite, also at grazing and normal incidence, and equal to
    finite differences: to 2 % on average, besides the error of these, over directions as they are drawn. At a kink,
    the derivatives of both sides will do, and what lies between; where the differences of two steps disagree, as at a
    jump, they prove nothing and do not count."""
    subject, part = run.subject, run.subject.whole
    params, keys, findings = _floats(run, "gradients")
    yield from findings
    wi = on_side(hemisphere(COUNT, 12), part.sides[0])
    samples = subject.sample(part, wi, random(COUNT, 13))
    kept = samples.drawn & (samples.pdf > 0) & (wi[:, 2] * part.sides[0] > 0.05)
    wi, wo = np.ascontiguousarray(wi[kept]), np.ascontiguousarray(samples.wo[kept])
    scale = 1 / samples.pdf[kept][:, None]
    edges = _edges(part)

    def values():
        return subject.eval(part, wi, wo)

    for key in keys:
        outcome, original = Outcome("gradients", key), _value(params, key)
        derivative, total = _derivatives(params, key, part, subject, wi, wo)
        at_edges, total_at_edges = _derivatives(params, key, part, subject, *edges)
        _set(params, key, original)
        for name, found in (
            ("of its derivatives", derivative),
            ("of its derivatives at grazing or normal incidence", at_edges),
            ("of its derivatives by dr.backward", total),
            ("of its derivatives by dr.backward at grazing or normal incidence", total_at_edges),
        ):
            if not np.isfinite(found).all():
                outcome.fault(f"{1 - np.isfinite(found).mean():.1%} {name} are not finite", np.inf)
        size = float(np.mean(abs(np.array(original, np.float64))))
        low, high, trusted, noise = _differences(params, key, values, 0.01 * size if size > 0 else 0.01)
        _set(params, key, original)
        if trusted.mean() < 0.5:
            yield Finding("gradients", key, "skip", "Finite differences of two steps disagree: no derivative to tell.")
            continue
        scales = np.broadcast_to(scale, trusted.shape)[trusted]
        ad, low, high, noise = (x[trusted] * scales for x in (np.nan_to_num(derivative), low, high, noise))
        fd = np.clip(ad, low, high)
        error, size = abs(ad - fd).sum(), max(abs(fd).sum(), abs(ad).sum())
        outcome.data = {"error": float(error), "size": float(size)}
        if error > TOLERANCE * size + noise.sum():
            outcome.fault(
                f"its derivatives are off by {error / size:.0%}: those of eval average {abs(ad).mean():.3g} in size, "
                f"finite differences {abs(fd).mean():.3g}",
                error / size,
            )
        agreement = "it has no influence" if size == 0 else f"they agree to {error / size:.1g}"
        yield outcome.finding(f"Finite and equal to finite differences: {agreement}.")
    if not keys and not findings:
        yield Finding("gradients", "whole", "skip", "It has no parameters.")


def _edges(part):
    edge = np.array([direction(t, phi) for t in (0, 1e-3, 45, 89, 89.9, 89.99) for phi in (0, 50, 180)])
    edge = on_side(edge, part.sides[0])
    wi, wo = (np.ascontiguousarray(w.reshape(-1, 3)) for w in np.broadcast_arrays(edge[:, None], edge[None]))
    return wi, wo


def _derivatives(params, key, part, subject, wi, wo):
    """``(derivatives, total)`` for a parameter: of each value as all entries of the parameter grow alike, by forward
    differentiation, and of the sum of the values by reverse differentiation, in which other things go wrong."""
    if not len(wo):
        return np.zeros((0, 1)), np.zeros(1)
    found = []
    for reverse in (False, True):
        value = type(params[key])(dr.detach(params[key]))
        dr.enable_grad(value)
        params[key] = value
        params.update()
        result = subject.bsdf.eval(part.context, interaction(wi), vectors(wo), True)
        attached = dr.grad_enabled(result)
        if reverse:
            if attached:
                dr.backward(dr.sum(result, axis=None))
            found.append(np.array(dr.grad(params[key]), np.float64).ravel())
        else:
            if attached:
                dr.forward(params[key])
            found.append(numbers(dr.grad(result), len(wo)).copy())
        dr.disable_grad(params[key])
    return found


def _differences(params, key, values, step):
    """``(low, high, trusted, noise)``: bounds of the derivatives, by differences of two steps, extrapolated. The bounds
    are the same, but where the differences to the two sides do not approach each other: at a kink any derivative
    between them will do. Where one side changes nothing, as at the end of a range, the other counts."""
    original, centre = _value(params, key), values()

    def at(shift):
        _set(params, key, original + shift)
        return values()

    def quotients(h):
        return (at(h) - centre) / h, (centre - at(-h)) / h

    (above, below), (nearer_above, nearer_below) = quotients(step), quotients(step / 2)
    noise = 4e-7 * abs(centre) / step
    up, down = 2 * nearer_above - above, 2 * nearer_below - below
    up, down = np.where(above == 0, down, up), np.where(below == 0, up, down)
    lone = (above == 0) != (below == 0)
    gap, nearer_gap = abs(above - below), abs(nearer_above - nearer_below)
    kink = ~lone & (nearer_gap > 0.75 * gap) & (nearer_gap > 0.05 * abs(nearer_above) + 4 * noise)
    first, second = (above + below) / 2, (nearer_above + nearer_below) / 2
    smooth = np.where(lone, up, (4 * second - first) / 3)
    change = np.where(lone, up - np.where(above == 0, below, above), first - second)
    trusted = kink | (abs(change) <= 0.05 * abs(smooth) + 4 * noise)
    noise = noise + np.where(kink, 0, 0.5 * abs(change))
    low, high = (np.where(kink, choose(up, down), smooth) for choose in (np.minimum, np.maximum))
    return low, high, trusted & np.isfinite(low) & np.isfinite(high), noise


def kernels_of(work: Callable[[], object]) -> set[int]:
    """The kernels that some work launches, by hash: whether one is compiled depends on the cache that earlier runs
    left. They must be recorded, by ``dr.JitFlag.KernelHistory``."""
    dr.kernel_history_clear()
    work()
    return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}


def recompiles(run) -> Findings:
    """A new value of a parameter compiles no kernel, after its first update."""
    subject, part = run.subject, run.subject.whole
    params, keys, findings = _floats(run, "recompiles")
    yield from findings
    wi, u = on_side(hemisphere(64, 1), part.sides[0]), random(64, 2)

    def launched():
        return kernels_of(lambda: subject.sample(part, wi, u))

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for key in keys:
            outcome, original, kernels = Outcome("recompiles", key), _value(params, key), []
            for step in range(4):
                value = original * (0.97 - 0.01 * step) + 1e-4
                dr.make_opaque(value)
                _set(params, key, value)
                kernels.append(launched())
            _set(params, key, original)
            fresh = len(set.union(*kernels) - kernels[0])
            if not kernels[0]:
                outcome.fault("no kernel was launched at all")
            if fresh:
                outcome.fault(f"{fresh} kernels are compiled for three new values")
            yield outcome.finding("No kernel is compiled for a new value.")
    if not keys and not findings:
        yield Finding("recompiles", "whole", "skip", "It has no parameters.")
