"""Running checks on a BSDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from ..given import angles_of_incidence, check_given, described, load_described, several
from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.bsdf import BSDFProbe
from ..probe.directions import angles_of, scattered
from ..probe.sources import name_of
from ..probe.variates import random
from ..variants import activated, is_measurable
from . import (
    components,
    contract,
    deltas,
    derivatives,
    energy,
    polarization,
    sampling,
    spectral,
    textures,
    updates,
    values,
)
from .incidents import SCATTERED
from .outcome import Findings, Outcome, Skipped, told
from .report import Finding, Report
from .run import Check, Run

CHECKS: dict[str, Check] = {
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
        deltas.deltas,
        textures.textures,
        derivatives.gradients,
        updates.updates,
        updates.recompiles,
        contract.active,
        contract.mode,
        contract.recorded,
        contract.calls,
        contract.null,
        contract.reflectance,
        spectral.colours,
        spectral.spectral,
        polarization.polarization,
    )
}
"""The checks by name, in the order in which they run; the docstring of each says what it checks and how strictly."""

VARIANT = "llvm_ad_rgb"
"""What a plugin dict is checked in where the active variant does not do."""
ANGLES: tuple[float, ...] = (0, 30, 60, 80)
"""Of incidence, in degrees, by default."""
SIGNIFICANCE = 0.01
"""By default."""
AGAINST_SEED = 91
FAINT = 1e-6
"""Values below this part of the largest one for an angle of incidence differ as much as this part does."""
NO_COMPONENTS = "component_count() is 0: put the flags of each component into m_components."
DELTA = "A delta function, which has no values: deltas judges its samples."


def check(
    bsdf: str | dict[str, Any] | mi.BSDF,
    *,
    name: str | None = None,
    angles: float | Iterable[float] = ANGLES,
    significance: float = SIGNIFICANCE,
    only: str | Iterable[str] | None = None,
    conserves: bool | None = None,
    on_progress: Callable[[], None] = lambda: None,
) -> Report:
    """Check any BSDF: that its sampler draws what its density says, that its parts fit together, that its
    values make sense and that it can be differentiated.

    A plugin dict is checked in the active variant if that is vectorized and unpolarized, and else in ``llvm_ad_rgb``.
    Random numbers are fixed: the same BSDF gives the same report.

    Args:
        bsdf: a plugin dict, the name of a plugin or of a published material, the path of a measured file, or a loaded
            BSDF, which must belong to the active variant.
        name: what the report calls it; by default its type.
        angles: of incidence, in degrees, in [0, 90): one or several.
        significance: the probability, in (0, 1), that a BSDF without faults fails one of the statistical tests of this
            call.
        only: the name of the check to run, or several; by default all of :data:`CHECKS`.
        conserves: whether to judge that at most what is received is reflected. By default a model may gain the energy
            that its manual page states, and nothing else may gain any.
        on_progress: called after each check.

    Raises:
        ValueError: for what is no BSDF or cannot be loaded, an unknown name of a check, an angle or a significance out
            of range, or a loaded BSDF that cannot be checked in the active variant.
    """
    wanted = list(CHECKS) if only is None else several(only)
    if unknown := [word for word in wanted if word not in CHECKS]:
        raise ValueError(f"There is no check {unknown[0]!r}; there are {', '.join(CHECKS)}.")
    angles = angles_of_incidence(angles)
    if not (isinstance(significance, (int, float)) and 0 < significance < 1):
        raise ValueError(f"The significance must be a number in (0, 1), not {significance!r}.")
    with _measurable(bsdf):
        bsdf = described(bsdf)
        probe, given = _probe(bsdf), bsdf if isinstance(bsdf, dict) else None
        run = Run(probe, angles, significance, conserves, given)
        run.found += [Finding("components", part.name, "skip", DELTA) for part in probe.deltas]
        if not probe.bsdf.component_count():
            run.found.append(Finding("components", "whole", "fail", NO_COMPONENTS))
        for word in wanted:
            run.found += list(_found(word, run))
            on_progress()
        return Report(name or _name(bsdf), run.found, list(run.shown_trials()))


def compare(
    bsdf: str | dict[str, Any] | mi.BSDF,
    other: str | dict[str, Any] | mi.BSDF,
    *,
    name: str | None = None,
    other_name: str | None = None,
    angles: float | Iterable[float] = ANGLES,
) -> Report:
    """Compare what ``eval`` returns for two BSDFs: at the angles of incidence and all over, towards directions all over
    and those that each draws, at points all over textures. They are the same if the largest relative difference is at
    most what float32 rounds by: 1e-4, or more for narrow lobes (1.9e-3 for α = 1e-3). What is less than a millionth of
    the largest value counts as that much.

    The arguments are those of :func:`check`. The report has one finding, ``against``, and another one if there are
    delta functions, which are not compared.

    Raises:
        ValueError: as :func:`check` does.
    """
    angles = angles_of_incidence(angles)
    with _measurable(bsdf, other):
        bsdf, other = described(bsdf), described(other)
        run = Run(_probe(bsdf), angles, SIGNIFICANCE, None, None)
        return Report(name or _name(bsdf), list(_against(run, _probe(other), other_name or _name(other))))


def _against(run: Run, other: BSDFProbe, name: str) -> Findings:
    """Check that another BSDF, called ``name``, has the same values: see :func:`compare`."""
    outcome, probes = Outcome("against", name), (run.probe, other)
    if not all(probe.components for probe in probes):
        yield Finding("against", name, "skip", "A delta function has no values to compare.")
        return
    if any(probe.deltas for probe in probes):
        yield Finding("against", name, "note", "Delta functions have no values, and are not compared.")
    tolerance = max(run.rounding(run.probe.whole), replace(run, probe=other).rounding(other.whole))
    sides = tuple(sorted({side for probe in probes for side in probe.whole.sides}, reverse=True))
    part = run.probe.whole._replace(sides=sides)
    largest, words, at = 0.0, "both are black", {}
    for incident in run.views(part):
        lanes = np.tile(np.arange(SCATTERED), 3)
        drawn = [probe.sample(probe.whole, incident.wi, random(SCATTERED, AGAINST_SEED)).wo for probe in probes]
        wo = np.concatenate([scattered(SCATTERED, AGAINST_SEED, (1, -1)), *drawn])
        uv = np.random.default_rng(AGAINST_SEED).random((len(wo), 2))
        ours, theirs = (probe.eval(probe.whole, incident.at(lanes), wo, uv) for probe in probes)
        scale = np.maximum(ours, theirs)
        error = np.nan_to_num(abs(ours - theirs) / np.maximum(scale, FAINT * np.nanmax(scale) + 1e-12), nan=np.inf)
        k, channel = np.unravel_index(int(np.argmax(error)), error.shape)
        if error[k, channel] > largest or (scale.any() and not largest):
            largest = float(error[k, channel])
            light = incident.name if incident.wi.ndim == 1 else angles_of(incident.at(lanes[k]))
            words = (
                f"the largest relative difference is {largest:.2g}, for light from {light} towards "
                f"{angles_of(wo[k])}: {ours[k, channel]:.6g}, but {theirs[k, channel]:.6g} of {name}"
            )
            at = {"wi": incident.at(lanes[k]), "wo": wo[k], "uv": uv[k]}
    outcome.data = {"difference": largest, "tolerance": tolerance}
    words += f"; float32 rounds by up to {tolerance:.2g}"
    if largest > tolerance:
        outcome.fault(words, largest, **at)
    yield outcome.finding(f"{words[0].upper()}{words[1:]}.")


def _measurable(*bsdfs: str | dict[str, Any] | mi.BSDF) -> AbstractContextManager:
    """Return a context in whose variant some BSDFs can be measured."""
    for bsdf in bsdfs:
        check_given(bsdf)
    if is_measurable(mi.variant()):
        return nullcontext()
    if not all(isinstance(bsdf, (str, dict)) for bsdf in bsdfs):
        raise ValueError(f"A loaded BSDF of {mi.variant()} cannot be checked: load it in {VARIANT} or another "
                         "vectorized and unpolarized variant, or give its dict.")  # fmt: skip
    return activated(VARIANT)


def _probe(bsdf: dict[str, Any] | mi.BSDF) -> BSDFProbe:
    return BSDFProbe(load_described(bsdf))


def _name(bsdf: dict[str, Any] | mi.BSDF) -> str:
    return str(bsdf["type"]) if isinstance(bsdf, dict) else name_of(bsdf)


def _found(word: str, run: Run) -> Findings:
    """Yield the findings of a check; if it is skipped or raises, that is another."""
    try:
        # What is not finite is for the check to tell.
        with unwrapped_ctrl_c(), np.errstate(invalid="ignore"):
            yield from CHECKS[word](run)
    except Skipped as reason:
        yield Finding(word, "whole", "skip", str(reason))
    except Exception as error:
        yield Finding(word, "whole", "fail", f"It could not be checked to the end, as it raised {told(error)}.")
