"""Checks of samplers: the density, its integral, the weight, and what is reflected."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import erfc, sqrt

import numpy as np

from .outcome import Findings, Outcome
from .partition import ChiSquare, Partition, azimuth, chi_square, partitions
from .report import Finding
from .subject import STEEPEST, Incident, Samples, angles_of, brightness, direction, on_side, random

COUNT = 1 << 18
"""Samples for a direction that was asked for."""
CELLS, GROUPS = 1024, 64
PILOT = 1 / 8
"""Samples that the cells are made by, for each that is counted."""
RANDOM = 16
"""Directions at random beside those."""
RANDOM_COUNT, RANDOM_CELLS = 1 << 14, 128


@dataclass(frozen=True)
class Trial:
    """A histogram of samples against the integrals of the density."""

    part: str
    incident: Incident
    partition: Partition
    counts: np.ndarray
    """How many of the samples are drawn in each cell."""
    count: int = COUNT
    """How many samples there are."""

    @property
    def axis(self) -> np.ndarray:
        """The azimuth of the plane of incidence, as a unit vector (cosφ, sinφ)."""
        return azimuth(self.incident.wi)

    @property
    def share(self) -> float:
        """The part of the samples that is drawn."""
        return float(self.counts.sum()) / self.count

    @property
    def integral(self) -> float:
        """The integral of the density over the sphere."""
        return float(self.partition.integrals.sum())

    @cached_property
    def expected(self) -> np.ndarray:
        """The counts that the density expects."""
        return self.count * np.maximum(self.partition.integrals, 0)

    @cached_property
    def test(self) -> ChiSquare:
        """The graver of two tests: of the cells, which see what is wrong in few of them, and of groups of neighbours,
        which see what is slightly wrong in many."""
        fine = chi_square(self.counts, self.expected)
        share = np.cumsum(np.fmin(self.expected, self.count))  # a density may be infinite
        share = share / max(share[-1], 1e-30)
        groups = np.minimum(share * GROUPS, GROUPS - 1).astype(int)
        counts, expected = (np.bincount(groups, each, GROUPS) for each in (self.counts, self.expected))
        graver = min(fine, chi_square(counts, expected), key=lambda test: test.p_value)
        return replace(graver, p_value=min(2 * graver.p_value, 1), worst=fine.worst)

    @property
    def is_suspect(self) -> bool:
        """Whether it may fail, though perhaps by chance or for want of precision."""
        return not (self.test.p_value > 1e-3 and abs(self.integral - self.share) < 5e-4)

    @property
    def deviation(self) -> str:
        """Where the two deviate most."""
        worst = self.test.worst
        return (
            f"at {angles_of(self.partition.centres[worst])}, {self.counts[worst]} of {self.count} samples fall where "
            f"pdf expects {self.expected[worst]:.1f}"
        )


def trials(run, part) -> list[Trial]:
    """A trial of a part for each direction of incidence, those that were asked for and some at random; both tests below
    are made of them."""
    if part.name not in run.trials:
        asked = _trials(run, part, run.subject.incidents(part), COUNT, CELLS)
        found = _trials(run, part, random_incidents(part), RANDOM_COUNT, RANDOM_CELLS)
        # They are many, and a jump of the density close to a line of their cells escapes the quadrature: a lone suspect
        # gets as many samples and cells as the others, across that line.
        suspects = [k for k, trial in enumerate(found) if trial.is_suspect]
        for k in suspects if len(suspects) <= 2 else []:
            (found[k],) = _trials(run, part, [found[k].incident], COUNT, CELLS, turn=0.6)
        run.trials[part.name] = asked, found
    asked, found = run.trials[part.name]
    return asked + found


def shown(run) -> list[Trial]:
    """The trials for a report: those for the directions that were asked for, and the worst of the others if it
    fails."""
    picked = []
    for asked, others in run.trials.values():
        worst = min(others, key=lambda trial: trial.test.p_value)
        picked += asked + ([worst] if worst.test.p_value < significance(run) else [])
    return picked


def random_incidents(part) -> list[Incident]:
    """Directions at random, one in each of some intervals of angles, whose azimuths go around the normal."""
    rng, incidents = np.random.default_rng(51), []
    for side in part.sides:
        turn = rng.permutation(RANDOM)
        for k in range(RANDOM):
            theta, phi = STEEPEST * (k + rng.random()) / RANDOM, 360 * (turn[k] + rng.random()) / RANDOM
            incidents.append(Incident(angles_of(w := on_side(direction(theta, phi), side)), w))
    return incidents


def _trials(run, part, incidents: list[Incident], count: int, cells: int, turn: float = 0) -> list[Trial]:
    """The trials of several directions together: a kernel has the work of many of them. The cells are turned about the
    normal by an angle."""
    subject, wis = run.subject, np.array([incident.wi for incident in incidents])

    def drawn(count, seed):
        at_once = max(1, COUNT // count)
        for first in range(0, len(wis), at_once):
            some = wis[first : first + at_once]
            samples = subject.sample(part, np.repeat(some, count, axis=0), random(count * len(some), seed + 2 * first))
            for fields in zip(*(np.split(field, len(some)) for field in samples), strict=True):
                yield Samples(*fields)

    def density(of, wo):
        return np.nan_to_num(subject.pdf(part, wis[of], wo))

    pilots = [pilot.wo[pilot.drawn] for pilot in drawn(int(count * PILOT), 0)]
    # The quadrature is as precise as for the larger count, for the sake of the sum.
    cos, sin = np.cos(turn), np.sin(turn)
    made = partitions(density, pilots, list(wis @ [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]), COUNT, cells)
    found = []
    for incident, partition, samples in zip(incidents, made, drawn(count, 1), strict=True):
        # What is rejected may look as if it were drawn: let the integral decide whether black samples count.
        integral = partition.integrals.sum()
        counted = min(samples.drawn, samples.lit, key=lambda these: abs(these.mean() - integral))
        found.append(Trial(part.name, incident, partition, partition.histogram(samples.wo[counted]), count))
    return found


def tests(subject) -> int:
    """How many statistical tests a call makes: two of each trial."""
    return 2 * sum(len(subject.incidents(part)) + RANDOM * len(part.sides) for part in subject.parts)


def significance(run) -> float:
    """The significance of one of all statistical tests of a call, after Šidák."""
    return 1 - (1 - run.significance) ** (1 / run.tests)


def chi2(run) -> Findings:
    """The directions drawn are distributed as ``pdf`` says: Pearson's test of the counts in cells that adapt to the
    lobe, and in larger ones. Together with ``pdf`` below it sees whatever is wrong with one of the two."""
    level = significance(run)
    for part in run.subject.parts:
        outcome, smallest = Outcome("chi2", part.name), 1.0
        own = trials(run, part)
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
        for trial in trials(run, part):
            name = trial.incident.name
            noise = sqrt(max(trial.share * (1 - trial.share), 1 / trial.count) / trial.count)
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
        for incident in run.subject.views(part):
            samples = run.samples(part, incident)
            if not samples.lit.any():
                continue  # black, or found by the check of the density's integral
            for name, error in _mismatches(samples):
                typical, largest = np.quantile(error, 0.999), error.max()
                worst = max(worst, typical)
                if not (typical <= tolerance and largest <= max(0.1, 30 * tolerance)):
                    k = int(np.argmax(error))
                    k = np.flatnonzero(samples.lit)[k]
                    outcome.fault(f"for light from {incident.of(k)} {_told(name, samples, k)}", largest)
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
    variates evenly. Judged if a limit is known, in each channel of colour, to 0.1 % and the noise: for a plugin of ours
    each component by the model's energy class, and the whole of a plugin with its default parameters by its manual
    page."""
    points = variates(12, 5)
    limit, limit_reason, default = run.energy
    for part in run.subject.parts:
        judged = limit is not None and (run.conserves or part.component is not None or len(run.subject.parts) == 1)
        outcome, largest = Outcome("albedo", part.name), (0.0, "")
        for name, wi in _white_furnace(run, part):
            weights = run.subject.sample(part, wi, points).weight
            copies = weights.reshape(SHIFTS, -1, weights.shape[1]).mean(axis=1)
            copies = np.concatenate([brightness(copies)[:, None], copies], axis=1)
            means, noises = copies.mean(axis=0), copies.std(axis=0, ddof=1) / sqrt(SHIFTS)
            mean, noise = float(means[0]), float(noises[0])
            outcome.data[name] = {"albedo": mean, "noise": noise}
            if mean > largest[0] or not np.isfinite(mean):
                largest = (mean, name)
            if judged and not (means <= limit * (1 + 1e-3) + 5 * noises).all():
                k = int(np.argmax(np.where(np.isnan(means[1:]), np.inf, means[1:]))) + 1
                alike = np.ptp(means[1:]) <= 1e-4 * abs(means[k])
                outcome.fault(
                    f"light from {name} is reflected {means[k]:.4g} times (± {noises[k]:.1g})"
                    f"{'' if alike else f' in channel {k}'}, more than {limit_reason}",
                    means[k],
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
