"""Checks of what an optimiser needs: derivatives for the parameters, and updates that compile nothing."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager

import drjit as dr
import mitsuba as mi
import numpy as np

from ..ranges import ranges
from .outcome import Findings, Outcome, relative
from .report import Finding
from .subject import angles_of, direction, hemisphere, interaction, numbers, on_side, random, variates_of, vectors

TOLERANCE = 0.02
COUNT = 2000


def traced_floats(run, check: str):
    """``(params, keys, findings)``: the parameters that are floats, and what to say of the others."""
    params = mi.traverse(run.subject.bsdf)
    keys, findings = [], []
    for key in params.keys():
        if not _is_traced(params, key):
            findings.append(Finding(check, key, "skip", "Not a number of floating point that Dr.Jit traces."))
        elif check == "gradients" and int(params.flags(key)) & int(mi.ParamFlags.NonDifferentiable):
            findings.append(Finding(check, key, "skip", "Declared not differentiable."))
        else:
            keys.append(key)
    return params, keys, findings


def _is_traced(params, key) -> bool:
    try:
        value = params[key]
    except TypeError:  # it may be None, which Mitsuba does not expect itself
        return False
    return dr.is_arithmetic_v(value) and dr.is_float_v(value) and dr.is_jit_v(value)


def _value(params, key):
    return type(params[key])(params[key])


def set_value(params, key, value):
    params[key] = type(params[key])(value)
    params.update()


@contextmanager
def restored(params, key):
    """The value of a parameter, which gets it back in the end."""
    original = _value(params, key)
    try:
        yield original
    finally:
        set_value(params, key, original)


def gradients(run) -> Findings:
    """The derivatives of ``eval`` for each parameter are finite, also at grazing and normal incidence, and equal to
    finite differences: to 2 % on average, besides the error of these, over directions as they are drawn. At a kink,
    the derivatives of both sides will do, and what lies between; where the differences of two steps disagree, as at a
    jump, they prove nothing and do not count, and where that is so of most, a value beside the one given is looked at.

    Where ``eval`` has a derivative, so has what ``sample`` returns, which integrators that are differentiated step by
    step use (``prb`` calls ``eval`` again): the direction, or else the weight. For plugins of ours, which detach the
    direction and its density, it is that of eval over pdf.

    A parameter of a plugin of ours that an optimiser took beyond its range is evaluated at the limit, and led back:
    where a derivative inside the limit is not zero, the reverse derivative of the sum of the values or that of its
    negative is not, and a step against it leads to the limit.

    And the derivatives of ``eval`` and ``pdf`` for the directions are finite."""
    subject, part = run.subject, run.subject.whole
    yield _directional(run)
    params, keys, findings = traced_floats(run, "gradients")
    yield from findings
    wi, u = on_side(hemisphere(COUNT, 12), part.sides[0]), random(COUNT, 13)
    samples = subject.sample(part, wi, u)
    kept = samples.drawn & (samples.pdf > 0) & (wi[:, 2] * part.sides[0] > 0.05)
    wi, wo, scale = wi[kept], np.ascontiguousarray(samples.wo[kept]), 1 / samples.pdf[kept]
    u = u[kept]
    if not kept.any():  # it may be black until a parameter changes
        wi, wo = (on_side(hemisphere(COUNT, seed), part.sides[0]) for seed in (12, 14))
        scale = np.full(COUNT, 2 * np.pi)
    wi, scale = np.ascontiguousarray(wi), scale[:, None]
    edges, limits = _edges(part), ranges(subject.bsdf) if hasattr(subject.bsdf, "model") else {}

    def values():
        return subject.eval(part, wi, wo)

    for key in keys:
        with restored(params, key) as original:
            outcome = Outcome("gradients", key)
            derivative, total = _derivatives(params, key, part, subject, wi, wo)
            at_edges, total_at_edges = _derivatives(params, key, part, subject, *edges)
            if len(u):
                _check_weight(outcome, subject, params, key, wi, u, derivative * scale)
            set_value(params, key, original)
            for name, found in (
                ("of its derivatives", derivative),
                ("of its derivatives at grazing or normal incidence", at_edges),
                ("of its derivatives by dr.backward", total),
                ("of its derivatives by dr.backward at grazing or normal incidence", total_at_edges),
            ):
                if not np.isfinite(found).all():
                    outcome.fault(f"{1 - np.isfinite(found).mean():.1%} {name} are not finite", np.inf)
            size = float(np.mean(abs(np.array(original, np.float64))))
            # Mitsuba itself refuses negative values of a measured spectrum.
            for limit, beyond, inside in _beyond(None if key.endswith(".values") else limits.get(key)):
                _check_way_back(outcome, subject, params, key, (limit, beyond, inside), wi, wo)
            set_value(params, key, original)
            step = 0.01 * size if size > 0 else 0.01
            trusted = np.zeros(1)
            candidates = [(0, 1), (0, 0.1), (0, 0.01), (10 * step, 1), (-10 * step, 1)]
            # At the end of a range, the derivative that leads an optimiser inwards need not be that of the values.
            lowest, highest = limits.get(key, (-np.inf, np.inf))
            least, most = (float(extreme(np.array(original))) for extreme in (np.min, np.max))
            inner = [each for each in candidates if lowest < least + each[0] and most + each[0] < highest]
            for shift, part_of in inner or candidates:
                set_value(params, key, original + shift)
                if shift:
                    # At an index of refraction of 1, no reflection turns into total reflection: look beside it.
                    derivative, _ = _derivatives(params, key, part, subject, wi, wo)
                differences = _differences(params, key, values, part_of * step)
                if differences[2].mean() > trusted.mean():
                    low, high, trusted, noise = differences
                    compared = derivative
                if trusted.mean() > 0.95:
                    break
        if trusted.mean() < 0.5:
            words = "Finite differences of two steps disagree: no derivative to tell."
            yield outcome.finding("") if outcome.faults else Finding("gradients", key, "skip", words)
            continue
        scales = np.broadcast_to(scale, trusted.shape)[trusted]
        ad, low, high, noise = (x[trusted] * scales for x in (np.nan_to_num(compared), low, high, noise))
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


def _directional(run) -> Finding:
    """Whether ``eval`` and ``pdf`` have finite derivatives for both directions, where formulas break and elsewhere."""
    outcome, subject, part = Outcome("gradients", "wi and wo"), run.subject, run.subject.whole
    wi, wo = _edges(part)
    mirrored = np.float32([-1, -1, 1])
    some = on_side(hemisphere(500, 15), part.sides[0]), on_side(hemisphere(500, 16), part.sides[0])
    wi, wo = np.concatenate([wi, wi, some[0], some[0]]), np.concatenate([wo, wi * mirrored, *some])
    for name, method in (("eval", subject.bsdf.eval), ("pdf", subject.bsdf.pdf)):
        si, towards = interaction(wi), vectors(wo)
        dr.enable_grad(si.wi, towards)
        result = method(part.context, si, towards, True)
        if not dr.grad_enabled(result):
            continue
        dr.backward(dr.sum(result, axis=None))
        for word, gradient in (("wi", dr.grad(si.wi)), ("wo", dr.grad(towards))):
            bad = ~np.isfinite(numbers(gradient, len(wi))).all(axis=1)
            if bad.any():
                k = int(np.argmax(bad))
                outcome.fault(
                    f"the derivative of {name} for {word} is not finite for light from {angles_of(wi[k])} towards "
                    f"{angles_of(wo[k])}, and of {bad.mean():.1%} of the pairs tried",
                    bad.sum(),
                )
    return outcome.finding("The derivatives of eval and pdf for the directions are finite.")


def _check_weight(outcome, subject, params, key, wi, u, expected):
    """The derivative of ``sample``'s weight, where that of value over pdf is ``expected``."""
    attach(params, key)
    bs, weight = subject.bsdf.sample(subject.whole.context, interaction(wi), *variates_of(u), True)
    twice = bs.wo * 2  # only ends of the graph keep a derivative, and the weight may depend on the direction
    moved, found = np.zeros(1), np.zeros(1)
    if dr.grad_enabled(weight) or dr.grad_enabled(twice):
        dr.forward(params[key])
        moved, found = numbers(dr.grad(twice), len(wi)), numbers(dr.grad(weight), len(wi))
    dr.disable_grad(params[key])
    if not np.isfinite(found).all():
        outcome.fault(
            f"{1 - np.isfinite(found).mean():.1%} of the derivatives of sample's weight are not finite", np.inf
        )
    size, error = abs(expected).mean(), abs(np.nan_to_num(found) - expected).mean()
    if moved.any() or not size > 0:
        return
    ours = hasattr(subject.bsdf, "model")
    if abs(found).mean() < 0.01 * size or (ours and error > TOLERANCE * size):
        outcome.fault(
            f"the derivatives of sample's weight average {abs(found).mean():.3g} in size, but those of eval over pdf "
            f"{size:.3g}, and differ by {error / size:.0%}",
            error / size,
        )


