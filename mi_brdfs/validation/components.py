"""Checks of how the components of a BSDF fit together, and of their flags."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, context
from ..probe.bsdf import Part, Samples
from ..probe.directions import angles_of, direction, hemisphere, on_side
from ..probe.variates import random
from .incidents import SCATTERED, Incident
from .outcome import Findings, Outcome
from .run import SEED, Run

COUNT = 4000


def components(run: Run) -> Findings:
    """Check that the components add up to the whole, whose density is a mixture of theirs; ``sampled_component`` and
    ``sampled_type`` lie within what was asked for and drawn, ``eta`` is 1 for light that stays on its side, and what a
    context excludes is black."""
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
        _check_masks(run, outcome, part)
        yield outcome.finding("Black where the context excludes it.")


def _check_sampled(run: Run, outcome: Outcome, part: Part, incident: Incident) -> None:
    """Check that sampled components and types are those that were asked for, and those that were drawn."""
    samples = run.samples(part, incident)
    chosen = samples.lit
    if not chosen.any():
        return
    index, kind = samples.component[chosen].astype(np.int64), samples.kind[chosen].astype(np.int64)
    allowed = {each.component: each.flags for each in run.probe.components}
    if part.component is not None:
        allowed = {part.component: part.flags}

    def first(which: Array) -> Array:
        return incident.vector(np.flatnonzero(chosen)[int(np.argmax(which))])

    for k in np.unique(index):
        if k not in allowed:
            outcome.fault(
                f"for light from {incident.name} sampled_component is {k} in {(index == k).mean():.1%} of the samples, "
                f"where only {', '.join(map(str, allowed))} may be drawn",
                wi=first(index == k),
                seed=SEED,
            )
            continue
        wrong = (kind[index == k] & ~allowed[k] != 0) | (kind[index == k] == 0)
        if wrong.any():
            outcome.fault(
                f"for light from {incident.name} sampled_type is {kind[index == k][wrong][0]:#x} for "
                f"{run.probe.name_of(int(k))}, whose flags are {allowed[k]:#x}",
                wi=first(index == k),
                seed=SEED,
            )
    _check_eta(outcome, incident, samples)
    if part.component is None and len(allowed) > 1:
        # A sample of a component must lie where that component can send one.
        for each in run.probe.components:
            drawn = np.flatnonzero(chosen)[index == each.component]
            if len(drawn):
                wo = np.ascontiguousarray(samples.wo[drawn])
                stray = (run.probe.pdf(each, incident.at(drawn), wo) <= 0).mean()
                if stray > 1e-3:
                    outcome.fault(
                        f"for light from {incident.name} {stray:.1%} of the samples said to be those of {each.name} "
                        "lie where it draws none",
                        stray,
                        wi=incident.vector(int(drawn[0])),
                        seed=SEED,
                    )
                _check_share(run, outcome, incident, each, samples, drawn)


def _check_eta(outcome: Outcome, incident: Incident, samples: Samples) -> None:
    """Check that light that stays on its side stays in its medium."""
    stays = samples.lit & (samples.wo[:, 2] * incident.wi[..., 2] > 0)
    wrong = (stays & (samples.eta != 1)) | samples.lit & ~(np.isfinite(samples.eta) & (samples.eta > 0))
    if wrong.any():
        k = int(np.argmax(wrong))
        needed = "it must be 1 as the light stays on its side" if stays[k] else "it must be above 0"
        outcome.fault(
            f"for light from {incident.of(k)} a sample towards {angles_of(samples.wo[k])} has the eta "
            f"{samples.eta[k]:.4g}, but {needed}; {wrong.sum() / samples.lit.sum():.1%} of them are wrong",
            np.inf,
            wi=incident.vector(k),
            wo=samples.wo[k],
            seed=SEED,
        )


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
        outcome.fault(
            f"eta is {found[0]:.4g} for light that passes from the front, but {found[1]:.4g} for light from behind, "
            "which must be its reciprocal",
            np.inf,
            wi=wi,
            seed=6,
        )


def _check_share(run: Run, outcome: Outcome, incident: Incident, each: Part, samples: Samples, drawn: Array) -> None:
    """Check that where only one component can be, its share of the samples is that of its density in the mixture's."""
    others = [other for other in run.probe.components if other is not each]
    kept = samples.lit
    wi, wo = incident.at(kept), np.ascontiguousarray(samples.wo[kept])
    own = run.probe.pdf(each, wi, wo)
    rest = sum(run.probe.pdf(other, wi, wo) for other in others)
    alone = (own > 1e3 * rest) & (own > 0)
    if alone.sum() < 200:
        return
    said = np.isin(np.flatnonzero(kept)[alone], drawn).mean()
    if said < 0.9:
        outcome.fault(
            f"for light from {incident.name} only {said:.1%} of the samples where nothing but {each.name} draws any "
            "are said to be its own",
            1 - said,
            wi=incident.vector(int(np.flatnonzero(kept)[alone][0])),
            seed=SEED,
        )


