"""Checks of how much a BSDF reflects, and how evenly its sampler does."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite, sqrt
from typing import Any, NamedTuple

import numpy as np

from ..measure.arrays import luminance
from ..measure.directions import direction, on_side
from ..measure.probe import Part
from ..measure.variates import SHIFTS, lattice, sampling_efficiency
from .incidents import Incident, named
from .outcome import Findings, Outcome
from .report import Finding
from .run import Run


def albedo(run: Run) -> Findings:
    """Measure what is reflected of light from one direction: the mean of the weights, over points that fill the space
    of the variates evenly. Judged if a limit is known, in each channel of colour, to 0.1 % and the noise: for a plugin
    of ours each component by the model's energy class, and the whole of a plugin with its default parameters by its
    manual page."""
    points = lattice(12, 5)
    limit, limit_reason, default = _limits(run)
    for part in run.probe.parts:
        judged = isfinite(limit) and (run.conserves or part.component is not None or len(run.probe.parts) == 1)
        outcome, largest = Outcome("albedo", part.name), (0.0, "")
        for name, wi in _white_furnace(run, part):
            weights = run.probe.sample(part, wi, points).weight
            copies = weights.reshape(SHIFTS, -1, weights.shape[1]).mean(axis=1)
            copies = np.concatenate([luminance(copies)[:, None], copies], axis=1)
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


def _white_furnace(run: Run, part: Part) -> Iterator[Incident]:
    for side in part.sides:
        for theta in sorted({*run.angles, 0, 45, 70, 85, 89, 89.9}):
            yield Incident(named(theta, side), on_side(direction(theta, 17), side))


def efficiency(run: Run) -> Findings:
    """Measure η = E[w]²/E[w²] of the sampling weight w: 1 is perfect. Reported, not judged."""
    for part in run.probe.parts:
        weights = {incident.name: run.samples(part, incident).weight for incident in run.incidents(part)}
        values = {name: float(sampling_efficiency(luminance(weight))) for name, weight in weights.items()}
        told = ", ".join(f"{eta:.3f} at {name}" for name, eta in values.items() if eta)
        yield Finding("efficiency", part.name, "info", f"η = {told}." if told else "Black.", values)


# --- What a manual page says ------------------------------------------------------------------------------------------


class Limits(NamedTuple):
    """What a BSDF may reflect: what the manual page of a plugin of ours says of its configuration."""

    largest: float
    """The largest albedo; infinite if no limit is known, or none exists."""
    reason: str
    """The same in words."""
    default: float | None
    """The largest albedo of the default parameters, if it has these and they are known."""


def _limits(run: Run) -> Limits:
    model = getattr(run.probe.bsdf, "model", None)
    energy = getattr(model, "energy", None)
    is_default = run.given is not None and set(run.given) == {"type"}
    measured = energy.default if energy is not None and is_default else None
    if run.conserves is not None:
        return Limits(1 if run.conserves else inf, "it receives", measured)
    if energy is None:
        return Limits(inf, "", None)
    largest = min((albedo for given, albedo in energy.largest if _applies(given, model)), default=inf)
    reason = "it receives" if largest <= 1 else f"the {largest:g} times that the manual page states"
    return Limits(max(largest, 1), reason, measured)


def _applies(given: dict[str, Any], model: Any) -> bool:
    """Return whether a configuration on the page includes the model's. One that fixes numbers is taken not to."""
    chosen = model.parameters.chosen
    return all(
        chosen.get(name) in (value if isinstance(value, tuple) else (value,)) for name, value in given.items()
    ) and not any(isinstance(value, float) for value in given.values())
