"""Checks of ``eval`` and ``pdf`` at given directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array
from ..probe.bsdf import CENTRE, BSDFProbe, Part, Samples
from ..probe.directions import direction, hemisphere, on_side
from ..probe.variates import random
from .incidents import SCATTERED
from .outcome import Outcome, Skipped, relative
from .run import SEED, Run, of_parts


def _pairs(part: Part) -> tuple[Array, Array]:
    """Return pairs of directions where formulas break: normal, grazing, mirrored, equal, opposite."""
    thetas = [0, 1e-3, 0.1, 30, 60, 80, 89, 89.9, 89.99, 89.9999]
    edge = np.array([direction(theta, phi) for theta in thetas for phi in (0, 30, 90, 180, 210)])
    wi, wo = (w.reshape(-1, 3) for w in np.broadcast_arrays(edge[:, None], edge[None]))
    generic = hemisphere(4000, 1), hemisphere(4000, 2)
    # A dot product of unit vectors may exceed 1 by a rounding error: of one exact mirror pair in four.
    exact = np.concatenate([edge, generic[0][:1000]])
    mirrored = exact * np.array([-1, -1, 1], np.float32)
    wi, wo = np.concatenate([wi, exact, generic[0]]), np.concatenate([wo, mirrored, generic[1]])
    sides = [(i, o) for i in part.sides for o in (1, -1)]
    wi, wo = (np.concatenate([on_side(w, side[which]) for side in sides]) for which, w in enumerate((wi, wo)))
    return wi, wo


def _bad(values: Array, signed: bool = False) -> Array:
    """Return which rows have values that are not finite or, unless they are ``signed``, negative."""
    good = np.isfinite(values) & (signed | (values >= 0))
    return np.logical_not(good.reshape(len(values), -1).all(axis=1))


@of_parts
def finite(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that values, densities and weights are finite and not negative: at normal incidence, at grazing and in the
    horizon, at the mirror direction, towards the light, and for samples with variates of 0 and just below 1. Channels
    of values and weights may be negative where the page of a model says so, of colours outside sRGB."""
    signed = any(model is not None and model.signed for model in run.probe.models)
    wi, wo = _pairs(part)
    # Rounding may put a direction into the horizon.
    flat = np.resize(np.array([[1, 0, 0], [-0.6, 0.8, 0]], np.float32), wi.shape)
    wi, wo = np.concatenate([wi, flat]), np.concatenate([wo, wo])
    for name, values in (("eval", run.probe.eval(part, wi, wo)), ("pdf", run.probe.pdf(part, wi, wo))):
        bad = _bad(values, signed and name == "eval")
        why = f"and {bad.mean():.1%} of the pairs tried are negative or not finite"
        outcome.wrong(bad, name, values, why, wi, wo)
    corners = np.array([0, 2**-24, 0.5, 1 - 2**-24], np.float32)
    u = np.stack(np.meshgrid(corners, corners, corners), axis=-1).reshape(-1, 3)
    u = np.concatenate([u, random(2000, 4)])
    for side in part.sides:
        for theta in (0, 1e-3, 30, 80, 89.9, 89.9999):
            w = on_side(direction(theta, 30), side)
            samples = run.probe.sample(part, w, u)
            length = np.linalg.norm(samples.wo.astype(np.float64), axis=1)
            bad = _bad(samples.weight, signed) | samples.lit & (_bad(samples.density) | ~(abs(length - 1) < 1e-3))
            if bad.any():
                k = int(np.argmax(bad))
                energy = f"the weight {_shown(samples.weight[k])}, the density {samples.density[k]:.4g}"
                way = f"the direction {samples.wo[k].tolist()}, of length {length[k]:.4g}"
                told = f"for light from {theta:g}° a sample has {energy} and {way}"
                outcome.fault(f"{told}, for the variates {u[k].tolist()}", bad.sum(), wi=w)
    outcome.remark = "Channels may be negative, as its page says." if signed else ""
    return f"{len(wi)} pairs of directions, down to the horizon."


