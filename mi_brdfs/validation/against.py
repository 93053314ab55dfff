"""The comparison of two BSDFs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..probe.bsdf import BSDFProbe
from ..probe.directions import angles_of, scattered
from ..probe.variates import random
from .incidents import SCATTERED, all_over, incidents
from .outcome import Outcome
from .report import Finding
from .run import Run

SEED = 91
FAINT = 1e-6
"""Values below this part of the largest one for an angle of incidence differ as much as this part does."""


def against(run: Run, other: BSDFProbe, name: str) -> Finding:
    """Check that another BSDF, called ``name``, has the same values: see :func:`mi_brdfs.validation.compare`."""
    outcome, probes = Outcome("against", name), (run.probe, other)
    if not all(probe.components for probe in probes):
        return Finding("against", name, "skip", "A delta function has no values to compare.")
    tolerance = max(run.rounding(run.probe.whole), replace(run, probe=other).rounding(other.whole))
    sides = tuple(sorted({side for probe in probes for side in probe.whole.sides}, reverse=True))
    part = run.probe.whole._replace(sides=sides)
    largest, told, at = 0.0, "both are black", {}
    for incident in [*incidents(part, run.angles), all_over(part)]:
        wi, lanes = incident.wi, np.tile(np.arange(SCATTERED), 3)
        drawn = [probe.sample(probe.whole, wi, random(SCATTERED, SEED)).wo for probe in probes]
        wo = np.concatenate([scattered(SCATTERED, SEED, (1, -1)), *drawn])
        ours, theirs = (probe.eval(probe.whole, incident.at(lanes), wo) for probe in probes)
        scale = np.maximum(ours, theirs)
        error = np.nan_to_num(abs(ours - theirs) / np.maximum(scale, FAINT * np.nanmax(scale) + 1e-12), nan=np.inf)
        k, channel = np.unravel_index(int(np.argmax(error)), error.shape)
        if error[k, channel] > largest or (scale.any() and not largest):
            largest = float(error[k, channel])
            told = (
                f"the largest relative difference is {largest:.2g}, for light from {incident.of(lanes[k])} towards "
                f"{angles_of(wo[k])}: {ours[k, channel]:.6g}, but {theirs[k, channel]:.6g} of {name}"
            )
            at = {"wi": incident.vector(lanes[k]), "wo": wo[k]}
    outcome.data = {"difference": largest, "tolerance": tolerance}
    told += f"; float32 rounds by up to {tolerance:.2g}"
    if largest > tolerance:
        outcome.fault(told, largest, **at)
    return outcome.finding(f"{told[0].upper()}{told[1:]}.")
