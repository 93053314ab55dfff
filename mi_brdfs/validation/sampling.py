"""Checks of samplers: the density, its integral and the weight."""

from __future__ import annotations

from collections.abc import Sequence
from math import erfc, pi, sqrt

import numpy as np

from ..probe.arrays import Array, luminance
from ..probe.bsdf import Part, Samples
from ..probe.chi_square import in_words
from .outcome import Outcome
from .run import SEED, Check, Run, of_parts

CONSTANTS = {
    2: "the probability of one of two lobes",
    4: "the 4 in the density of wo, that of h over 4 wo·h",
    pi: "the π of cosine-weighted directions",
    2 * pi: "the 2π of uniform directions",
    4 * pi: "the 4π of uniform directions on the sphere",
}
"""What a factor that is off, or its inverse, may be."""


@of_parts
def chi2(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that the directions drawn are distributed as ``pdf`` says: Pearson's test of the counts in cells that adapt
    to the lobe, and in larger ones. Together with ``pdf`` below it sees whatever is wrong with one of the two."""
    smallest, own = 1.0, run.trials(part)
    for trial in own:
        name, test = trial.incident.name, trial.test
        smallest = min(smallest, test.p_value)
        outcome.data[name] = test.__dict__ | {"cells": len(trial.counts), "drawn": trial.share}
        if not test.p_value >= run.level:
            numbers = f"{in_words(test.p_value)}, χ² = {test.statistic:.0f} for {test.degrees} degrees of freedom"
            told = f"the directions drawn are not distributed as pdf says ({numbers}): {trial.deviation}"
            size = test.statistic / max(test.degrees, 1)
            outcome.fault(f"for light from {name} {told}", size, wi=trial.incident.wi, seed=trial.seed)
    outcome.tried = len(own)
    left_out = max(trial.left_out for trial in own)
    aside = f"; up to {left_out:.0%} of the samples lie in lines too narrow to be integrated" * (left_out > 0.01)
    return f"{len(own)} tests, the smallest p-value is {smallest:.2g}{aside}."


@of_parts
def pdf(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that the integral of ``pdf`` over the sphere is the part of the samples that is drawn, so at most one:
    within 0.1 % for the quadrature and for float32, and the noise of the samples."""
    largest, own = 0.0, run.trials(part)
    for trial in own:
        name = trial.incident.name
        noise = sqrt(max(trial.share * (1 - trial.share), 1 / trial.count) / trial.count)
        excess = max(trial.mismatch - 1e-3, 0) / noise
        largest = max(largest, trial.mismatch)
        outcome.data[name] = {"integral": trial.integral, "drawn": trial.share}
        if not erfc(excess / sqrt(2)) >= run.level:
            share = "all" if trial.share == 1 else f"{100 * trial.share:.2f} % of the"
            told = f"pdf integrates to {trial.integral:.4g}, but {share} samples are drawn"
            outcome.fault(f"for light from {name} {told}", excess, wi=trial.incident.wi, seed=trial.seed)
    factors = [trial.integral / trial.share if trial.share else np.inf for trial in own]
    outcome.tried = len(own)
    outcome.remark = _constant(factors) if len(outcome.faults) == len(own) > 1 else ""
    return f"Its integral agrees with the samples drawn to {largest:.1g}."


@of_parts
def weight(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that the weight that ``sample`` returns is ``eval``/``pdf`` of the direction drawn, and the density that it
    says is ``pdf``: to float32's rounding, for all but one sample in a thousand, and for all of them within a tenth."""
    tolerance, worst = 3 * run.rounding(part), 0.0
    factors: list[float] = []
    for incident in run.views(part):
        samples = run.samples(part, incident)
        lit = samples.lit
        if not lit.any():
            continue  # black, or found by the check of the density's integral
        weight, value, pdf, density = samples.weight, samples.value, samples.pdf, samples.density
        with np.errstate(invalid="ignore", divide="ignore"):
            quotient = value / pdf[:, None]
            reflected = weight * pdf[:, None]
            scale = np.maximum(np.maximum(abs(value), abs(reflected)).max(axis=1), 1e-6 * np.maximum(pdf, 1e-6))
            off = abs(reflected - value).max(axis=1) / scale
            wide = abs(density - pdf) / np.maximum(np.maximum(density, pdf), 1e-9)
            factors += list(np.quantile(np.nan_to_num(luminance(reflected) / luminance(value))[lit], (0.01, 0.99)))
        for name, got, expected, why, error in (
            ("a sample's weight", weight, quotient, "is eval/pdf", off),
            ("the density that sample says", density, pdf, "is pdf", wide),
        ):
            error = np.where(lit, np.where(np.isnan(error), np.inf, error), 0)
            typical, largest = np.quantile(error[lit], 0.999), error.max()
            worst = max(worst, typical)
            if not (typical <= tolerance and largest <= max(0.1, 30 * tolerance)):
                # Of those that are off by much, name the one that carries most light.
                carried = np.where(error >= 0.5 * largest, 1 + np.nan_to_num(abs(got.reshape(len(got), -1)).max(1)), 0)
                outcome.wrong(carried, name, got, why, incident.wi, samples.wo, expected=expected, seed=SEED)
    if outcome.faults and run.angles:
        run.trials(part)  # whose pictures show where
    outcome.remark = _constant(factors) if outcome.faults else ""
    return f"Weights are eval/pdf to {worst:.1g}, within {tolerance:.1g}."


def _constant(factors: Sequence[float]) -> str:
    """Return a sentence if something is off by the same factor for all directions, and else none."""
    factor, most = min(factors), max(factors)
    if not most < 1.02 * factor or 0.99 < factor < 1.01:
        return ""
    why = (it for size, it in CONSTANTS.items() if min(abs(factor / size - 1), abs(factor * size - 1)) < 0.02)
    perhaps = "".join(f", perhaps {it}" for it in why)
    return f"It is off by a factor of {factor:.3g} everywhere: a constant is wrong{perhaps}."


def failing(run: Run, part: Part, *checks: Check, anew: bool = True) -> list[str]:
    """Return those of the checks that fail for a part: what follows from a fault is not another one. Those that were
    not made before are made ``anew``, or left out."""
    made = {it.check for it in run.found}
    findings = [it for check in checks if anew and check.__name__ not in made for it in check(run)]
    failed = [it for it in [*run.found, *findings] if it.subject == part.name and it.verdict == "fail"]
    names = [check.__name__ for check in checks]
    return [it.check for it in failed if it.check in names]


def strays(own: Samples, usual: Samples, wi: Array) -> float:
    """Return by how much samples carry other light than the usual ones for the same variates, or to directions nearer
    to the mirror direction or farther; 0 within six standard errors, which are small unless the two are drawn in other
    ways."""
    both = []
    for samples in (own, usual):
        light = samples.weight.mean(axis=1)
        both.append(np.stack([light, light * (1 - np.sum(samples.wo * wi * [-1, -1, 1], axis=1))]))
    change = both[0] - both[1]
    error, noise = abs(change.mean(axis=1)), change.std(axis=1) / sqrt(len(wi))
    return float(np.max(error * (error > 6 * noise + 1e-3 * abs(both[1]).mean(axis=1))))
