"""The check of the derivatives that an optimiser needs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import aligned
from ..parameters import Range, nested
from ..probe.arrays import Array, all_numbers, interaction, numbers, sample_arguments, vectors
from ..probe.directions import beside
from ..probe.variates import random
from ..ranges import declared, limits_of
from .differences import ROUNDING, Differences, differences
from .directional import directional
from .outcome import Findings, Outcome, relative
from .pairs import (
    DARK,
    TOLERANCE,
    Pairs,
    compare_differences,
    differentiate_sum,
    disagreement,
    edges_of,
    light_of,
)
from .report import Finding
from .run import Run
from .traced import Parameter, gradient, traced_floats

COUNT = 2000


def gradients(run: Run) -> Findings:
    """Check that the derivatives of ``eval`` for each parameter are finite, also at grazing and normal incidence, the
    same by forward and by reverse differentiation, and equal to finite differences as its entries grow, one channel or
    texel faster than another: to 2 % on average, besides the error of these, over directions as they are drawn. At a
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
    if not run.probe.parts:
        return
    pairs, u = _drawn(run)
    yield directional(run, pairs if len(u) else None)
    parameters, findings = traced_floats(run, "gradients", differentiable=True)
    yield from findings
    weights = list(_of_weights(run, parameters, pairs.wi, u)) if len(u) else [None] * len(parameters)
    for each, of_weights in zip(parameters, weights, strict=True):
        with each.restored():
            yield _checked(run, each, pairs, of_weights)


def _drawn(run: Run) -> tuple[Pairs, Array]:
    """Return pairs as the whole draws them, and the variates that it draws them by; if it is black, as it may be until
    a parameter changes, uniform ones, and no variates."""
    wi, u = run.probe.whole.around(COUNT, 12), random(COUNT, 13)
    samples = run.probe.sample(run.probe.whole, wi, u)
    kept = samples.drawn & (samples.pdf > 0) & (abs(wi[:, 2]) > 0.05)
    if kept.any():
        return Pairs(wi[kept], samples.wo[kept], 1 / samples.pdf[kept, None]), u[kept]
    return Pairs(wi, beside(wi, 14), np.full((COUNT, 1), 2 * np.pi)), u[:0]


def _checked(run: Run, parameter: Parameter, pairs: Pairs, of_weights: OfWeights | None) -> Finding:
    """Return what is found of the derivatives for a parameter, which is left at any value."""
    outcome, original = Outcome("gradients", parameter.key), parameter.value
    limits = dict(limits_of(parameter.params)).get(parameter.key)
    derivatives = _finite_derivatives(run, outcome, parameter, pairs)
    if of_weights is not None:
        _check_weight(run, outcome, of_weights, derivatives * pairs.scale)
    # Mitsuba itself refuses negative values of a measured spectrum.
    if limits and not parameter.key.endswith(".values"):
        _check_ways_back(run, outcome, parameter, limits, pairs)
    parameter.set(original)
    tried = list(_attempts(run, parameter, limits, pairs, derivatives))
    found, compared = max(tried, key=lambda it: it[0].trusted.mean())
    if found.trusted.mean() < 0.5:
        words = "Finite differences of two steps disagree: no derivative to tell."
        return outcome.finding("") if outcome.faults else Finding("gradients", parameter.key, "skip", words)
    right = not outcome.faults
    error, size = compare_differences(outcome, "its derivatives", compared, found, pairs)
    parameter.set(original)
    if right and outcome.faults and _led_back(run, parameter, pairs, _reverse(run, parameter, pairs)):
        words = "What is made of it is at a limit within the plugin, and its derivatives lead back from there."
        return Finding("gradients", parameter.key, "skip", words)
    agreement = f"they agree to {error / size:.1g}" if error < 0.5 * size else "it has no influence beyond rounding"
    return outcome.finding(f"Finite and equal to finite differences: {agreement}.")