def _beyond(limits):
    """``(limit, beyond, inside)`` for each finite end of a range: values of a parameter."""
    if limits is None:
        return
    low, high = limits
    width = min(high - low, 1)
    for limit, outwards in ((low, -1), (high, 1)):
        if np.isfinite(limit):
            step = outwards * max(0.1 * width, 1e-3 * abs(limit))
            yield limit, limit + step, limit - 0.1 * step


def _check_way_back(outcome, subject, params, key, values, wi, wo):
    """Whether an optimiser returns from a value beyond a limit."""
    limit, beyond, inside = values
    kind, part, few = type(_value(params, key)), subject.whole, slice(0, 500)
    wi, wo = np.ascontiguousarray(wi[few]), np.ascontiguousarray(wo[few])

    def backward(value, signs):
        """The value there, and the derivatives of its sum with some signs."""
        set_value(params, key, dr.full(kind, value, dr.width(params[key])))
        attach(params, key)
        result = subject.bsdf.eval(part.context, interaction(wi), vectors(wo), True)
        found = []
        for sign in signs:
            if dr.grad_enabled(result):
                dr.set_grad(params[key], 0)
                dr.set_grad(result, sign)
                dr.enqueue(dr.ADMode.Backward, result)
                dr.traverse(dr.ADMode.Backward, flags=dr.ADFlag.ClearInterior | dr.ADFlag.ClearInput)
            found.append(np.array(dr.grad(params[key]), np.float64).ravel())
        dr.disable_grad(params[key])
        return numbers(dr.detach(result), len(wi)), found

    value, ways = backward(beyond, (1, -1))
    set_value(params, key, dr.full(kind, limit, dr.width(params[key])))
    error = relative(value, subject.eval(part, wi, wo)).max(initial=0)
    if error > 10 * subject.rounding(part):
        outcome.fault(f"at {beyond:g}, beyond its limit of {limit:g}, eval is not that at the limit", error)
    outwards = max((float((found * np.sign(limit - beyond)).max()) for found in ways), default=0.0)
    if outwards > 0:
        outcome.fault(
            f"at {beyond:g}, beyond its limit of {limit:g}, a step against its derivative leads away", outwards
        )
    if any(found.any() for found in ways):
        return
    # Towards the limit it may vanish, as at an index of refraction of 1, or grow, as where an edge becomes a jump.
    near, nearer = (abs(backward(limit + share * (inside - limit), (1,))[1][0]).sum() for share in (0.1, 0.01))
    if max(0.3 * near, 1e-6 * len(wi)) < nearer < 3 * near:
        outcome.fault(
            f"at {beyond:g}, beyond its limit of {limit:g}, no derivative leads back: those of the sum of eval and of "
            f"its negative are 0, but just inside the limit it is {nearer:.3g}",
            np.inf,
        )


