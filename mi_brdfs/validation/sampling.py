"""Checks of samplers: the density, its integral and the weight."""

from __future__ import annotations

from collections.abc import Iterator
from math import erfc, sqrt

import numpy as np

from ..probe.arrays import Array
from ..probe.bsdf import Samples
from ..probe.directions import angles_of
from .outcome import Findings, Outcome
from .report import Finding
from .run import SEED, Run


def chi2(run: Run) -> Findings:
    """Check that the directions drawn are distributed as ``pdf`` says: Pearson's test of the counts in cells that adapt
    to the lobe, and in larger ones. Together with ``pdf`` below it sees whatever is wrong with one of the two."""
    for part in run.probe.parts:
        outcome, smallest = Outcome("chi2", part.name), 1.0
        if run.is_black(part):
            yield Finding("chi2", part.name, "skip", "Black.")
            continue
        own = run.trials(part)
        for trial in own:
            smallest = min(smallest, trial.test.p_value)
            name = trial.incident.name
            outcome.data[name] = trial.test.__dict__ | {"cells": len(trial.counts), "drawn": trial.share}
            if not trial.test.p_value >= run.level:
                outcome.fault(
                    f"for light from {name} the directions drawn are not distributed as pdf says "
                    f"(p = {trial.test.p_value:.2g}, χ² = {trial.test.statistic:.0f} for {trial.test.degrees} degrees "
                    f"of freedom): {trial.deviation}",
                    trial.test.statistic / max(trial.test.degrees, 1),
                    wi=trial.incident.wi,
                    seed=trial.seed,
                )
        yield outcome.finding(f"{len(own)} tests, the smallest p-value is {smallest:.2g}.")


def pdf(run: Run) -> Findings:
    """Check that the integral of ``pdf`` over the sphere is the part of the samples that is drawn, so at most one:
    within 0.1 % for the quadrature and for float32, and the noise of the samples."""
    for part in run.probe.parts:
        outcome, largest = Outcome("pdf", part.name), 0.0
        if run.is_black(part):
            yield Finding("pdf", part.name, "skip", "Black.")
            continue
        for trial in run.trials(part):
            name = trial.incident.name
            noise = sqrt(max(trial.share * (1 - trial.share), 1 / trial.count) / trial.count)
            excess = max(abs(trial.integral - trial.share) - 1e-3, 0) / noise
            largest = max(largest, abs(trial.integral - trial.share))
            outcome.data[name] = {"integral": trial.integral, "drawn": trial.share}
            if not erfc(excess / sqrt(2)) >= run.level:
                outcome.fault(
                    f"for light from {name} pdf integrates to {trial.integral:.4g}, but "
                    f"{'all' if trial.share == 1 else f'{100 * trial.share:.2f} % of the'} samples are drawn",
                    excess,
                    wi=trial.incident.wi,
                    seed=trial.seed,
                )
        yield outcome.finding(f"Its integral agrees with the samples drawn to {largest:.1g}.")


def weight(run: Run) -> Findings:
    """Check that the weight that ``sample`` returns is ``eval``/``pdf`` of the direction drawn, and the density that it
    says is ``pdf``: to float32's rounding, for all but one sample in a thousand, and for all of them within a tenth."""
    for part in run.probe.parts:
        outcome, tolerance, worst = Outcome("weight", part.name), 3 * run.rounding(part), 0.0
        for incident in run.views(part):
            samples = run.samples(part, incident)
            if not samples.lit.any():
                continue  # black, or found by the check of the density's integral
            for name, error in _mismatches(samples):
                typical, largest = np.quantile(error, 0.999), error.max()
                worst = max(worst, typical)
                if not (typical <= tolerance and largest <= max(0.1, 30 * tolerance)):
                    k = int(np.argmax(error))
                    k = np.flatnonzero(samples.lit)[k]
                    outcome.fault(
                        f"for light from {incident.of(k)} {_told(name, samples, k)}",
                        largest,
                        wi=incident.vector(k),
                        wo=samples.wo[k],
                        seed=SEED,
                    )
        yield outcome.finding(f"Weights are eval/pdf to {worst:.1g}, within {tolerance:.1g}.")


def _mismatches(samples: Samples) -> Iterator[tuple[str, Array]]:
    """Yield the relative errors of weights and of densities, of the samples that carry light."""
    weight, value, pdf, density = (
        x[samples.lit] for x in (samples.weight, samples.value, samples.pdf, samples.density)
    )
    reflected = (weight * pdf[:, None]).max(axis=1)
    scale = np.maximum(np.maximum(value.max(axis=1), reflected), 1e-6 * np.maximum(pdf, 1e-6))
    with np.errstate(invalid="ignore"):
        yield "weight", _never_nan(abs(weight * pdf[:, None] - value).max(axis=1) / scale)
        yield "density", _never_nan(abs(density - pdf) / np.maximum(np.maximum(density, pdf), 1e-9))


def _never_nan(error: Array) -> Array:
    return np.where(np.isnan(error), np.inf, error)


def _told(name: str, samples: Samples, k: int) -> str:
    """Return what is wrong with a sample in words."""
    where = f"towards {angles_of(samples.wo[k])}"
    if name == "density":
        return f"sample says the density {samples.density[k]:.4g} {where}, but pdf {samples.pdf[k]:.4g}"
    channel = int(np.argmax(_never_nan(abs(samples.weight[k] * samples.pdf[k] - samples.value[k]))))
    pdf = samples.pdf[k]
    expected = f"{samples.value[k, channel] / pdf:.4g}" if pdf > 0 else f"{samples.value[k, channel]:.4g}/0"
    return f"the weight is {samples.weight[k, channel]:.4g} {where}, but eval/pdf is {expected}"
