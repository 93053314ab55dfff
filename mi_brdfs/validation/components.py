"""Checks of how the components of a BSDF fit together, and of their flags."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from .outcome import Findings, Outcome
from .subject import SCATTERED, Part, angles_of, context, direction, hemisphere, on_side, random

COUNT = 4000


def components(run) -> Findings:
    """The components add up to the whole, whose density is a mixture of theirs; ``sampled_component`` and
    ``sampled_type`` lie within what was asked for and drawn, ``eta`` is 1 for light that stays on its side, and what a
    context excludes is black."""
    subject = run.subject
    for part in subject.parts:
        outcome = Outcome("components", part.name)
        for incident in subject.views(part):
            _check_sampled(run, outcome, part, incident)
        if part.component is None:
            _check_sum(run, outcome)
            _check_there_and_back(outcome, run, part)
        yield outcome.finding("Sums, sampled components and types are as asked for.")
    for part in subject.components:
        outcome = Outcome("components", f"{part.name} masked out")
        _check_masks(run, outcome, part)
        yield outcome.finding("Black where the context excludes it.")


def _check_sampled(run, outcome, part, incident):
    samples = run.samples(part, incident)
    chosen = samples.lit
    if not chosen.any():
        return
    index, kind = samples.component[chosen].astype(np.int64), samples.kind[chosen].astype(np.int64)
    allowed = {each.component: each.flags for each in run.subject.components}
    if part.component is not None:
        allowed = {part.component: part.flags}
    for k in np.unique(index):
        if k not in allowed:
            outcome.fault(
                f"for light from {incident.name} sampled_component is {k} in {(index == k).mean():.1%} of the samples, "
                f"where only {', '.join(map(str, allowed))} may be drawn"
            )
            continue
        wrong = (kind[index == k] & ~allowed[k] != 0) | (kind[index == k] == 0)
        if wrong.any():
            outcome.fault(
                f"for light from {incident.name} sampled_type is {kind[index == k][wrong][0]:#x} for component {k}, "
                f"whose flags are {allowed[k]:#x}"
            )
    _check_eta(outcome, incident, samples)
    if part.component is None and len(allowed) > 1:
        # A sample of a component must lie where that component can send one.
        for each in run.subject.components:
            drawn = np.flatnonzero(chosen)[index == each.component]
            if len(drawn):
                wo = np.ascontiguousarray(samples.wo[drawn])
                stray = (run.subject.pdf(each, incident.at(drawn), wo) <= 0).mean()
                if stray > 1e-3:
                    outcome.fault(
                        f"for light from {incident.name} {stray:.1%} of the samples said to be component "
                        f"{each.component}'s lie where it draws none",
                        stray,
                    )
                _check_share(run, outcome, incident, each, samples, drawn)


def _check_eta(outcome, incident, samples):
    """Light that stays on its side stays in its medium."""
    stays = samples.lit & (samples.wo[:, 2] * incident.wi[..., 2] > 0)
    wrong = (stays & (samples.eta != 1)) | samples.lit & ~(np.isfinite(samples.eta) & (samples.eta > 0))
    if wrong.any():
        k = int(np.argmax(wrong))
        needed = "it must be 1 as the light stays on its side" if stays[k] else "it must be above 0"
        outcome.fault(
            f"for light from {incident.of(k)} a sample towards {angles_of(samples.wo[k])} has the eta "
            f"{samples.eta[k]:.4g}, but {needed}; {wrong.sum() / samples.lit.sum():.1%} of them are wrong",
            np.inf,
        )


def _check_there_and_back(outcome, run, part):
    """The relative index of refraction is the reciprocal of that of the other way."""
    if len(part.sides) < 2 or not part.has(mi.BSDFFlags.Transmission):
        return
    found = []
    for side in part.sides:
        samples = run.subject.sample(part, on_side(direction(20, 10), side), random(COUNT, 6))
        through = samples.lit & (samples.wo[:, 2] * side < 0)
        found.append(float(np.median(samples.eta[through])) if through.any() else 1.0)
    if not abs(found[0] * found[1] - 1) < 1e-3:
        outcome.fault(
            f"eta is {found[0]:.4g} for light that passes from the front, but {found[1]:.4g} for light from behind, "
            "which must be its reciprocal",
            np.inf,
        )


def _check_share(run, outcome, incident, each, samples, drawn):
    """Where only one component can be, its share of the samples must be that of its density in the mixture's."""
    others = [other for other in run.subject.components if other is not each]
    kept = samples.lit
    wi, wo = incident.at(kept), np.ascontiguousarray(samples.wo[kept])
    own = run.subject.pdf(each, wi, wo)
    rest = sum(run.subject.pdf(other, wi, wo) for other in others)
    alone = (own > 1e3 * rest) & (own > 0)
    if alone.sum() < 200:
        return
    said = np.isin(np.flatnonzero(kept)[alone], drawn).mean()
    if said < 0.9:
        outcome.fault(
            f"for light from {incident.name} only {said:.1%} of the samples where nothing but component "
            f"{each.component} draws any are said to be its own",
            1 - said,
        )