def attach(params, key):
    """Make a parameter what derivatives are taken for."""
    value = type(params[key])(dr.detach(params[key]))
    dr.enable_grad(value)
    params[key] = value
    params.update()


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
        attach(params, key)
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
    between them will do. Where one side changes nothing, the other counts, if that is so of most, as at the end of a
    range: where it is so of some, they may be reflected totally."""
    original, centre = _value(params, key), values()

    def at(shift):
        set_value(params, key, original + shift)
        return values()

    def quotients(h):
        return (at(h) - centre) / h, (centre - at(-h)) / h

    (above, below), (nearer_above, nearer_below) = quotients(step), quotients(step / 2)
    noise = 4e-7 * abs(centre) / step
    up, down = 2 * nearer_above - above, 2 * nearer_below - below
    lone = (above == 0) != (below == 0)
    if lone.sum() > 0.5 * ((above != 0) | (below != 0)).sum():
        up, down = np.where(above == 0, down, up), np.where(below == 0, up, down)
    else:
        lone[:] = False
    gap, nearer_gap = abs(above - below), abs(nearer_above - nearer_below)
    slopes = (above, nearer_above), (below, nearer_below)
    settled = [abs(near - far) <= 0.3 * np.maximum(abs(near), abs(far)) + 4 * noise for far, near in slopes]
    kink = (
        ~lone
        & settled[0]
        & settled[1]
        & (nearer_gap > 0.75 * gap)
        & (nearer_gap > 0.05 * abs(nearer_above) + 4 * noise)
    )
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
    params, keys, findings = traced_floats(run, "recompiles")
    yield from findings
    wi, u = on_side(hemisphere(64, 1), part.sides[0]), random(64, 2)

    def launched():
        return kernels_of(lambda: subject.sample(part, wi, u))

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for key in keys:
            outcome, kernels = Outcome("recompiles", key), []
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
