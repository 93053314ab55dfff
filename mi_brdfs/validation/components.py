"""Checks of how the components of a BSDF fit together, and of their flags."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, context, interaction, numbers, vectors
from ..probe.bsdf import Part, Samples
from ..probe.directions import direction, hemisphere, on_side
from ..probe.variates import random
from .incidents import SCATTERED, Incident
from .outcome import Findings, Outcome, relative
from .pairs import DARK
from .run import SEED, Run, of_each

COUNT = 4000


def components(run: Run) -> Findings:
    """Check that the components add up to the whole, whose density is a mixture of theirs; ``sampled_component`` and
    ``sampled_type`` lie within what was asked for and drawn, ``eta`` is 1 for light that stays on its side, what a
    context excludes is black, and a type mask of one bit or several lets through the components of these types, drawn
    as ``pdf`` says."""
    probe = run.probe
    for part in probe.parts:
        outcome = Outcome("components", part.name)
        for incident in run.views(part):
            _check_sampled(run, outcome, part, incident)
        if part.component is None:
            _check_sum(run, outcome)
            _check_there_and_back(run, outcome, part)
        yield outcome.finding("Sums, sampled components and types are as asked for.")
    for part in probe.components:
        outcome = Outcome("components", f"{part.name} masked out")
        check_masks(run, outcome, part)
        yield outcome.finding("Black where the context excludes it.")


def _check_sampled(run: Run, outcome: Outcome, part: Part, incident: Incident) -> None:
    """Check that sampled components and types are those that were asked for, and those that were drawn."""
    samples = run.samples(part, incident)
    index, kind = (np.where(samples.lit, each, -1).astype(np.int64) for each in (samples.component, samples.kind))
    allowed = {each.component: each for each in ([part] if part.component is not None else run.probe.components)}
    for k in np.unique(index[samples.lit]):
        own = index == k
        if k in allowed:
            wrong = own & ((kind & ~allowed[k].flags != 0) | (kind == 0))
            told = f"type is {kind[wrong.argmax()]:#x} for {allowed[k].name}, whose flags are {allowed[k].flags:#x}"
        else:
            wrong, share = own, own.sum() / samples.lit.sum()
            told = f"component is {k} in {share:.1%} of the samples, where only {', '.join(map(str, allowed))} may be"
        if wrong.any():
            told = f"for light from {incident.name} sampled_{told}"
            outcome.fault(told, wi=incident.at(int(wrong.argmax())), seed=SEED)
    check_eta(outcome, incident, samples, samples.lit)
    if len(allowed) > 1 and samples.lit.any():
        _check_drawn(run, outcome, incident, samples)


def check_eta(outcome: Outcome, incident: Incident, samples: Samples, lit: Array) -> None:
    """Check that light that stays on its side stays in its medium."""
    stays = lit & (samples.wo[:, 2] * incident.wi[..., 2] > 0)
    for wrong, needed in (
        (stays & (samples.eta != 1), "1 as the light stays on its side"),
        (lit & ~(np.isfinite(samples.eta) & (samples.eta > 0)), "above 0"),
    ):
        why = f"but must be {needed}; {wrong.sum() / max(lit.sum(), 1):.1%} of the samples are wrong"
        outcome.wrong(wrong, "a sample's eta", samples.eta, why, incident.wi, samples.wo, seed=SEED)


def _check_drawn(run: Run, outcome: Outcome, incident: Incident, samples: Samples) -> None:
    """Check that the samples said to be those of a component lie where it can send one, and that where only one can,
    its share of the samples is that of its density in the mixture's."""
    lit = np.flatnonzero(samples.lit)
    wi, wo = incident.at(lit), samples.wo[lit]
    densities = [run.probe.pdf(part, wi, wo) for part in run.probe.components]
    for part, own in zip(run.probe.components, densities, strict=True):
        said = samples.component[lit] == part.component
        stray, alone = said & (own <= 0), (own > 1e3 * (sum(densities) - own)) & (own > 0)
        start = f"for light from {incident.name}"
        if stray.sum() > 1e-3 * said.sum():
            share = stray.sum() / said.sum()
            told = f"{start} {share:.1%} of the samples said to be those of {part.name} lie where it draws none"
            outcome.fault(told, share, wi=incident.at(int(lit[stray][0])), seed=SEED)
        if alone.sum() >= 200 and said[alone].mean() < 0.9:
            share = said[alone].mean()
            told = f"{start} only {share:.1%} of the samples where nothing but {part.name} draws any are said to be its"
            outcome.fault(f"{told} own", 1 - share, wi=incident.at(int(lit[alone][0])), seed=SEED)


