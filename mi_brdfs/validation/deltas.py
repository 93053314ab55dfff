"""A check of delta functions, which have no values, by their samples."""

from __future__ import annotations

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array
from ..probe.bsdf import Part, Samples
from ..probe.directions import scattered
from ..probe.variates import random
from .components import check_eta, check_masks, turned
from .incidents import SCATTERED, Incident
from .outcome import KNOWN, Outcome, Skipped
from .run import SEED, Run, of_each

DELTAS = int(mi.BSDFFlags.Delta) | int(mi.BSDFFlags.Null)
"""The types of delta functions."""
FEW = 100
"""Samples that do not tell their own noise."""


@of_each(lambda probe: probe.deltas or [probe.whole])
def deltas(run: Run, part: Part, outcome: Outcome) -> str:
    """Check delta functions by their samples: their density is how often they are drawn, they carry as much light among
    others as alone, to the side that their type says, which is that of their flags, none where a context excludes them,
    and ``eval`` and ``pdf`` do not know of them. Light is bent as ``eta`` says, after Snell, unless flags say that the
    surface turns it, and goes back where it came from, as much of it."""
    if not run.probe.deltas:
        raise Skipped("There is no delta function.")
    _check_drawn(run, outcome, part)
    _check_paths(run, outcome, part)
    check_masks(run, outcome, part)
    return "Its samples fit together."


def _check_drawn(run: Run, outcome: Outcome, part: Part) -> None:
    """Check that the density that the samples state is how often they are drawn, and that they carry as much light
    among others as if they were drawn alone: to six standard errors, which is a false alarm once in 1e8."""
    for incident in run.incidents(run.probe.whole):
        samples, start = run.samples(run.probe.whole, incident), f"for light from {incident.name} its samples"
        own = samples.component == part.component
        drawn = own & samples.weight.any(axis=1)
        share, density = drawn.mean(), samples.density[drawn].mean() if drawn.any() else 0
        error = abs(share - density)
        if error > 6 * np.sqrt(share * (1 - share) / len(own)) + 1e-3:
            told = f"{start} state the density {density:.4g}, but are {share:.2%} of all"
            outcome.fault(told, error, wi=incident.wi, seed=SEED)
        alone = run.probe.sample(part, incident.wi, random(SCATTERED, SEED)).weight
        both = samples.weight * own[:, None], alone
        (got, noise), (expected, other) = ((it.mean(axis=0), it.std(axis=0)) for it in both)
        if drawn.sum() < FEW:
            noise = np.maximum(noise, np.sqrt(expected))  # as of weights of 1
        error = abs(got - expected)
        if (error > 6 * np.hypot(noise, other) / np.sqrt(len(alone)) + 1e-3 * expected).any():
            k = int(np.argmax(error))
            told = f"of the light among those of others, but {expected[k]:.4g} where only these are drawn"
            outcome.fault(f"{start} carry {got[k]:.4g} {told}", error[k], wi=incident.wi, seed=SEED)


def _check_paths(run: Run, outcome: Outcome, part: Part) -> None:
    """Check where samples go, and that light goes back the same way."""
    kinds, wi, u = mi.BSDFFlags, scattered(SCATTERED, 81, part.sides), random(SCATTERED, 82)
    there = run.probe.sample(part, wi, u)
    wo, weight = there.wo, there.weight
    lit = np.logical_or.reduce(weight != 0, axis=1)
    steep = np.minimum(abs(wi[:, 2]), abs(wo[:, 2])) > 0.1

    unknown = ~(np.isfinite(weight) & (weight >= 0))
    outcome.wrong(unknown, "a sample's weight", weight, "but must be finite and not negative", wi, wo, seed=82)
    length = np.linalg.norm(wo, axis=1)
    wrong = lit & ~(abs(length - 1) < KNOWN)
    outcome.wrong(wrong, "the length of a sample's wo", length, "but must be 1", wi, wo, seed=82)
    stays = wi[:, 2] * wo[:, 2] > 0
    kind = there.kind.astype(np.int64)
    said = [(kind & int(it)) != 0 for it in (kinds.Reflection, kinds.Transmission)]
    wrong = lit & steep & (np.where(stays, *said) == 0)
    outcome.wrong(wrong, "sampled_type", kind, "which goes to the other side", wi, wo, digits=9)
    others = (kind & ~(part.flags & DELTAS) != 0) | (kind == 0)
    why = f"but must be a delta function's among those of its flags, {part.flags & DELTAS}"
    outcome.wrong(lit & others, "sampled_type", kind, why, wi, wo, digits=9)
    check_eta(outcome, Incident("all directions", wi), there, lit)
    if not part.has(kinds.Anisotropic) and not part.has(kinds.SpatiallyVarying):
        _check_turned(run, outcome, part, wi, there)
        sines = [np.hypot(w[:, 0], w[:, 1]) for w in (wi, wo)]
        bent = sines[0] / np.where(lit & (there.eta != 0), there.eta, 1)
        why = "is that by its eta"
        error = abs(sines[1] - bent) * (lit & steep & ~stays) > KNOWN
        outcome.wrong(error, "the sine of a sample's angle", sines[1], why, wi, wo, expected=bent, seed=82)
    for name, value in zip(("eval", "pdf"), run.probe.eval_pdf(part, wi, wo), strict=True):
        outcome.wrong(value != 0, name, value, "but must be 0, as it is a delta function", wi, wo)

    seen = stays if len(part.sides) < 2 else np.ones(len(wi), bool)
    back = run.probe.sample(part, np.where(steep[:, None], wo, wi), u)
    same = lit & steep & seen & (stays == (back.wo[:, 2] * wo[:, 2] > 0))
    name, pair = "the light of a sample back to wi", (_light(back), _light(there))
    outcome.differing(
        10 * KNOWN, name, *pair, "is what goes there", wi, wo, floor=1e-3, where=same, but_for=0.01, seed=82
    )
    returns = back.wo * back.weight.any(axis=1, keepdims=True)
    outcome.astray("on the way back", returns[same], wi[same], "where the light came from", wo[same], 82)


def _check_turned(run: Run, outcome: Outcome, part: Part, wi: Array, there: Samples) -> None:
    """Check that samples turn with the light about the normal."""
    after = run.probe.sample(part, turned(wi), random(SCATTERED, 82))
    lit = np.logical_and(there.weight.any(axis=1), after.weight.any(axis=1))[:, None]
    when, why = "turned about the normal", "if it turned with the light: it is not flagged anisotropic"
    outcome.astray(when, after.wo * lit, turned(there.wo) * lit, why, turned(wi), 82)


def _light(samples: Samples) -> Array:
    """Return the part of the light that samples stand for, without the factor 1/η² of refracted radiance."""
    return samples.weight * (samples.density * samples.eta**2)[:, None]
