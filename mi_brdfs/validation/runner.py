"""Running checks on a BSDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from typing import Any

import mitsuba as mi

from ..measure.probe import BSDFProbe
from ..measure.sources import name_of
from ..variants import is_measurable
from . import components, contract, derivatives, energy, recompiles, sampling, spectral, textures, values
from .outcome import Findings, told
from .report import Finding, Report
from .run import Run

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
        energy.albedo,
        energy.efficiency,
        components.components,
        components.flags,
        textures.textures,
        derivatives.gradients,
        recompiles.recompiles,
        contract.active,
        contract.mode,
        contract.reflectance,
        spectral.spectral,
    )
}
"""The checks by name, in the order in which they run; the docstring of each says what it checks and how strictly."""

VARIANT = "llvm_ad_rgb"
"""What a plugin dict is checked in where the active variant does not do."""


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
    """Check any BSDF: that its sampler draws what its density says, that its parts fit together, that its
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
        probe = BSDFProbe(bsdf if loaded else mi.load_dict(bsdf))
        name = name or (bsdf["type"] if not loaded else name_of(probe.bsdf))
        run = Run(probe, tuple(angles), significance, conserves, None if loaded else bsdf)
        findings = [
            Finding("components", f"component {k}", "skip", "A delta function, which cannot be evaluated or tested.")
            for k in probe.deltas
        ]
        for word in wanted:
            if probe.parts:
                findings += _found(word, run)
            on_progress()
        return Report(name, findings, list(run.shown_trials()))


def _found(word: str, run: Run) -> Findings:
    """Yield the findings of a check; if it raises, that is another."""
    try:
        yield from CHECKS[word](run)
    except Exception as error:
        yield Finding(word, "whole", "fail", f"It could not be checked to the end, as it raised {told(error)}.")