def _check_sum(run: Run, outcome: Outcome) -> None:
    """Check that the components add up to the whole, and that its density is a mixture of theirs."""
    probe, tolerance = run.probe, 10 * run.rounding(run.probe.whole)
    flags = 0
    for k in range(probe.bsdf.component_count()):
        flags |= int(probe.bsdf.flags(k))
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
        total = sum(values)
        scale = np.maximum(np.maximum(whole, total), 1e-6 * np.max(total) + 1e-12)
        error = np.nan_to_num(abs(whole - total) / scale).max(axis=1)
        if error.max() > tolerance:
            k = int(np.argmax(error))
            outcome.fault(
                f"for light from {incident.of(lanes[k])} eval is {whole[k].max():.4g} towards {angles_of(wo[k])}, but "
                f"the components add up to {total[k].max():.4g}",
                error[k],
                wi=incident.vector(lanes[k]),
                wo=wo[k],
            )
        low, high = np.min(pdfs, axis=0), np.max(pdfs, axis=0)
        if probe.deltas:
            low = np.zeros_like(low)  # they take a share of the samples
        beyond = np.maximum(density - high, low - density) / np.maximum(np.maximum(density, high), 1e-9)
        beyond = np.nan_to_num(beyond)
        if beyond.max() > tolerance:
            k = int(np.argmax(beyond))
            outcome.fault(
                f"for light from {incident.of(lanes[k])} pdf is {density[k]:.4g} towards {angles_of(wo[k])}, but a "
                f"mixture of the components' lies between {low[k]:.4g} and {high[k]:.4g}",
                beyond[k],
                wi=incident.vector(lanes[k]),
                wo=wo[k],
            )


def _check_masks(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that what a context excludes is black, and that the rest is there."""
    probe, wi = run.probe, on_side(direction(30, 20), part.sides[0])
    wo = np.concatenate([hemisphere(COUNT, 1), on_side(hemisphere(COUNT, 2), -1)])
    every = int(mi.BSDFFlags.All)
    kind = part.flags & every
    for words, excluding in (
        (f"{part.name} of a type mask without its type", context(part.component, every & ~kind)),
        ("a component that does not exist", context(probe.bsdf.component_count() + 7)),
    ):
        nothing = part._replace(context=excluding)
        value, density = probe.eval_pdf(nothing, wi, wo)
        samples = probe.sample(nothing, wi, random(COUNT, 3))
        for name, number in (("eval", value), ("pdf", density), ("sample's weight", samples.weight)):
            if number.any():
                outcome.fault(
                    f"{name} reaches {number.max():.4g} for {words}, where all must be black",
                    number.max(),
                    wi=wi,
                    seed=3,
                )
    alone = [each for each in probe.components if each.flags & kind]
    selected = part._replace(context=context(mask=kind))
    value, expected = probe.eval(selected, wi, wo), np.sum([probe.eval(each, wi, wo) for each in alone], axis=0)
    error = abs(value - expected).max() / max(expected.max(), 1e-12)
    if error > 10 * run.rounding(probe.whole):
        k = int(np.argmax(abs(value - expected).max(axis=1)))
        outcome.fault(
            f"with the type mask {kind:#x} eval is {value[k].max():.4g} towards {angles_of(wo[k])}, but the components "
            f"of this type make {expected[k].max():.4g}",
            error,
            wi=wi,
            wo=wo[k],
        )


def flags(run: Run) -> Findings:
    """Check that a component's flags fit its behaviour. One that gathers half of its light within 10° of the mirror
    direction is not diffuse, one that changes as the frame turns about the normal is anisotropic, and one that is for
    reflection and transmission does both."""
    probe, kinds = run.probe, mi.BSDFFlags
    for part in probe.components:
        outcome = Outcome("flags", part.name)
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
                    outcome.fault(
                        f"for light from {theta}° {near.mean():.0%} of the samples lie within 10° of the mirror "
                        "direction, but it is flagged diffuse",
                        near.mean(),
                        wi=wi,
                        seed=2,
                    )
        if part.has(kinds.Reflection) and part.has(kinds.Transmission):
            _check_both_ways(run, outcome, part)
        varies = part.has(kinds.SpatiallyVarying)
        if not part.has(kinds.Anisotropic) and not varies:
            difference = _turned(run, part)
            if difference > 100 * run.rounding(part):
                outcome.fault(
                    f"f changes by up to {difference:.1%} as both directions turn about the normal, but it is not "
                    "flagged anisotropic",
                    difference,
                    wi=on_side(direction(40), part.sides[0]),
                    seed=5,
                )
        yield outcome.finding("They fit what it does.")


def _check_both_ways(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that a component that is flagged for both sends light to both sides."""
    wi, wo = (on_side(hemisphere(COUNT, seed), part.sides[0]) for seed in (6, 7))
    lit = [run.probe.eval(part, wi, on_side(wo, side)).any() for side in (1, -1)]
    if lit[0] != lit[1]:
        does, lacks = ("reflects", "transmits") if lit[0] else ("transmits", "reflects")
        outcome.fault(f"it is flagged for reflection and transmission, but {does} and never {lacks}")


def _turned(run: Run, part: Part) -> float:
    """Return the typical relative change of f as the frame turns: nine tenths of the pairs change less."""
    wi = np.tile(on_side(direction(40), part.sides[0]), (COUNT, 1))
    wo = run.probe.sample(part, wi, random(COUNT, 5)).wo
    before = run.probe.eval(part, wi, wo).max(axis=1)
    largest = 0.0
    for angle in (35, 90):
        cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        matrix = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        after = run.probe.eval(part, (wi @ matrix).astype(np.float32), (wo @ matrix).astype(np.float32)).max(axis=1)
        lit = np.maximum(before, after) > 0
        if lit.any():
            change = abs(after - before)[lit] / np.maximum(before, after)[lit]
            largest = max(largest, float(np.quantile(np.nan_to_num(change), 0.9)))
    return largest