def _finite_derivatives(run: Run, outcome: Outcome, parameter: Parameter, pairs: Pairs) -> Array:
    """Check that derivatives are finite and the reverse ones those of forward differentiation, and return these for
    pairs as they are drawn."""
    edges, where = edges_of(run.probe.whole), " at grazing or normal incidence"
    derivatives, reverse = _derivatives(run, parameter, pairs), _reverse(run, parameter, pairs)
    for name, values in (
        ("of its derivatives", derivatives),
        (f"of its derivatives{where}", _derivatives(run, parameter, edges)),
        ("of its derivatives by dr.backward", reverse),
        (f"of its derivatives by dr.backward{where}", _reverse(run, parameter, edges)),
    ):
        if not np.isfinite(values).all():
            outcome.fault(f"{1 - np.isfinite(values).mean():.1%} {name} are not finite", np.inf)
    if outcome.faults:
        return derivatives
    direction, light = _direction(parameter), light_of(run, pairs) / max(_size(parameter), 1)
    if _turns(parameter):  # by directions that are rounded anew, to both sides of a narrow lobe
        light *= max(1, 1e-7 / run.spread(run.probe.whole) ** 2 / DARK)
    told, off = disagreement("its derivatives", derivatives, reverse @ direction, pairs, light)
    if told and not _led_back(run, parameter, pairs, reverse):
        outcome.fault(told, off)
    return derivatives


def _led_back(run: Run, parameter: Parameter, pairs: Pairs, reverse: Array) -> bool:
    """Return whether what is made of a parameter is beyond a limit within its plugin: reverse derivatives that lead
    further out vanish there, others are those of the negative sum, and neither need be the forward ones."""
    return not np.allclose(reverse, -_reverse(run, parameter, pairs, -1), 1e-3)


def _direction(parameter: Parameter) -> Array:
    """Return by how much each entry of a parameter grows: one channel or texel not as another."""
    entries = abs(np.array(parameter.value, np.float64)).ravel()
    if len(entries) == 1 or parameter.key.endswith("wavelengths"):  # which must increase
        return np.ones(len(entries))
    # With this seed the first three, those of a colour, are far from one another.
    direction = np.random.default_rng(64).uniform(0.5, 1.5, len(entries))
    # For a colour, spectral variants have the coefficients of a polynomial in the wavelength, each of its own size.
    if mi.is_spectral and len(entries) % 3 == 0 and 0 < entries.sum() < np.inf:
        sizes = entries.reshape(-1, 3).mean(axis=0)
        direction = (direction.reshape(-1, 3) * (sizes / sizes.mean())).ravel()
    return direction


def _along(parameter: Parameter, by: float = 1) -> Any:
    """Return that, times a number, as a value of the parameter."""
    value = parameter.value
    return aligned(type(value)(np.float32(by * _direction(parameter)).reshape(np.shape(np.array(value)))))


def _derivatives(run: Run, parameter: Parameter, pairs: Pairs) -> Array:
    """Return the derivative of each value for a parameter that grows along its direction, by forward
    differentiation."""
    attached, values = _attached(run, parameter, pairs)
    if dr.grad_enabled(values):
        _forward(attached, _along(parameter))
    return numbers(dr.grad(values), len(pairs.wi)).copy()


def _reverse(run: Run, parameter: Parameter, pairs: Pairs, sign: int = 1) -> Array:
    """Return the derivatives of the weighted sum of the values, or its negative, for each entry of a parameter, by
    reverse differentiation, in which other things go wrong."""
    attached, values = _attached(run, parameter, pairs)
    if dr.grad_enabled(values):
        differentiate_sum(sign * values, pairs)
    return gradient(attached)


def _attached(run: Run, parameter: Parameter, pairs: Pairs) -> tuple[Any, Any]:
    """Return a parameter that derivatives can be taken for, and the values."""
    attached = parameter.attach()
    return attached, run.probe.bsdf.eval(run.probe.whole.context, interaction(pairs.wi), vectors(pairs.wo), True)


def _forward(attached: Any, direction: Any) -> None:
    """Differentiate all that was computed of attached parameters, which grow along a direction."""
    dr.set_grad(attached, direction)
    dr.enqueue(dr.ADMode.Forward, attached)
    dr.traverse(dr.ADMode.Forward)


# --- Beside finite differences --------------------------------------------------------------------------------------