def _check_sum(run, outcome):
    subject, tolerance = run.subject, 10 * run.subject.rounding(run.subject.whole)
    flags = 0
    for k in range(subject.bsdf.component_count()):
        flags |= int(subject.bsdf.flags(k))
    if int(subject.bsdf.flags()) != flags:
        outcome.fault(f"flags() is {int(subject.bsdf.flags()):#x}, but those of the components make {flags:#x}", np.inf)
    for incident in subject.views(subject.whole):
        lanes = np.arange(0, SCATTERED, SCATTERED // COUNT)
        wo = np.concatenate([on_side(hemisphere(len(lanes), 1), side) for side in (1, -1)])
        wo = np.concatenate([wo, run.samples(subject.whole, incident).wo[lanes]])
        lanes = np.tile(lanes, 3)
        wi = incident.at(lanes)
        whole, density = subject.eval_pdf(subject.whole, wi, wo)
        values, pdfs = zip(*(subject.eval_pdf(part, wi, wo) for part in subject.components), strict=True)
        total = sum(values)
        scale = np.maximum(np.maximum(whole, total), 1e-6 * np.max(total) + 1e-12)
        error = np.nan_to_num(abs(whole - total) / scale).max(axis=1)
        if error.max() > tolerance:
            k = int(np.argmax(error))
            outcome.fault(
                f"for light from {incident.of(lanes[k])} eval is {whole[k].max():.4g} towards {angles_of(wo[k])}, but "
                f"the components add up to {total[k].max():.4g}",
                error[k],
            )
        low, high = np.min(pdfs, axis=0), np.max(pdfs, axis=0)
        if subject.deltas:
            low = np.zeros_like(low)  # they take a share of the samples
        beyond = np.maximum(density - high, low - density) / np.maximum(np.maximum(density, high), 1e-9)
        beyond = np.nan_to_num(beyond)
        if beyond.max() > tolerance:
            k = int(np.argmax(beyond))
            outcome.fault(
                f"for light from {incident.of(lanes[k])} pdf is {density[k]:.4g} towards {angles_of(wo[k])}, but a "
                f"mixture of the components' lies between {low[k]:.4g} and {high[k]:.4g}",
                beyond[k],
            )


def _check_masks(run, outcome, part: Part):
    subject, wi = run.subject, on_side(direction(30, 20), part.sides[0])
    wo = np.concatenate([hemisphere(COUNT, 1), on_side(hemisphere(COUNT, 2), -1)])
    every = int(mi.BSDFFlags.All)
    kind = part.flags & every
    for words, excluding in (
        (f"component {part.component} of a type mask without its type", context(part.component, every & ~kind)),
        ("a component that does not exist", context(subject.bsdf.component_count() + 7)),
    ):
        nothing = part._replace(context=excluding)
        value, density = subject.eval_pdf(nothing, wi, wo)
        samples = subject.sample(nothing, wi, random(COUNT, 3))
        for name, number in (("eval", value), ("pdf", density), ("sample's weight", samples.weight)):
            if number.any():
                outcome.fault(f"{name} reaches {number.max():.4g} for {words}, where all must be black", number.max())
    alone = [each for each in subject.components if each.flags & kind]
    selected = part._replace(context=context(mask=kind))
    value, expected = subject.eval(selected, wi, wo), sum(subject.eval(each, wi, wo) for each in alone)
    error = abs(value - expected).max() / max(expected.max(), 1e-12)
    if error > 10 * subject.rounding(subject.whole):
        k = int(np.argmax(abs(value - expected).max(axis=1)))
        outcome.fault(
            f"with the type mask {kind:#x} eval is {value[k].max():.4g} towards {angles_of(wo[k])}, but the components "
            f"of this type make {expected[k].max():.4g}",
            error,
        )


def flags(run) -> Findings:
    """A component's flags fit its behaviour. One that gathers half of its light within 10° of the mirror direction is
    not diffuse, and one that changes as the frame turns about the normal is anisotropic."""
    subject, kinds = run.subject, mi.BSDFFlags
    for part in subject.components:
        outcome = Outcome("flags", part.name)
        if not part.has(kinds.FrontSide) and not part.has(kinds.BackSide):
            outcome.fault("neither FrontSide nor BackSide is flagged, so that it is seen from nowhere")
        if part.has(kinds.Diffuse):
            for theta in (30, 60):
                wi = on_side(direction(theta), part.sides[0])
                samples = subject.sample(part, wi, random(COUNT, 2))
                wo = samples.wo[samples.drawn].astype(np.float64)
                sign = 1 if part.has(kinds.Reflection) else -1
                near = wo @ (wi * [-1, -1, sign]) > np.cos(np.radians(10)) if len(wo) else np.zeros(1)
                if near.mean() > 0.5:
                    outcome.fault(
                        f"for light from {theta}° {near.mean():.0%} of the samples lie within 10° of the mirror "
                        "direction, but it is flagged diffuse",
                        near.mean(),
                    )
        varies = part.has(kinds.SpatiallyVarying)
        if not part.has(kinds.Anisotropic) and not varies:
            difference = _turned(run, part)
            if difference > 100 * subject.rounding(part):
                outcome.fault(
                    f"f changes by up to {difference:.1%} as both directions turn about the normal, but it is not "
                    "flagged anisotropic",
                    difference,
                )
        yield outcome.finding("They fit what it does.")


def _turned(run, part) -> float:
    """The typical relative change of f as the frame turns: nine tenths of the pairs change less."""
    wi = np.tile(on_side(direction(40), part.sides[0]), (COUNT, 1))
    wo = run.subject.sample(part, wi, random(COUNT, 5)).wo
    before = run.subject.eval(part, wi, wo).max(axis=1)
    largest = 0.0
    for angle in (35, 90):
        cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        matrix = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        after = run.subject.eval(part, (wi @ matrix).astype(np.float32), (wo @ matrix).astype(np.float32)).max(axis=1)
        lit = np.maximum(before, after) > 0
        if lit.any():
            change = abs(after - before)[lit] / np.maximum(before, after)[lit]
            largest = max(largest, float(np.quantile(np.nan_to_num(change), 0.9)))
    return largest
