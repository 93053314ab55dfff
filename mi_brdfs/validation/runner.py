"""Running checks on a BSDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

import mitsuba as mi

from ..variants import is_measurable
from . import components, contract, derivatives, sampling, spectral, textures, values
from .energy import energy_limits
from .outcome import Findings, told
from .report import Finding, Report
from .subject import SCATTERED, Incident, Part, Samples, Subject, random

CHECKS: dict[str, Callable[[Run], Findings]] = {
    check.__name__: check
    for check in (
        values.finite,
        values.horizon,
        values.support,
        values.eval_pdf,
        values.reciprocity,
        values.continuity,
        sampling.weight,
        sampling.pdf,
        sampling.chi2,
        sampling.albedo,
        sampling.efficiency,
        components.components,
        components.flags,
        textures.textures,
        derivatives.gradients,
        derivatives.recompiles,
        contract.active,
        contract.mode,
        contract.reflectance,
        spectral.spectral,
    )
}
"""The checks by name, in the order in which they run; the docstring of each says what it checks and how strictly."""

VARIANT = "llvm_ad_rgb"
"""What a plugin dict is checked in where the active variant does not do."""


@dataclass
class Run:
    """One call of :func:`check`: what the checks share."""

    subject: Subject
    significance: float
    tests: int
    """How many statistical tests there are in all."""
    conserves: bool | None
    """Whether the whole is judged to conserve energy; None if its manual page says so or not."""
    given: dict | None
    """The dict that the BSDF was given as, if it was."""
    trials: dict[str, tuple[list, list]] = field(default_factory=dict)
    """Of the sampler, by the name of the part, once they are made: for the directions that were asked for, and for some
    at random."""
    _samples: dict = field(default_factory=dict)

    def samples(self, part: Part, incident: Incident) -> Samples:
        """Samples for a direction of incidence, the same for every check."""
        key = part.name, incident.name
        if key not in self._samples:
            self._samples[key] = self.subject.sample(part, incident.wi, random(SCATTERED, 11))
        return self._samples[key]

    @property
    def energy(self):
        default = self.given is not None and set(self.given) == {"type"}
        return energy_limits(self.subject.bsdf, self.conserves, default)


def check(
    bsdf: dict[str, Any] | mi.BSDF,
    *,
    name: str | None = None,
    angles: Iterable[float] = (0, 30, 60, 80),
    significance: float = 0.01,
    only: Iterable[str] | None = None,
    conserves: bool | None = None,
    on_progress: Callable[[], None] = lambda: None,
) -> Report:
    """Check a BSDF, of whomever: that its sampler draws what its density says, that its parts fit together, that its
    values make sense and that it can be differentiated.

    A plugin dict is checked in the active variant if that is vectorized and unpolarized, and else in ``llvm_ad_rgb``.
    Random numbers are fixed: the same BSDF gives the same report.

    Args:
        bsdf: a plugin dict, or a loaded BSDF, which must belong to the active variant.
        name: what the report calls it; by default its type.
        angles: of incidence, in degrees.
        significance: the probability that a BSDF without faults fails one of the statistical tests of this call.
        only: the names of the checks to run, by default all of :data:`CHECKS`.
        conserves: judge whether the whole reflects at most what it receives; by default plugins of ours are judged by
            the class that their manual page states, and others are not.
        on_progress: called after each check.

    Raises:
        ValueError: for an unknown name of a check, or a loaded BSDF that cannot be checked in the active variant.
    """
    wanted = list(CHECKS) if only is None else list(only)
    if unknown := [word for word in wanted if word not in CHECKS]:
        raise ValueError(f"There is no check {unknown[0]!r}; there are {', '.join(CHECKS)}.")
    loaded = not isinstance(bsdf, dict)
    if loaded and not is_measurable(mi.variant()):
        raise ValueError(f"A loaded BSDF of {mi.variant()} cannot be checked: load it in {VARIANT} or another "
                         "vectorized and unpolarized variant, or give its dict.")  # fmt: skip
    with nullcontext() if is_measurable(mi.variant()) else mi.variant_context(VARIANT):
        subject = Subject(bsdf if loaded else mi.load_dict(bsdf), tuple(angles))
        name = name or (bsdf["type"] if not loaded else name_of(subject.bsdf))
        tests = max(1, sampling.tests(subject))
        run = Run(subject, significance, tests, conserves, None if loaded else bsdf)
        findings = [
            Finding("components", f"component {k}", "skip", "A delta function, which cannot be evaluated or tested.")
            for k in subject.deltas
        ]
        for word in wanted:
            if subject.parts:
                findings += _found(word, run)
            on_progress()
        return Report(name, findings, sampling.shown(run))


def _found(word: str, run: Run) -> Findings:
    """The findings of a check; if it raises, that is another."""
    try:
        yield from CHECKS[word](run)
    except Exception as error:
        yield Finding(word, "whole", "fail", f"It could not be checked to the end, as it raised {told(error)}.")


def name_of(bsdf: mi.BSDF) -> str:
    """The id of a BSDF, or the name of its class."""
    kind = type(bsdf).__name__
    return bsdf.id() or (bsdf.class_name() if kind == "BSDF" else kind)