def _attempts(
    run: Run, parameter: Parameter, limits: Range | None, pairs: Pairs, derivatives: Array
) -> Iterator[tuple[Differences, Array]]:
    """Yield finite differences at the value of a parameter and beside it, until some can be trusted, each with the
    derivatives there; ``derivatives`` are those at its value."""
    original, (lowest, highest) = parameter.value, limits or (-np.inf, np.inf)
    entries = np.array(original, np.float64)
    least, most, size = entries.min(), entries.max(), _size(parameter)
    rounding = ROUNDING
    if _turns(parameter):
        # Turned directions are rounded anew, which a narrow lobe sees.
        rounding += 1e-7 / min(run.spread(run.probe.whole), 1)
    step = 0.01 * size if size > 0 else 0.01
    into = min(highest - most, 0) + max(lowest - least, 0)
    candidates = [(into, 1), (into, 0.1), (into, 0.01), (into + 10 * step, 1), (into - 10 * step, 1)]
    # At the end of a range, the derivative that leads an optimiser inwards need not be that of the values.
    inner = [each for each in candidates if lowest < least + each[0] and most + each[0] < highest]
    for shift, part_of in inner or candidates:
        parameter.set(original + shift)
        if shift:
            # At an index of refraction of 1, no reflection turns into total reflection: look beside it.
            derivatives = _derivatives(run, parameter, pairs)

        def at(by: float, shift: float = shift) -> Array:
            parameter.set(original + shift + _along(parameter, by))
            return run.probe.eval(run.probe.whole, pairs.wi, pairs.wo)

        # Plugins other than ours may clip: look beside such ends.
        found = differences(at, part_of * step, rounding, run.probe.is_ours or limits is not None)
        # Float32 must know the values to far less than a step.
        if np.spacing(np.float32(abs(entries + shift).max())) >= 0.01 * part_of * step:
            found.trusted[:] = False
        yield found, derivatives
        if found.trusted.mean() > 0.95:
            return


def _size(parameter: Parameter) -> float:
    """Return the mean size of the entries of a parameter."""
    size = float(abs(np.array(parameter.value, np.float64)).mean())
    return min(size, 1) if _turns(parameter) else size  # many turns are as few


def _turns(parameter: Parameter) -> bool:
    """Return whether a parameter is an angle of a whole turn."""
    for key, bsdf, _, name in declared(parameter.params):
        if key == parameter.key:
            ways = [way for each in nested(bsdf.model.declared()) for way in each.spellings]
            return any(it.turns and it.name == name for way in ways for it in way)
    return False


# --- What samplers and optimisers need ------------------------------------------------------------------------------


class OfWeights(NamedTuple):
    """The derivatives of what ``eval`` is not."""

    moved: Array
    """Those of twice the directions drawn,"""
    sampled: Array
    """of the weight of ``sample``,"""
    again: Array
    """of that of ``eval_pdf_sample``,"""
    quotient: Array
    """of ``eval_pdf``'s value over pdf, where both are differentiated,"""
    pair: Array
    """and where the value alone is."""


def _of_weights(run: Run, parameters: list[Parameter], wi: Array, u: Array) -> Iterator[OfWeights]:
    """Yield those for each parameter. Derivatives are taken for all of them, of which one grows, so that a single
    kernel serves each."""
    bsdf, whole, si = run.probe.bsdf, run.probe.whole, interaction(wi)
    with ExitStack() as stack:
        for each in parameters:
            stack.enter_context(each.restored())
        still = [_along(each, 0) for each in parameters]
        for k, growing in enumerate(parameters):
            attached = [each.attach() for each in parameters]
            bs, weight = bsdf.sample(whole.context, si, *sample_arguments(u), True)
            value, density = bsdf.eval_pdf(whole.context, si, dr.detach(bs.wo), True)
            *_, again = bsdf.eval_pdf_sample(whole.context, si, dr.detach(bs.wo), *sample_arguments(u), True)
            # Only ends of the graph keep a derivative, and the weight may depend on the direction.
            results = bs.wo * 2, weight, again, value / density, value / dr.detach(density)
            if dr.grad_enabled(results):
                _forward(attached, [*still[:k], _along(growing), *still[k + 1 :]])
            yield OfWeights(*all_numbers(map(dr.grad, results), len(wi)))


