"""The check of the derivatives that an optimiser needs, by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..parameters import nested
from ..probe.arrays import Array, interaction, numbers, sample_arguments, vectors
from ..probe.bsdf import Part
from ..probe.directions import direction, hemisphere, on_side
from ..probe.variates import random
from ..ranges import declared, limits_of
from .outcome import Findings, Outcome, relative
from .report import Finding
from .run import Run
from .updates import attach, restored, set_value, traced_floats, value_of

TOLERANCE = 0.02
LOST = 3
"""How many times its last digit a value may be off, as of formulas whose terms cancel."""
ROUNDING = 4e-7
"""The relative error of the difference of two values by rounding."""
COUNT = 2000
TURN = 0.01
"""The step by which directions are turned, in parts of the width of a lobe."""


def gradients(run: Run) -> Findings:
    """Check that the derivatives of ``eval`` for each parameter are finite, also at grazing and normal incidence, and
    equal to finite differences: to 2 % on average, besides the error of these, over directions as they are drawn. At a
    kink, the derivatives of both sides will do, and what lies between; where the differences of two steps disagree, as
    at a jump, they prove nothing and do not count, and where that is so of most, a value beside the one given is looked
    at.

    ``eval_pdf`` has the derivatives of ``eval``. Where that has one, so has what ``sample`` returns, which integrators
    that are differentiated step by step use (``prb`` calls ``eval`` again): the direction, or else the weight, whose
    derivative is that of eval over pdf. Plugins of ours detach the direction and its density; others may differentiate
    the density.

    A parameter of a plugin of ours that an optimiser took beyond its range is evaluated at the limit, and led back:
    where a derivative inside the limit is not zero, the reverse derivative of the sum of the values or that of its
    negative is not, and a step against it leads to the limit.

    And the derivatives of ``eval`` and ``pdf`` for the directions are finite, and where ``eval`` has any, they are
    those of finite differences, to 2 % on average, too.
    """
    probe, part = run.probe, run.probe.whole
    yield _directional(run)
    params, keys, findings = traced_floats(run, "gradients")
    yield from findings
    wi, u = on_side(hemisphere(COUNT, 12), part.sides[0]), random(COUNT, 13)
    samples = probe.sample(part, wi, u)
    kept = samples.drawn & (samples.pdf > 0) & (wi[:, 2] * part.sides[0] > 0.05)
    wi, wo, scale = wi[kept], np.ascontiguousarray(samples.wo[kept]), 1 / samples.pdf[kept]
    u = u[kept]
    if not kept.any():  # it may be black until a parameter changes
        wi, wo = (on_side(hemisphere(COUNT, seed), part.sides[0]) for seed in (12, 14))
        scale = np.full(COUNT, 2 * np.pi)
    wi, scale = np.ascontiguousarray(wi), scale[:, None]
    edges, limits = _edges(part), dict(limits_of(params))
    turning = {key for key, bsdf, _, name in declared(params) if name in _turning(bsdf.model)}

    for key in keys:
        with restored(params, key) as original:
            outcome = Outcome("gradients", key)
            derivative, total = _derivatives(run, params, key, wi, wo)
            at_edges, total_at_edges = _derivatives(run, params, key, *edges)
            if len(u):
                _check_weight(run, outcome, params, key, wi, u, derivative * scale)
            set_value(params, key, original)
            for name, values in (
                ("of its derivatives", derivative),
                ("of its derivatives at grazing or normal incidence", at_edges),
                ("of its derivatives by dr.backward", total),
                ("of its derivatives by dr.backward at grazing or normal incidence", total_at_edges),
            ):
                if not np.isfinite(values).all():
                    outcome.fault(f"{1 - np.isfinite(values).mean():.1%} {name} are not finite", np.inf)
            size = float(np.mean(abs(np.array(original, np.float64))))
            lowest, highest = limits.get(key, (-np.inf, np.inf))
            for limit, outwards in ((lowest, -1), (highest, 1)):
                # Mitsuba itself refuses negative values of a measured spectrum.
                if np.isfinite(limit) and not key.endswith(".values"):
                    beyond = outwards * max(0.1 * min(highest - lowest, 1), 1e-3 * abs(limit))
                    _check_way_back(run, outcome, params, key, limit, beyond, wi, wo)
            set_value(params, key, original)
            rounding = ROUNDING
            if key in turning:
                size = min(size, 1)  # many turns are as few
                # Turned directions are rounded anew, which a narrow lobe sees.
                rounding += 1e-7 / min(run.spread(part), 1)
            step = 0.01 * size if size > 0 else 0.01
            found = []
            least, most = (float(extreme(np.array(original))) for extreme in (np.min, np.max))
            into = min(highest - most, 0) + max(lowest - least, 0)
            candidates = [(into, 1), (into, 0.1), (into, 0.01), (into + 10 * step, 1), (into - 10 * step, 1)]
            # At the end of a range, the derivative that leads an optimiser inwards need not be that of the values.
            inner = [each for each in candidates if lowest < least + each[0] and most + each[0] < highest]
            for shift, part_of in inner or candidates:
                set_value(params, key, original + shift)
                if shift:
                    # At an index of refraction of 1, no reflection turns into total reflection: look beside it.
                    derivative, _ = _derivatives(run, params, key, wi, wo)
                # Float32 must know the values to far less than a step.
                known = np.spacing(np.abs(np.array(original + shift, np.float32)).max()) < 0.01 * part_of * step
                # Plugins other than ours may clip: look beside such ends.
                shifted = _shifted(run, params, key, wi, wo)
                tried = _differences(shifted, part_of * step, known, probe.is_ours or key in limits, rounding)
                found.append((tried, derivative))
                if tried.trusted.mean() > 0.95:
                    break
        differences, compared = max(found, key=lambda it: it[0].trusted.mean())
        if differences.trusted.mean() < 0.5:
            words = "Finite differences of two steps disagree: no derivative to tell."
            yield outcome.finding("") if outcome.faults else Finding("gradients", key, "skip", words)
            continue
        error, size = _judge(outcome, "its derivatives", compared, differences, scale, wi, wo)
        outcome.data = {"error": error, "size": size}
        agreement = "it has no influence" if size == 0 else f"they agree to {error / size:.1g}"
        yield outcome.finding(f"Finite and equal to finite differences: {agreement}.")
    if not keys and not findings:
        yield Finding("gradients", "whole", "skip", "It has no parameters.")


def _turning(model: Any) -> set[str]:
    """Return the names of the parameters of a model that are angles of a whole turn."""
    return {it.name for parameter in nested(model.declared()) for way in parameter.spellings for it in way if it.turns}


def _judge(
    outcome: Outcome, name: str, compared: Array, differences: Differences, scale: Array, wi: Array, wo: Array
) -> tuple[float, float]:
    """Add a fault if derivatives are off on average; return their error and their size."""
    low, high, trusted, noise = differences
    scales = np.broadcast_to(scale, trusted.shape)[trusted]
    ad, low, high, noise = (x[trusted] * scales for x in (np.nan_to_num(compared), low, high, noise))
    fd = np.clip(ad, low, high)
    error, size = float(abs(ad - fd).sum()), float(max(abs(fd).sum(), abs(ad).sum()))
    if error > TOLERANCE * size + LOST * noise.sum():
        k = np.nonzero(trusted)[0][int(np.argmax(abs(ad - fd)))]
        sizes = f"those of eval average {abs(ad).mean():.3g} in size, finite differences {abs(fd).mean():.3g}"
        outcome.fault(f"{name} are off by {error / size:.0%}: {sizes}", error / size, wi=wi[k], wo=wo[k])
    return error, size


def _directional(run: Run) -> Finding:
    """Check the derivatives of ``eval`` and ``pdf`` for the directions: they are finite, also where formulas break, and
    those of ``eval`` are those of finite differences."""
    outcome, probe, part = Outcome("gradients", "wi and wo"), run.probe, run.probe.whole
    wi, wo = _edges(part)
    mirrored = np.array([-1, -1, 1], np.float32)
    some = on_side(hemisphere(500, 15), part.sides[0]), on_side(hemisphere(500, 16), part.sides[0])
    wi, wo = np.concatenate([wi, wi, some[0], some[0]]), np.concatenate([wo, wi * mirrored, *some])
    for name, method in (("eval", probe.bsdf.eval), ("pdf", probe.bsdf.pdf)):
        si, towards = interaction(wi), vectors(wo)
        dr.enable_grad(si.wi, towards)
        result = method(part.context, si, towards, True)
        if not dr.grad_enabled(result):
            continue
        dr.backward(dr.sum(result, axis=None))
        for word, gradient in (("wi", dr.grad(si.wi)), ("wo", dr.grad(towards))):
            found = numbers(gradient, len(wi))
            bad = np.logical_not(np.isfinite(found).all(axis=1))
            why = f"as of {bad.mean():.1%} of the pairs tried"
            outcome.wrong(bad, f"the derivative of {name} for {word}", found, why, wi, wo)
    agreement = _compare_directional(run, outcome)
    return outcome.finding(f"The derivatives of eval and pdf for the directions are finite{agreement}.")


def _compare_directional(run: Run, outcome: Outcome) -> str:
    """Compare derivatives of ``eval``, as both directions turn, to finite differences; return what to say of them."""
    probe, part = run.probe, run.probe.whole
    wi = on_side(hemisphere(COUNT, 17, 0.1), part.sides[0])
    samples = probe.sample(part, wi, random(COUNT, 18))
    kept = samples.drawn & (samples.pdf > 0) & (abs(samples.wo[:, 2]) > 0.1)
    step = TURN * min(run.spread(part), 1)
    if not kept.any() or step < 1e-5:
        return ""
    directions = np.stack([wi[kept], samples.wo[kept]]).astype(np.float64)
    axes = np.cross(directions, np.random.default_rng(19).normal(size=directions.shape))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)

    def at(angle: float) -> Array:
        turned = np.cos(angle) * directions + np.sin(angle) * axes
        return probe.eval(part, *np.ascontiguousarray(turned.astype(np.float32)))

    angle = mi.Float(0)
    dr.enable_grad(angle)
    wi, wo = np.ascontiguousarray(directions.astype(np.float32))
    si, towards = interaction(wi), vectors(wo)
    si.wi, towards = (w + angle * vectors(axis) for w, axis in zip((si.wi, towards), axes, strict=True))
    result = probe.bsdf.eval(part.context, si, towards, True)
    if not dr.grad_enabled(result):
        return ""
    dr.forward(angle)
    derivative = numbers(dr.grad(result), len(wi))
    differences = _differences(at, step)
    differences = differences._replace(noise=differences.noise + 1e-7 * abs(differences.low) / step)
    if differences.trusted.mean() < 0.5:
        return ""
    scale = 1 / samples.pdf[kept, None]
    error, size = _judge(outcome, "the derivatives for wi and wo", derivative, differences, scale, wi, wo)
    outcome.data = {"error": error, "size": size}
    return f", and eval's agree with finite differences to {error / max(size, 1e-12):.1g}"


def _check_weight(
    run: Run, outcome: Outcome, params: mi.SceneParameters, key: str, wi: Array, u: Array, expected: Array
) -> None:
    """Check the derivatives of ``eval_pdf``'s value and of ``sample``'s weight, where that of ``eval`` over pdf is
    ``expected``."""
    bsdf, whole = run.probe.bsdf, run.probe.whole
    attach(params, key)
    bs, weight = bsdf.sample(whole.context, interaction(wi), *sample_arguments(u), True)
    value, density = bsdf.eval_pdf(whole.context, interaction(wi), dr.detach(bs.wo), True)
    quotient = value / density
    # Only ends of the graph keep a derivative, and the weight may depend on the direction.
    twice, pair = bs.wo * 2, value / dr.detach(density)
    moved, found, attached, of_pair = (np.zeros((len(wi), 1)) for _ in range(4))
    if dr.grad_enabled(weight, twice, quotient, pair):
        dr.forward(params[key])
        moved, found, attached, of_pair = (numbers(dr.grad(it), len(wi)) for it in (twice, weight, quotient, pair))
    dr.disable_grad(params[key])
    if not np.isfinite(found).all():
        lost = 1 - np.isfinite(found).mean()
        outcome.fault(f"{lost:.1%} of the derivatives of sample's weight are not finite", np.inf)
    size = abs(expected).mean()
    if not size > 1e-5:  # less is rounding, as where an index of refraction of 1 reflects nothing
        return
    # Plugins other than ours may differentiate their density, too.
    accepted = [expected] if run.probe.is_ours else [expected, np.nan_to_num(attached)]
    compared = [("eval_pdf's value over pdf", of_pair, [expected])]
    if not moved.any():
        compared.append(("sample's weight", found, accepted))
    for name, values, right in compared:
        error = min(abs(np.nan_to_num(values) - each).mean() for each in right)
        if error > TOLERANCE * size:
            sizes = f"average {abs(values).mean():.3g} in size, but those of eval over pdf {size:.3g}"
            outcome.fault(f"the derivatives of {name} {sizes}, and differ by {error / size:.0%}", error / size)


def _check_way_back(
    run: Run, outcome: Outcome, params: mi.SceneParameters, key: str, limit: float, step: float, wi: Array, wo: Array
) -> None:
    """Check that an optimiser returns from a value that is a step beyond a limit."""
    probe, part = run.probe, run.probe.whole
    original = value_of(params, key)  # a number, a colour, or the texels of a bitmap
    # At grazing angles the derivatives of a reflectance grow without bound as an index goes to 1.
    few = np.flatnonzero(np.minimum(abs(wi[:, 2]), abs(wo[:, 2])) > 0.2)[:500]
    wi, wo = wi[few], wo[few]
    # Less is rounding, as where an index of refraction of 1 reflects nothing.
    least = 1e-6 * probe.eval(part, wi, wo).max()

    def backward(value: float, signs: tuple[int, ...]) -> tuple[Array, list[Array]]:
        """Return the values there, and the derivatives of their sum with some signs."""
        set_value(params, key, original * 0 + value)
        attach(params, key)
        result = probe.bsdf.eval(part.context, interaction(wi), vectors(wo), True)
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

    beyond = limit + step
    start = f"at {beyond:g}, beyond its limit of {limit:g},"
    value, ways = backward(beyond, (1, -1))
    set_value(params, key, original * 0 + limit)
    at_limit = probe.eval(part, wi, wo)
    error = (relative(value, at_limit) * (abs(value - at_limit) > least)).max(initial=0)
    if error > 10 * run.rounding(part):
        outcome.fault(f"{start} eval is not that at the limit", error)
    outwards = max((float((found * np.sign(limit - beyond)).max()) for found in ways), default=0.0)
    if outwards > 0:
        outcome.fault(f"{start} a step against its derivative leads away", outwards)
    if any(found.any() for found in ways):
        return
    # Towards the limit it may vanish, as at an index of refraction of 1, or grow, as where an edge becomes a jump.
    near, nearer = (abs(backward(limit - 0.1 * share * step, (1,))[1][0]).sum() for share in (0.1, 0.001))
    if max(0.3 * near, 1e-6 * len(wi)) < nearer < 3 * near:
        words = f"those of the sum of eval and of its negative are 0, but just inside the limit it is {nearer:.3g}"
        outcome.fault(f"{start} no derivative leads back: {words}", np.inf)


def _edges(part: Part) -> tuple[Array, Array]:
    """Return pairs of directions where formulas break: normal, grazing, mirrored, equal."""
    edge = np.array([direction(t, phi) for t in (0, 1e-3, 45, 89, 89.9, 89.99) for phi in (0, 50, 180)])
    edge = on_side(edge, part.sides[0])
    wi, wo = (np.ascontiguousarray(w.reshape(-1, 3)) for w in np.broadcast_arrays(edge[:, None], edge[None]))
    return wi, wo


def _derivatives(run: Run, params: mi.SceneParameters, key: str, wi: Array, wo: Array) -> tuple[Array, Array]:
    """Return ``(derivatives, total)`` for a parameter: of each value as all entries of the parameter grow alike, by
    forward differentiation, and of the sum of the values by reverse differentiation, in which other things go wrong."""

    def attached() -> Any:
        attach(params, key)
        return run.probe.bsdf.eval(run.probe.whole.context, interaction(wi), vectors(wo), True)

    if dr.grad_enabled(result := attached()):
        dr.forward(params[key])
    derivatives = numbers(dr.grad(result), len(wo)).copy()
    if dr.grad_enabled(result := attached()):
        dr.backward(dr.sum(result, axis=None))
    total = np.array(dr.grad(params[key]), np.float64).ravel()
    dr.disable_grad(params[key])
    return derivatives, total


# --- Finite differences ---------------------------------------------------------------------------------------------


class Differences(NamedTuple):
    """Derivatives, with what is known of them."""

    low: Array
    high: Array
    """The bounds of each."""
    trusted: Array
    """Which of them the two steps agree on."""
    noise: Array
    """The error of each."""


def _shifted(run: Run, params: mi.SceneParameters, key: str, wi: Array, wo: Array) -> Callable[[float], Array]:
    """Return a function that returns values for a shift of a parameter from what it is now."""
    original = value_of(params, key)

    def at(shift: float) -> Array:
        set_value(params, key, original + shift)
        return run.probe.eval(run.probe.whole, wi, wo)

    return at


def _differences(
    at: Callable[[float], Array],
    step: float,
    known: bool = True,
    leads_back: bool = True,
    rounding: float = ROUNDING,
) -> Differences:
    """Return the derivatives of some values for a parameter, by differences of two steps, extrapolated, where ``at``
    returns the values for a shift of the parameter, with that relative ``rounding`` error; none are trusted unless the
    parameter is ``known`` well enough for that.

    The bounds are the same, except where the differences to the two sides do not approach each other: at a kink any
    derivative between them will do. Where one side changes nothing, the other counts, if that is so of most, as at the
    end of a range, where the derivative ``leads_back``: where it is so of some, they may be reflected totally.
    """
    centre = at(0)

    def quotients(h: float) -> tuple[Array, Array]:
        return (at(h) - centre) / h, (centre - at(-h)) / h

    (above, below), (nearer_above, nearer_below) = quotients(step), quotients(step / 2)
    noise = rounding * abs(centre) / step
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
    # Across a peak far narrower than the steps the two sides cancel, but each grows as the step shrinks.
    grows = nearer_gap > 1.5 * gap + 4 * noise
    trusted = (kink | (abs(change) <= 0.05 * abs(smooth) + 4 * noise)) & np.where(lone, leads_back, ~grows)
    noise = noise + np.where(kink, 0, 0.5 * abs(change))
    low, high = (np.where(kink, choose(up, down), smooth) for choose in (np.minimum, np.maximum))
    return Differences(low, high, known & trusted & np.isfinite(low) & np.isfinite(high), noise)
