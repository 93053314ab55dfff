"""One call of ``check``: what its checks share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any

import numpy as np

from ..probe.bsdf import BSDFProbe, Part, Samples
from ..probe.directions import direction, on_side, scattered
from ..probe.variates import random
from .incidents import RANDOM, SCATTERED, Incident, all_over, incidents, random_incidents
from .outcome import Findings, Outcome, Skipped
from .report import Finding
from .trial import Trial, trials_of

SEED = 11
"""Of the samples that several checks look at."""


@dataclass
class Run:
    """The BSDF, what was asked of it, and what several checks look at: samples, and histograms of them."""

    probe: BSDFProbe
    angles: tuple[float, ...]
    """Of incidence, in degrees."""
    significance: float
    """The probability that a BSDF without faults fails one of all statistical tests."""
    conserves: bool | None
    """Whether the whole is judged to conserve energy; None if its manual page says so or not."""
    given: dict[str, Any] | None
    """The dict that the BSDF was given as, if it was."""
    at_random: int = RANDOM
    """Directions at random on each side, for statistical tests, beside those that were asked for."""
    found: list[Finding] = field(default_factory=list, init=False)
    """What the checks made so far have found."""
    _samples: dict[tuple[str, str], Samples] = field(default_factory=dict, init=False)
    _trials: dict[str, list[Trial]] = field(default_factory=dict, init=False)
    _spreads: dict[str, float] = field(default_factory=dict, init=False)

    def described(self, reason: str) -> dict[str, Any]:
        """Return the dict that the BSDF was given as; a check that needs it for some ``reason`` is skipped else."""
        if self.given is None:
            raise Skipped(f"{reason}, its dict is needed.")
        return self.given

    def incidents(self, part: Part) -> list[Incident]:
        """Return the directions of incidence that were asked for."""
        return incidents(part, self.angles)

    def views(self, part: Part) -> list[Incident]:
        """Return these, and directions all over the sides that the part is seen from."""
        return [*self.incidents(part), all_over(part)]

    def samples(self, part: Part, incident: Incident) -> Samples:
        """Return samples for a direction of incidence, the same for every check."""
        key = part.name, incident.name
        if key not in self._samples:
            self._samples[key] = self.probe.sample(part, incident.wi, random(SCATTERED, SEED))
        return self._samples[key]

    # --- Statistical tests ------------------------------------------------------------------------------------------

    def trials(self, part: Part) -> list[Trial]:
        """Return the trials of a part, the same for every check. Where f is 0 and no sample carries light, the density
        is of no use, and a check is skipped."""
        if part.name not in self._trials:
            wi, wo = (scattered(1000, seed, part.sides) for seed in (4, 5))
            lit = (self.samples(part, incident).lit.any() for incident in self.views(part))
            if not (self.probe.eval(part, wi, wo).any() or any(lit)):
                raise Skipped("Black.")
            at_random = random_incidents(part, self.at_random)
            self._trials[part.name] = trials_of(self.probe, part, self.incidents(part), at_random)
        return self._trials[part.name]

    def shown_trials(self) -> Iterator[Trial]:
        """Yield the trials for a report, if they were made: those for the directions that were asked for, and the worst
        of the others if it fails."""
        for part in self.probe.parts:
            trials, asked = self._trials.get(part.name, []), len(self.incidents(part))
            yield from trials[:asked]
            worst = min(trials[asked:], key=lambda trial: trial.test.p_value, default=None)
            if worst and worst.test.p_value < self.level:
                yield worst

    @property
    def level(self) -> float:
        """The significance of each of the statistical tests, two for each trial, after Šidák."""
        tests = 2 * sum((len(self.angles) + self.at_random) * len(part.sides) for part in self.probe.parts)
        return 1 - (1 - self.significance) ** (1 / max(tests, 1))

    # --- The width of a part ----------------------------------------------------------------------------------------

    def spread(self, part: Part) -> float:
        """Return how narrow a part is, in radians: for light from 30°, the distance over which the density falls to a
        half from where it is highest, in the direction in which it falls fastest, as across a line of brushed metal. Of
        the whole, that of its narrowest component counts, and of two sides that of the narrower one.
        """
        if part.component is None and len(self.probe.components) > 1:
            return min(self.spread(each) for each in self.probe.components)
        if part.name not in self._spreads:
            self._spreads[part.name] = min(_half_width(self.probe, part, side) for side in part.sides)
        return self._spreads[part.name]

    def rounding(self, part: Part) -> float:
        """Return the relative error that float32 may make in f and in the density.

        A direction is known to 6e-8, a half vector to about 1e-7, and a lobe of the width σ changes by some of them
        over σ: in its tails by ten.
        """
        return 1e-4 + 3e-6 / max(self.spread(part), 1e-6)


# --- Checks that are made again -------------------------------------------------------------------------------------


Check = Callable[[Run], Findings]
"""Yields what it finds of a BSDF."""


def anywhere(run: Run, probe: BSDFProbe) -> Run:
    """Return a run for the BSDF in colours or another variant, and for directions all over the hemisphere alone."""
    return replace(run, probe=probe, angles=(), given=None)


def failures(run: Run, checks: Iterable[Check]) -> dict[Check, list[Finding]]:
    """Return what fails of some checks, by check."""
    return {check: [finding for finding in check(run) if finding.verdict == "fail"] for check in checks}


def tell(run: Run, outcome: Outcome, failed: dict[Check, list[Finding]], where: str) -> None:
    """Add the faults that the BSDF has ``where`` it was checked again, and not as it is."""
    for check, findings in failed.items():
        if findings and all(finding.verdict != "fail" for finding in check(run)):
            first = findings[0]
            outcome.fault(f"{where}{first.check}: {first.message.rstrip('.')}", np.inf)


# --- What makes a check ---------------------------------------------------------------------------------------------


Judge = Callable[[Run, Part, Outcome], str]
"""What judges a part: it adds faults to an outcome, and returns what to say if there are none; where it raises
:class:`Skipped`, the part is."""


def of_each(parts: Callable[[BSDFProbe], list[Part]]) -> Callable[[Judge], Check]:
    """Return a decorator that makes a check of some parts of what judges one."""

    def decorated(judge: Judge) -> Check:
        @wraps(judge)
        def check(run: Run) -> Findings:
            for part in parts(run.probe):
                outcome = Outcome(judge.__name__, part.name)
                try:
                    yield outcome.finding(judge(run, part, outcome))
                except Skipped as reason:
                    yield Finding(outcome.check, part.name, "skip", str(reason))

        return check

    return decorated


of_parts = of_each(lambda probe: probe.parts)
of_whole = of_each(lambda probe: [probe.whole])


def _half_width(probe: BSDFProbe, part: Part, side: int) -> float:
    """Return the median, over the samples of the highest density for light from a side, of the distance at which that
    falls to a half."""
    wi = on_side(direction(30), side)
    samples = probe.sample(part, wi, random(1 << 12, 1))
    drawn = np.flatnonzero(samples.drawn)
    if len(drawn) < 64:
        return np.pi
    tops = drawn[np.argsort(samples.pdf[drawn])[-64:]]
    wo = samples.wo[tops].astype(np.float64)
    distances, turns = np.pi * 2.0 ** -np.arange(17, 0, -1), np.arange(8) * np.pi / 4
    across = np.cross(wo, np.roll(wo, 1, axis=1))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    tangents = np.multiply.outer(np.cos(turns), across) + np.multiply.outer(np.sin(turns), np.cross(wo, across))
    far = np.multiply.outer(np.cos(distances), wo)[:, None] + np.multiply.outer(np.sin(distances), tangents)
    around = probe.pdf(part, wi, far.reshape(-1, 3).astype(np.float32)).reshape(*far.shape[:2], len(tops))
    halved = around.min(axis=1) < 0.5 * samples.pdf[tops]
    first = np.where(halved.any(axis=0), halved.argmax(axis=0), len(distances) - 1)
    return float(np.median(distances[first]))