def _check_there_and_back(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that the relative index of refraction is the reciprocal of that of the other way."""
    if len(part.sides) < 2 or not part.has(mi.BSDFFlags.Transmission):
        return
    found, wi = [], direction(20, 10)
    for side in part.sides:
        samples = run.probe.sample(part, on_side(wi, side), random(COUNT, 6))
        through = samples.lit & (samples.wo[:, 2] * side < 0)
        found.append(float(np.median(samples.eta[through])) if through.any() else 1.0)
    if not abs(found[0] * found[1] - 1) < 1e-3:
        told = f"eta is {found[0]:.4g} for light that passes from the front, but {found[1]:.4g} for light from behind"
        outcome.fault(f"{told}, which must be its reciprocal", np.inf, wi=wi, seed=6)


def _check_sum(run: Run, outcome: Outcome) -> None:
    """Check that the components add up to the whole, and that its density is a mixture of theirs."""
    probe, tolerance = run.probe, 10 * run.rounding(run.probe.whole)
    flags = np.bitwise_or.reduce([int(probe.bsdf.flags(k)) for k in range(probe.bsdf.component_count())])
    if int(probe.bsdf.flags()) != flags:
        outcome.fault(f"flags() is {int(probe.bsdf.flags()):#x}, but those of the components make {flags:#x}", np.inf)
    for incident in run.views(probe.whole):
        lanes = np.arange(0, SCATTERED, SCATTERED // COUNT)
        wo = np.concatenate([on_side(hemisphere(len(lanes), 1), side) for side in (1, -1)])
        wo = np.concatenate([wo, run.samples(probe.whole, incident).wo[lanes]])
        lanes = np.tile(lanes, 3)
        wi = incident.at(lanes)
        whole, density = probe.eval_pdf(probe.whole, wi, wo)
        values, pdfs = zip(*(probe.eval_pdf(part, wi, wo) for part in probe.components), strict=True)
        why = "is what the components add up to"
        outcome.differing(tolerance, "eval", whole, sum(values), why, wi, wo, floor=1e-6, unknown=0)
        # Delta functions take a share of the samples.
        mixed = np.clip(density, 0 if probe.deltas else np.min(pdfs, axis=0), np.max(pdfs, axis=0))
        why = "is the nearest that a mixture of the components' can be"
        outcome.differing(tolerance, "pdf", density, mixed, why, wi, wo, unknown=0)


def check_masks(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that what a context excludes is black, and that the rest is there."""
    probe, wi = run.probe, on_side(direction(30, 20), part.sides[0])
    wo = np.concatenate([hemisphere(COUNT, 1), on_side(hemisphere(COUNT, 2), -1)])
    every = int(mi.BSDFFlags.All)
    kind = part.flags & every
    for words, excluding in (
        ("a type mask that leaves it out", context(part.component, every & ~kind)),
        ("a component that does not exist", context(probe.bsdf.component_count() + 7)),
    ):
        nothing = part._replace(context=excluding)
        value, density = probe.eval_pdf(nothing, wi, wo)
        samples = probe.sample(nothing, wi, random(COUNT, 3))
        why = f"with {words}, where all must be black: active &= ctx.is_enabled(type, {part.component})"
        outcome.wrong(value != 0, "eval", value, why, wi, wo)
        outcome.wrong(density != 0, "pdf", density, why, wi, wo)
        outcome.wrong(samples.weight != 0, "a sample's weight", samples.weight, why, wi, samples.wo, seed=3)
    tolerance = 10 * run.rounding(probe.whole)
    kinds = [int(probe.bsdf.flags(k)) & every for k in range(probe.bsdf.component_count())]
    absent = every & ~np.bitwise_or.reduce(kinds)
    alone = [(each.flags & every, probe.eval(each, wi, wo)) for each in probe.components]
    for mask in (kind, kind | int(absent), every & ~kind):
        if any(it & mask not in (0, it) for it in kinds):
            continue  # of a component in part
        chosen = part._replace(context=context(mask=mask))
        value = probe.eval(chosen, wi, wo)
        expected = sum((of for it, of in alone if it & mask), np.zeros(value.shape))
        name, why = f"with the type mask {mask:#x} eval", "is what the components of these types make"
        outcome.differing(tolerance, name, value, expected, why, wi, wo, floor=1)
        samples = probe.sample(chosen, wi, random(COUNT, 13))
        name, why = f"with the type mask {mask:#x} pdf", "is the density that sample states"
        pair = samples.pdf, samples.density
        outcome.differing(tolerance, name, *pair, why, wi, samples.wo, unknown=0, where=samples.lit, seed=13)


@of_each(lambda probe: probe.components)
def flags(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that a component's flags fit its behaviour. One that gathers half of its light within 10° of the mirror
    direction is not diffuse, one whose f or density changes as the frame turns about the normal is anisotropic,
    one that is for reflection and transmission does both, and one that the differentials of uv change needs them."""
    probe, kinds = run.probe, mi.BSDFFlags
    if not part.has(kinds.FrontSide) and not part.has(kinds.BackSide):
        outcome.fault("neither FrontSide nor BackSide is flagged, so that it is seen from nowhere")
    if part.has(kinds.Diffuse):
        for theta in (30, 60):
            wi = on_side(direction(theta), part.sides[0])
            samples = probe.sample(part, wi, random(COUNT, 2))
            wo = samples.wo[samples.drawn].astype(np.float64)
            sign = 1 if part.has(kinds.Reflection) else -1
            near = wo @ (wi * [-1, -1, sign]) > np.cos(np.radians(10)) if len(wo) else np.zeros(1)
            if near.mean() > 0.5:
                told = "of the samples lie within 10° of the mirror direction, but it is flagged diffuse"
                outcome.fault(f"for light from {theta}° {near.mean():.0%} {told}", near.mean(), wi=wi, seed=2)
    if part.has(kinds.Reflection) and part.has(kinds.Transmission):
        _check_both_ways(run, outcome, part)
    if not part.has(kinds.Anisotropic) and not part.has(kinds.SpatiallyVarying):
        _check_turned(run, outcome, part)
    if not probe.bsdf.needs_differentials():
        _check_differentials(run, outcome, part)
    return "They fit what it does."


def _check_both_ways(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that a component that is flagged for both sends light to both sides."""
    wi, wo = (on_side(hemisphere(COUNT, seed), part.sides[0]) for seed in (6, 7))
    lit = [run.probe.eval(part, wi, on_side(wo, side)).any() for side in (1, -1)]
    if lit[0] != lit[1]:
        does, lacks = ("reflects", "transmits") if lit[0] else ("transmits", "reflects")
        outcome.fault(f"it is flagged for reflection and transmission, but {does} and never {lacks}")


def _check_turned(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that f and the density are the same, but for one pair in a hundred, where both directions turn about the
    normal by any angle."""
    wi = on_side(hemisphere(COUNT, 8, 0.2), part.sides[0])
    samples = run.probe.sample(part, wi, random(COUNT, 5))
    wo, compared = samples.wo, {"pdf": run.probe.pdf}
    if samples.weight.mean() > DARK:
        compared["f"] = run.probe.eval
    both = turned(wi), turned(wo)
    for name, method in compared.items():
        before, after = (method(part, *pair).reshape(COUNT, -1).max(axis=1) for pair in ((wi, wo), both))
        lit = np.maximum(before, after) > 0
        change = relative(after, before, 1e-6, unknown=0) * lit
        difference = float(np.quantile(change[lit], 0.99)) if lit.any() else 0.0
        if difference > 100 * run.rounding(part):
            k = int(np.argmax(change))
            told = f"{name} changes by up to {difference:.1%} as both directions turn about the normal"
            outcome.fault(f"{told}, but it is not flagged anisotropic", difference, wi=wi[k], wo=wo[k])


def turned(w: Array) -> Array:
    """Return directions, each turned about the normal by an angle of its own."""
    angle = 2 * np.pi * np.random.default_rng(9).random(len(w))
    (x, y, z), cos, sin = w.T.astype(np.float64), np.cos(angle), np.sin(angle)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1).astype(np.float32)


def _check_differentials(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that f does not change with the differentials of uv, which nobody computes unless flags ask for them."""
    wi, wo = run.probe.pairs(part, COUNT, 10)
    si = interaction(wi)
    si.duv_dx, si.duv_dy = mi.Vector2f(0.3, 0.1), mi.Vector2f(-0.1, 0.2)
    value = numbers(run.probe.bsdf.eval(part.context, si, vectors(wo), True), COUNT)
    without = run.probe.eval(part, wi, wo)
    name, why = "with differentials of uv eval", "without them, but it is not flagged NeedsDifferentials"
    outcome.differing(10 * run.rounding(part), name, value, without, why, wi, wo)
