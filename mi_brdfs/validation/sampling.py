"""Checks of samplers: the density, its integral, the weight, and what is reflected."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erfc, sqrt

import numpy as np

from .outcome import Findings, Outcome
from .partition import ChiSquare, Partition, chi_square, partition
from .report import Finding
from .subject import Incident, Samples, brightness, direction, on_side, random
from .values import angles_of

COUNT = 1 << 18
PILOT = 1 << 16


@dataclass(frozen=True)
class Trial:
    """A histogram of samples against the integrals of the density."""

    part: str
    incident: Incident
    partition: Partition
    counts: np.ndarray
    """How many of ``COUNT`` samples are drawn in each cell."""

    @property
    def share(self) -> float:
        """The part of the samples that is drawn."""
        return float(self.counts.sum()) / COUNT

    @property
    def integral(self) -> float:
        """The integral of the density over the sphere."""
        return float(self.partition.integrals.sum())

    @cached_property
    def expected(self) -> np.ndarray:
        """The counts that the density expects."""
        return COUNT * np.maximum(self.partition.integrals, 0)

    @cached_property
    def test(self) -> ChiSquare:
        return chi_square(self.counts, self.expected)

    @property
    def deviation(self) -> str:
        """Where the two deviate most."""
        worst = self.test.worst
        return (
            f"at {angles_of(self.partition.centres[worst])}, {self.counts[worst]} of {COUNT} samples fall where pdf "
            f"expects {self.expected[worst]:.1f}"
        )


def trials(run) -> list[Trial]:
    """A trial for each part and direction of incidence; both tests below are made of them."""
    if run.trials is None:
        run.trials = [
            _trial(run, part, incident, seed)
            for part in run.subject.parts
            for seed, incident in enumerate(run.subject.incidents(part))
        ]
    return run.trials


def _trial(run, part, incident, seed) -> Trial:
    subject, wi = run.subject, incident.wi
    pilot = subject.sample(part, wi, random(PILOT, 2 * seed))
    cells = partition(lambda wo: np.nan_to_num(subject.pdf(part, wi, wo)), pilot.wo[pilot.drawn], wi, COUNT)
    samples = subject.sample(part, wi, random(COUNT, 2 * seed + 1))
    # What is rejected may look as if it were drawn: let the integral decide whether black samples count.
    integral = cells.integrals.sum()
    counted = min(samples.drawn, samples.lit, key=lambda these: abs(these.mean() - integral))
    return Trial(part.name, incident, cells, cells.histogram(samples.wo[counted]))


def significance(run) -> float:
    """The significance of one of all statistical tests of a call, after Šidák."""
    return 1 - (1 - run.significance) ** (1 / run.tests)


def chi2(run) -> Findings:
    """The directions drawn are distributed as ``pdf`` says: Pearson's test of the counts in cells that adapt to the
    lobe. Together with ``pdf`` below it sees whatever is wrong with one of the two."""
    level = significance(run)
    for part in run.subject.parts:
        outcome, smallest = Outcome("chi2", part.name), 1.0
        own = [trial for trial in trials(run) if trial.part == part.name]
        for trial in own:
            smallest = min(smallest, trial.test.p_value)
            name = trial.incident.name
            outcome.data[name] = trial.test.__dict__ | {"cells": len(trial.counts), "drawn": trial.share}
            if not trial.test.p_value >= level:
                outcome.fault(
                    f"for light from {name} the directions drawn are not distributed as pdf says "
                    f"(p = {trial.test.p_value:.2g}, χ² = {trial.test.statistic:.0f} for {trial.test.degrees} degrees "
                    f"of freedom): {trial.deviation}",
                    trial.test.statistic / max(trial.test.degrees, 1),
                )
        if not any(trial.share or trial.integral for trial in own):
            yield Finding("chi2", part.name, "skip", "It draws nothing.")
            continue
        yield outcome.finding(f"{len(own)} tests, the smallest p-value is {smallest:.2g}.")


def pdf(run) -> Findings:
    """The integral of ``pdf`` over the sphere is the part of the samples that is drawn, so at most one: within 0.1 %
    for the quadrature and for float32, and the noise of the samples."""
    level = significance(run)
    for part in run.subject.parts:
        outcome, largest = Outcome("pdf", part.name), 0.0
        for trial in (trial for trial in trials(run) if trial.part == part.name):
            name = trial.incident.name
            noise = sqrt(max(trial.share * (1 - trial.share), 1 / COUNT) / COUNT)
            excess = max(abs(trial.integral - trial.share) - 1e-3, 0) / noise
            largest = max(largest, abs(trial.integral - trial.share))
            outcome.data[name] = {"integral": trial.integral, "drawn": trial.share}
            if not erfc(excess / sqrt(2)) >= level:
                outcome.fault(
                    f"for light from {name} pdf integrates to {trial.integral:.4g}, but "
                    f"{'all' if trial.share == 1 else f'{100 * trial.share:.2f} % of the'} samples are drawn",
                    excess,
                )
        yield outcome.finding(f"Its integral agrees with the samples drawn to {largest:.1g}.")


def weight(run) -> Findings:
    """The weight that ``sample`` returns is ``eval``/``pdf`` of the direction drawn, and the density that it says is
    ``pdf``: to float32's rounding, for all but one sample in a thousand, and for all of them within a tenth."""
    for part in run.subject.parts:
        outcome, tolerance, worst = Outcome("weight", part.name), 3 * run.subject.rounding(part), 0.0
        for incident in run.subject.incidents(part):
            samples = run.samples(part, incident)
            if not samples.lit.any():
                continue  # black, or found by the check of the density's integral
            for name, error in _mismatches(samples):
                typical, largest = np.quantile(error, 0.999), error.max()
                worst = max(worst, typical)
                if not (typical <= tolerance and largest <= max(0.1, 30 * tolerance)):
                    k = int(np.argmax(error))
                    outcome.fault(f"for light from {incident.name} {_told(name, samples, k)}", largest)
        yield outcome.finding(f"Weights are eval/pdf to {worst:.1g}, within {tolerance:.1g}.")