def _check_weight(run: Run, outcome: Outcome, of_weights: OfWeights, expected: Array) -> None:
    """Check the derivatives of ``eval_pdf``'s value and of the weights of ``sample`` and ``eval_pdf_sample``, where
    that of ``eval`` over pdf is ``expected``."""
    weights = {"sample's weight": of_weights.sampled, "eval_pdf_sample's weight": of_weights.again}
    for name, values in weights.items():
        if not np.isfinite(values).all():
            lost = 1 - np.isfinite(values).mean()
            outcome.fault(f"{lost:.1%} of the derivatives of {name} are not finite", np.inf)
    size = abs(expected).mean()
    if not size > DARK:
        return
    # Plugins other than ours may differentiate their density, too.
    accepted = [expected] if run.probe.is_ours else [expected, np.nan_to_num(of_weights.quotient)]
    compared = [("eval_pdf's value over pdf", of_weights.pair, [expected])]
    if not of_weights.moved.any():
        compared += [(name, values, accepted) for name, values in weights.items()]
    for name, values, right in compared:
        error = min(abs(np.nan_to_num(values) - each).mean() for each in right)
        if error > TOLERANCE * size:
            sizes = f"average {abs(values).mean():.3g} in size, but those of eval over pdf {size:.3g}"
            outcome.fault(f"the derivatives of {name} {sizes}, and differ by {error / size:.0%}", error / size)


def _check_ways_back(run: Run, outcome: Outcome, parameter: Parameter, limits: Range, pairs: Pairs) -> None:
    """Check that an optimiser returns from values that are a step beyond either limit."""
    # At grazing angles the derivatives of a reflectance grow without bound as an index goes to 1.
    few = Pairs(*(each[:500] for each in pairs.steep(0.2)))
    for limit, outwards in zip(limits, (-1, 1), strict=True):
        if np.isfinite(limit):
            step = outwards * max(0.1 * min(np.ptp(limits), 1), 1e-3 * abs(limit))
            _check_way_back(run, outcome, parameter, limit, step, few)


def _check_way_back(run: Run, outcome: Outcome, parameter: Parameter, limit: float, step: float, pairs: Pairs) -> None:
    """Check that an optimiser returns from a value that is a step beyond a limit."""
    zero = parameter.value * 0  # of a number, a colour, or the texels of a bitmap
    least = 1e-6 * run.probe.eval(run.probe.whole, pairs.wi, pairs.wo).max()

    def backward(value: float, signs: tuple[int, ...] = (1,)) -> tuple[Array, list[Array]]:
        """Return the values there, and the derivatives of their sum with some signs."""
        parameter.set(zero + value)
        (attached, result), found = _attached(run, parameter, pairs), []
        for sign in signs:
            if dr.grad_enabled(result):
                dr.set_grad(attached, 0)
                dr.set_grad(result, dr.opaque(mi.Float, sign))
                dr.enqueue(dr.ADMode.Backward, result)
                dr.traverse(dr.ADMode.Backward, flags=dr.ADFlag.ClearInterior | dr.ADFlag.ClearInput)
            found.append(gradient(attached))
        return numbers(dr.detach(result), len(pairs.wi)), found

    beyond = limit + step
    start = f"at {beyond:g}, beyond its limit of {limit:g},"
    value, ways = backward(beyond, (1, -1))
    at_limit, _ = backward(limit, ())
    # Less is rounding, as where an index of refraction of 1 reflects nothing.
    error = relative(value, at_limit) * (abs(value - at_limit) > least)
    if error.max(initial=0) > 10 * run.rounding(run.probe.whole):
        outcome.fault(f"{start} eval is not that at the limit", error.max())
    outwards = max((float((found * -np.sign(step)).max()) for found in ways), default=0.0)
    if outwards > 0:
        outcome.fault(f"{start} a step against its derivative leads away", outwards)
    if any(found.any() for found in ways):
        return
    near, nearer = (backward(limit - 0.1 * share * step) for share in (0.1, 0.001))
    # Where another limit holds, the parameter has no influence.
    if (near[0] == at_limit).all():
        return
    # Towards the limit it may vanish, as at an index of refraction of 1, or grow, as where an edge becomes a jump. If
    # only rounding tells values apart, it is rounding of their sum.
    inside, last = (abs(found).sum() for _, (found,) in (near, nearer))
    if max(0.3 * inside, 1e-6 * max(len(pairs.wi), abs(value).sum())) < last < 3 * inside:
        words = f"those of the sum of eval and of its negative are 0, but just inside the limit it is {last:.3g}"
        outcome.fault(f"{start} no derivative leads back: {words}", np.inf)