def _shown(values: Array) -> str:
    """Return the first value that is negative or not finite, or else the first, in digits."""
    values = np.atleast_1d(values)
    return f"{next((v for v in values if not (np.isfinite(v) and v >= 0)), values[0]):.4g}"


@of_parts
def horizon(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that a component is zero on the side that its flags exclude, and so is its density; and it sends no samples
    there."""
    flags = mi.BSDFFlags
    wi, wo = _pairs(part)
    above = wi[:, 2] * wo[:, 2] > 0
    for flag, where, words in ((flags.Reflection, above, "above"), (flags.Transmission, ~above, "below")):
        if part.has(flag):
            continue
        why = f"{words} the horizon, where the flags allow nothing"
        _check_dark(run, outcome, part, wi[where], wo[where], why)
        for incident in run.views(part):
            samples = run.samples(part, incident)
            lost = samples.lit & ((samples.wo[:, 2] * incident.wi[..., 2] > 0) == (words == "above"))
            told = f"{why}, as of {lost.mean():.2%} of the samples"
            outcome.wrong(lost, "a sample's weight", samples.weight, told, incident.wi, samples.wo, seed=SEED)
    for side, words in (1, "the front"), (-1, "behind"):
        if side not in run.probe.whole.sides:
            wi, wo = (on_side(hemisphere(4000, seed), side) for seed in (2, 3))
            wo[::2, 2] *= -1
            why = f"but its flags say that it cannot be seen from {words}"
            _check_dark(run, outcome, part, wi, wo, why)
            samples = run.probe.sample(part, wi, random(4000, 4))
            weights = samples.weight * samples.smooth[:, None]
            outcome.wrong(weights != 0, "a sample's weight", weights, why, wi, samples.wo, seed=4)
    return "Nothing on the sides that the flags exclude."


def _check_dark(run: Run, outcome: Outcome, part: Part, wi: Array, wo: Array, why: str) -> None:
    """Check that values and densities of some pairs are zero; ``why`` follows what is not."""
    value, density = run.probe.eval(part, wi, wo), run.probe.pdf(part, wi, wo)
    outcome.wrong(value != 0, "eval", value, why, wi, wo)
    outcome.wrong(density != 0, "pdf", density, why, wi, wo)


@of_parts
def support(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that light can be sampled wherever there is some: pdf > 0 where eval > 0. Values below 1e-9 of the largest
    do not count."""
    tried = 0
    for incident in run.views(part):
        lanes = np.arange(SCATTERED) % 2 == 0
        own = hemisphere(SCATTERED, 3)
        own[:, 2] *= np.sign(incident.wi[..., 2])
        wo = np.where(lanes[:, None], own, run.samples(part, incident).wo)
        if part.has(mi.BSDFFlags.Transmission):
            wo = np.concatenate([wo, on_side(wo, -1)])
        wi = incident.at(np.arange(len(wo)) % SCATTERED)
        value = np.nan_to_num(run.probe.eval(part, wi, wo).max(axis=1))
        pdf = run.probe.pdf(part, wi, wo)
        missed = np.where((value > 1e-9 * value.max()) & ~(pdf > 0), value, 0)
        tried += len(wo)
        outcome.wrong(missed, "eval", value, "but pdf is not above 0: this light is never sampled", wi, wo)
    return f"pdf > 0 where eval > 0, in {tried} directions."


@of_parts
def eval_pdf(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that ``eval_pdf`` says what ``eval`` and ``pdf`` say, and ``eval_pdf_sample`` what they and ``sample`` say,
    to float32's rounding: some plugins compute a shared term differently."""
    tolerance, worst = run.rounding(part), 0.0
    for incident in run.views(part):
        lanes = np.arange(0, SCATTERED, 8)
        wi, u = incident.at(lanes), random(len(lanes), 6)
        samples = run.probe.sample(part, wi, u)
        wo = np.where(np.arange(len(u))[:, None] % 2, samples.wo, hemisphere(len(u), 7)).astype(np.float32)
        wo[::4, 2] *= -1  # where nothing is, the sample must still be drawn
        worst = max(worst, compare_joint(run.probe, part, outcome, tolerance, wi, wo, u, samples, seed=6, digits=6))
    return f"eval_pdf and eval_pdf_sample agree with the others to {worst:.1g}."


def compare_joint(
    probe: BSDFProbe, part: Part, outcome: Outcome, tolerance: float, wi: Array, wo: Array, u: Array, samples: Samples,
    *, when: str = "", uv: Array | None = None, **how: Any,
) -> float:  # fmt: skip
    """Compare what ``eval_pdf`` and ``eval_pdf_sample`` say with ``eval``, ``pdf`` and the samples of the variates
    ``u``, at the centre of textures or at ``uv``, as :meth:`.Outcome.differing` does; return the largest error."""
    at, drawn = CENTRE if uv is None else uv, samples.drawn
    value, density = probe.eval(part, wi, wo, at), probe.pdf(part, wi, wo, at)
    pair, triple = probe.eval_pdf(part, wi, wo, at), probe.eval_pdf_sample(part, wi, wo, u, at)
    rows = (
        ("eval_pdf", "eval", pair[0], value, None),
        ("eval_pdf", "pdf", pair[1], density, None),
        ("eval_pdf_sample", "eval", triple[0], value, None),
        ("eval_pdf_sample", "pdf", triple[1], density, None),
        ("eval_pdf_sample", "sample's density", triple[3], samples.density, drawn),
        ("eval_pdf_sample", "sample's weight", triple[4], samples.weight, None),
        ("eval_pdf_sample", "sample's direction", triple[2] + 2.0, samples.wo + 2.0, drawn),
    )
    errors = []
    for name, of, got, expected, which in rows:
        name = f"{when}{of} of {name}"
        errors.append(outcome.differing(tolerance, name, got, expected, f"by {of}", wi, wo, where=which, uv=uv, **how))
    return max(errors)


@of_parts
def reciprocity(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that f(wi, wo) = f(wo, wi), unless the component is flagged NonSymmetric: at generic pairs, and at pairs
    that the sampler draws, where narrow lobes are."""
    if part.has(mi.BSDFFlags.NonSymmetric) or not part.passages:
        raise Skipped(f"Not checked, as {'it is flagged NonSymmetric' if part.passages else 'no light goes back'}.")
    tolerance, worst = 10 * run.rounding(part), 0.0
    for sides in part.passages:
        wi, wo = run.probe.pairs(part, 8000, 8, sides)
        forth = run.probe.eval(part, wi, wo) * abs(wi[:, 2:].astype(np.float64))
        back = run.probe.eval(part, wo, wi) * abs(wo[:, 2:].astype(np.float64))
        error = outcome.differing(
            tolerance, F, forth, back, "from there back", wi, wo, floor=1e-6, unknown=0, but_for=1e-3
        )
        worst = max(worst, error)
    return f"f(wi, wo) = f(wo, wi) to {worst:.1g}, within {tolerance:.1g}."


F = "f, times both cosines,"
STEP = 5e-4
"""The distance, in radians, over which ``continuity`` looks for jumps: the cosine of a smaller one is 1 in float32."""
OCTAVES = 32, 16, 8, 4, 2, 1, 0.5
"""The heights above the horizon that it looks at, in such steps; how values change from the first to the second is only
compared with."""

HALVINGS = 14
"""How often it halves a way on which values change, to see whether they jump there."""


@of_parts
def continuity(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that values do not jump where formulas treat directions apart: at exactly normal incidence and reflection,
    and where azimuths are measured from and start again. There eval is the mean of what it is 0.03° to both sides (or,
    of narrow lobes, a twentieth of their width), to float32's rounding and for all but one pair in a hundred; or it
    comes nearer to that the smaller the angle is; or it jumps as much at other directions, as patterns do (values of
    measured data may jump between nodes, and are judged at grazing only). And as the height above the horizon halves,
    from 0.5° to 0.01°, eval does not change by more than a fifth power does, unless it does so before and after, too.
    """
    worst = 0.0
    for side in part.sides:
        if not run.probe.is_data:
            worst = max(worst, _check_crossings(run, outcome, part, side))
        for phi in (0, 77):
            _check_grazing(run, outcome, part, side, phi)
    return f"No jumps at normal and grazing directions or where azimuths begin, but for {worst:.1g}."


def _check_crossings(run: Run, outcome: Outcome, part: Part, side: int) -> float:
    """Check that values do not jump at normal incidence and where azimuths begin, but for jumps that are no larger than
    at other directions, of which it tells; return by how much they do."""
    worst, tolerance = 0.0, 10 * run.rounding(part)
    elsewhere = cache(partial(_jump_elsewhere, run, part, side))
    for where, directions in _crossings(np.degrees(min(STEP, run.spread(part) / 20))):
        crossing = [on_side(w, side) for w in directions]
        others = _companions(run, part, crossing[0])
        for word, (at, *around) in _both_ways(run, part, crossing, others):
            mean, farther = (around[0] + around[1]) / 2, (around[2] + around[3]) / 2
            jump = np.where(abs(at - mean) > 0.5 * abs(at - farther), relative(mean, at, 1e-6, unknown=0), 0)
            typical = float(np.quantile(jump, 0.99))
            if tolerance < typical <= elsewhere():
                outcome.remark = f"At other directions it jumps, too, by {elsewhere():.1g}."
                continue
            worst = max(worst, typical)
            if typical > tolerance:
                wi, wo = (crossing[0], others)[:: 1 if word == "from" else -1]
                name = f"eval jumps at light {word} {where}: it"
                outcome.wrong(jump, name, at, "around that", wi, wo, expected=mean)
    return worst


def _jump_elsewhere(run: Run, part: Part, side: int) -> float:
    """Return by how much values jump, at least, on one in a hundred of the ways from a pair of directions to another:
    over no distance, whether the azimuths on the way start again at 180° or at 0."""
    found, count = np.inf, 1000
    for begin in (-180, 0):
        low = np.array([0, begin, 0, begin])[:, None]
        start, end = np.random.default_rng(24).uniform(low, low + np.array([80, 360] * 2)[:, None], (2, 4, count))

        def values(t: Array, start: Array = start, end: Array = end) -> Array:
            theta_i, phi_i, theta_o, phi_o = start + t * (end - start)
            pair = direction(theta_i, phi_i), direction(theta_o, phi_o)
            return run.probe.eval(part, *(on_side(w.T, side) for w in pair)).max(axis=1)

        t = np.linspace(0, np.ones(count), 33)
        f = np.stack([values(it) for it in t])
        largest, lanes = abs(np.diff(f, axis=0)).argmax(axis=0), np.arange(count)
        ways, ends = ((it[largest, lanes], it[largest + 1, lanes]) for it in (t, f))
        f0, f1, changes = _narrowed(values, *ways, *ends)
        jump = np.where(changes[-1] > 0.5 * changes[-4], relative(f0, f1, 1e-6, unknown=0), 0)
        found = min(found, float(np.quantile(jump, 0.99)))
    return found


def _narrowed(
    values: Callable[[Array], Array], t0: Array, t1: Array, f0: Array, f1: Array
) -> tuple[Array, Array, list[Array]]:
    """Return the values at the ends of ways after the last of some halvings, each time to where they change more, and
    the changes after each."""
    changes = []
    for _ in range(HALVINGS):
        middle = (t0 + t1) / 2
        value = values(middle)
        first = abs(value - f0) > abs(f1 - value)
        t0, t1 = np.where(first, t0, middle), np.where(first, middle, t1)
        f0, f1 = np.where(first, f0, value), np.where(first, value, f1)
        changes.append(abs(f1 - f0))
    return f0, f1, changes


def _changes(values: Array) -> Array:
    """Return the logarithms of the factors by which values change from each row to the next."""
    high, low = np.maximum(values[:-1], values[1:]), np.minimum(values[:-1], values[1:])
    return np.log(np.maximum(high, 1e-38) / np.maximum(low, 1e-38))


def _check_grazing(run: Run, outcome: Outcome, part: Part, side: int, phi: float) -> None:
    """Check that values change no more while the height above the horizon halves than while it halves before and after,
    as a power of the height does, unless they fade away there. Of the pairs, as many may jump as there are hard edges
    in a STEP elsewhere, and three by chance."""
    step = np.degrees(STEP)
    # Far above the horizon only hard edges jump, the more often the farther apart two heights are.
    grazing = 90 - step * np.array(OCTAVES)
    angles = [70 - step * (OCTAVES[0] - 1), 70 + step, *grazing]
    heights = [on_side(direction(angle, phi), side) for angle in angles]
    others = on_side(hemisphere(1000, 23), side)
    for word, both in _both_ways(run, part, heights, others):
        far, change = _changes(np.nan_to_num(both[:2])), _changes(values := np.nan_to_num(both[2:]))
        usual = 2 * (far > np.log(32)).sum() / OCTAVES[0] * -np.diff(OCTAVES)
        lit = np.maximum(values[:-1], values[1:]) > 1e-2 * values.max()  # a soft edge may end between two heights
        beside = np.pad(change, ((1, 1), (0, 0)))
        jump = lit & (change > np.log(32)) & (change > 4.5 * np.maximum(beside[:-2], beside[2:]))
        jump[0] = False  # a highlight may end there: without what lies above, a slope is no jump
        order, usual = (1 if word == "from" else -1), usual + np.maximum(0.01 * lit.sum(axis=1), 3)
        if (jump.sum(axis=1) > usual).any():
            upper, k = np.nonzero(jump)

            def between(theta: Array, wo: Array = others[k], order: int = order) -> Array:
                wi = on_side(direction(theta, np.full(len(theta), phi)).T, side)
                return run.probe.eval(part, *(wi, wo)[::order]).max(axis=1)

            ends = values[upper, k], values[upper + 1, k]
            f0, f1, _ = _narrowed(between, grazing[upper], grazing[upper + 1], *ends)
            jump[upper, k] = abs(f1 - f0) > np.maximum(*ends) / 32
        if (jump.sum(axis=1) > usual).any():
            octave, pair = np.unravel_index(int(np.argmax(np.where(jump, change, 0))), jump.shape)
            factor, (high, low) = float(np.exp(change[octave, pair])), 90 - grazing[octave : octave + 2]
            wi, wo = (heights[2 + octave], others[pair])[::order]
            told = f"for light {word} {high:.3g}° to {low:.3g}° above the horizon"
            outcome.fault(f"eval jumps by the factor {factor:.3g} {told}", factor, wi=wi, wo=wo)


def _crossings(step: float) -> Iterator[tuple[str, list[Array]]]:
    """Yield ``(name, directions)``: one where formulas may break, with neighbours on both sides, near and farther."""
    turns = 0, -step, step, -4 * step, 4 * step
    for phi in (0, 90, 135):
        yield "the normal", [direction(turn, phi) for turn in turns]
    for phi in (0, 90, 180, 270):
        yield f"θ = 50°, φ = {phi}°", [direction(50, phi + turn) for turn in turns]


def _companions(run: Run, part: Part, wi: Array) -> Array:
    """Return directions to pair one of incidence with: uniform ones, and as they are drawn."""
    side = np.sign(wi[2])
    drawn = run.probe.sample(part, wi, random(2000, 21)).wo
    return np.concatenate([on_side(hemisphere(2000, 22), side), drawn[drawn[:, 2] * side > 0.01]])


def _both_ways(run: Run, part: Part, directions: list[Array], others: Array) -> Iterator[tuple[str, Array]]:
    """Yield the values for light from each of some directions towards others, and from the others towards each."""

    def values(wi: Array, wo: Array) -> Array:
        pairs = (w.reshape(-1, 3) for w in np.broadcast_arrays(wi, wo))
        return run.probe.eval(part, *pairs).max(axis=1).reshape(len(directions), len(others))

    yield "from", values(np.stack(directions)[:, None], others)
    yield "towards", values(others, np.stack(directions)[:, None])