def _mismatches(samples: Samples):
    """The relative errors of weights and densities, of the samples that carry light."""
    weight, value, pdf, density = (
        x[samples.lit] for x in (samples.weight, samples.value, samples.pdf, samples.density)
    )
    reflected = (weight * pdf[:, None]).max(axis=1)
    scale = np.maximum(np.maximum(value.max(axis=1), reflected), 1e-6 * np.maximum(pdf, 1e-6))
    with np.errstate(invalid="ignore"):
        yield "weight", _never_nan(abs(weight * pdf[:, None] - value).max(axis=1) / scale)
        yield "density", _never_nan(abs(density - pdf) / np.maximum(np.maximum(density, pdf), 1e-9))


def _never_nan(error):
    return np.where(np.isnan(error), np.inf, error)


def _told(name: str, samples: Samples, k: int) -> str:
    k = np.flatnonzero(samples.lit)[k]
    where = f"towards {angles_of(samples.wo[k])}"
    if name == "density":
        return f"sample says the density {samples.density[k]:.4g} {where}, but pdf {samples.pdf[k]:.4g}"
    channel = int(np.argmax(_never_nan(abs(samples.weight[k] * samples.pdf[k] - samples.value[k]))))
    pdf = samples.pdf[k]
    expected = f"{samples.value[k, channel] / pdf:.4g}" if pdf > 0 else f"{samples.value[k, channel]:.4g}/0"
    return f"the weight is {samples.weight[k, channel]:.4g} {where}, but eval/pdf is {expected}"


# --- Energy ---------------------------------------------------------------------------------------------------------

SHIFTS = 16
"""Copies of the point set, each shifted at random: their spread tells the error of their mean."""


def variates(log2_count: int, seed: int) -> np.ndarray:
    """Points of a lattice that fill the unit cube evenly, shifted at random, shape (SHIFTS·2^n, 3)."""
    # The steps are the powers of the root of x⁴ = x + 1, after M. Roberts' generalisation of the golden ratio.
    steps = 1 / 1.2207440846057596 ** np.arange(1, 4)
    lattice = np.arange(1 << log2_count)[:, None] * steps
    shifts = np.random.default_rng(seed).random((SHIFTS, 1, 3))
    return np.minimum((lattice + shifts) % 1, 1 - 2**-24).reshape(-1, 3).astype(np.float32)


def albedo(run) -> Findings:
    """What is reflected of light from one direction: the mean of the weights, over points that fill the space of the
    variates evenly. Judged if a limit is known, to 0.1 % and the noise: for a plugin of ours each component by the
    model's energy class, and the whole of a plugin with its default parameters by its manual page."""
    points = variates(12, 5)
    limit, limit_reason, default = run.energy
    for part in run.subject.parts:
        judged = limit is not None and (run.conserves or part.component is not None or len(run.subject.parts) == 1)
        outcome, largest = Outcome("albedo", part.name), (0.0, "")
        for name, wi in _white_furnace(run, part):
            copies = brightness(run.subject.sample(part, wi, points).weight).reshape(SHIFTS, -1).mean(axis=1)
            mean, noise = float(copies.mean()), float(copies.std(ddof=1) / sqrt(SHIFTS))
            outcome.data[name] = {"albedo": mean, "noise": noise}
            if mean > largest[0] or not np.isfinite(mean):
                largest = (mean, name)
            if judged and not mean <= limit * (1 + 1e-3) + 5 * noise:
                outcome.fault(
                    f"light from {name} is reflected {mean:.4g} times (± {noise:.1g}), more than {limit_reason}", mean
                )
        if default is not None and part.component is None and not abs(largest[0] - default) <= 0.02 * default:
            outcome.fault(f"the largest albedo is {largest[0]:.4g}, but the manual page says {default:.4g}", 0)
        message = f"At most {largest[0]:.4g}, for light from {largest[1]}." if largest[1] else "Black."
        if judged or default is not None or outcome.faults:
            yield outcome.finding(message)
        else:
            yield Finding("albedo", part.name, "info", message, outcome.data)


def _white_furnace(run, part):
    for side in part.sides:
        for theta in sorted({*run.subject.angles, 0, 45, 70, 85, 89, 89.9}):
            yield f"{theta:g}°" + (" behind" if side < 0 else ""), on_side(direction(theta, 17), side)


def efficiency(run) -> Findings:
    """η = E[w]²/E[w²] of the sampling weight w: 1 is perfect. Reported, not judged."""
    for part in run.subject.parts:
        values = {}
        for incident in run.subject.incidents(part):
            w = brightness(run.samples(part, incident).weight)
            values[incident.name] = float(w.mean() ** 2 / (w**2).mean()) if w.any() else 0.0
        told = ", ".join(f"{eta:.3f} at {name}" for name, eta in values.items() if eta)
        yield Finding("efficiency", part.name, "info", f"η = {told}." if told else "Black.", values)
