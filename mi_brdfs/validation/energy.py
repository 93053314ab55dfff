"""Checks of how much a BSDF reflects, and how evenly its sampler does."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, sqrt
from typing import TYPE_CHECKING, NamedTuple

import mitsuba as mi
import numpy as np

from ..parameters.messages import listed
from ..probe.arrays import Array, interaction, luminance, numbers
from ..probe.bsdf import Part
from ..probe.directions import direction, on_side
from ..probe.variates import SHIFTS, lattice, sampling_efficiency
from . import sampling
from .incidents import named
from .outcome import Findings, Outcome
from .report import Finding
from .run import Run

if TYPE_CHECKING:
    from ..model import Model


def albedo(run: Run) -> Findings:
    """Check that no more is reflected of light from one direction than is received, in each channel of colour, to 0.1 %
    and the noise; or, where the page of the model states that it gains energy with these choices, no more than it
    states, which is noted, and a diffuse lobe beside others adds to that. So is it if diffuse and specular reflectances
    add to more than 1. With its default parameters, a plugin of ours reflects what its page says. The mean of the
    weights is taken over points that fill the space of the variates evenly; that of refracted light without the factor
    1/η² of radiance. Where the sampler is wrong, too much light is its fault: see ``weight``, ``pdf`` and ``chi2``."""
    points = lattice(12, 5)
    limits = _limits(run)
    for part in run.probe.parts or [run.probe.whole]:
        outcome, found = Outcome("albedo", part.name), []
        added = limits.diffuse if part.component is None else 0
        angles = sorted({*run.angles, 0, 45, 70, 85, 89, 89.9})
        for side, theta in ((side, theta) for side in part.sides for theta in angles):
            name, azimuth = named(theta, side), _brightest_azimuth(run, part, theta, side)
            wi = on_side(direction(theta, azimuth), side)
            samples = run.probe.sample(part, wi, points)
            weights = samples.weight * np.where(samples.weight.any(axis=1), samples.eta, 1)[:, None] ** 2
            copies = weights.reshape(SHIFTS, -1, weights.shape[1]).mean(axis=1)
            means, noises = _mean(copies)
            mean, noise = (float(value[0]) for value in _mean(luminance(copies)[:, None]))
            outcome.data[name] = {"albedo": mean, "noise": noise}
            least = np.nan_to_num(means - 5 * noises, nan=np.inf)
            k = int(np.argmax(least))
            alike = np.ptp(means) <= 1e-4 * abs(means[k])
            place = name + (f", φ = {azimuth:g}°" if azimuth != AZIMUTHS[0] else "")
            words = f"light from {place} is reflected {means[k]:.4g} times{'' if alike else f' in channel {k + 1}'}"
            found.append(Reflected(place, mean, float(least[k]), words))
            if limits.largest is not None and least[k] > (limits.largest + added) * (1 + TOLERANCE):
                fault = "its albedo is no number" if np.isnan(means[k]) else "it gains energy"
                words = f"{fault}: {words} (± {noises[k]:.1g}), more than {limits.reason}"
                outcome.fault(words, least[k], wi=wi)
        finding = _judged(part, outcome, found, limits)
        causes = sampling.weight, sampling.pdf, sampling.chi2
        if failing := sampling.failing(run, part, *causes, anew=bool(outcome.faults)):
            words = f"Not judged: mend {listed(failing, 'and')} first; only then the mean of the weights is the albedo."
            finding = Finding("albedo", part.name, "skip", words, outcome.data)
        yield finding


def _brightest_azimuth(run: Run, part: Part, theta: float, side: int) -> float:
    """Return the azimuth, of a few, of which an anisotropic part reflects most."""
    if not part.has(mi.BSDFFlags.Anisotropic):
        return AZIMUTHS[0]
    wi = on_side(direction(np.full(len(AZIMUTHS), theta), AZIMUTHS).T, side)
    means = luminance(run.probe.weights(part, wi, lattice(5, 5))).mean(axis=1)
    return float(AZIMUTHS[np.argmax(np.nan_to_num(means))])


TOLERANCE = 1e-3
"""Of float32, relatively."""
AZIMUTHS = 17 + 22.5 * np.arange(16)
"""In degrees; the first one serves where the azimuth changes nothing."""


class Reflected(NamedTuple):
    """What a part reflects of light from an angle: the luminance, and what a channel reflects at least, in words."""

    name: str
    mean: float
    least: float
    words: str


def _mean(copies: Array) -> tuple[Array, Array]:
    """Return ``(mean, standard error)`` of each column, of some copies of an estimate."""
    return copies.mean(axis=0), copies.std(axis=0, ddof=1) / sqrt(len(copies))


def _judged(part: Part, outcome: Outcome, found: list[Reflected], limits: Limits) -> Finding:
    """Return the finding on a part whose faults are known."""
    is_whole = part.component is None
    largest, most = max(found, key=lambda it: np.nan_to_num(it.mean, nan=np.inf)), max(found, key=lambda it: it.least)
    if is_whole and limits.default is not None and not abs(largest.mean - limits.default) <= 0.02 * limits.default:
        outcome.fault(f"the largest albedo is {largest.mean:.4g}, but its page says {limits.default:.4g}", 0)
    message = f"At most {largest.mean:.4g}, for light from {largest.name}." if largest.mean != 0 else "Black."
    if limits.largest is None and limits.default is None:
        return Finding("albedo", part.name, "info", message, outcome.data)
    gains = most.least > 1 + TOLERANCE
    if gains and limits.largest is not None:
        why = f"{limits.page} ({_shown(limits.largest)})" if limits.largest > 1 else "its lobes add up"
        message = f"It gains energy, as {why}: {most.words}."
    outcome.remark = limits.sums if is_whole else ""
    finding = outcome.finding(message)
    noted = is_whole and (gains or limits.sums) and not outcome.faults
    return replace(finding, verdict="note") if noted else finding


def efficiency(run: Run) -> Findings:
    """Measure η = E[w]²/E[w²] of the sampling weight w: 1 is perfect. Reported, not judged."""
    for part in run.probe.parts:
        weights = {incident.name: run.samples(part, incident).weight for incident in run.incidents(part)}
        values = {name: float(sampling_efficiency(luminance(weight))) for name, weight in weights.items()}
        told = ", ".join(f"{eta:.3f} at {name}" for name, eta in values.items() if eta)
        yield Finding("efficiency", part.name, "info", f"η = {told}." if told else "Black.", values)


# --- What a manual page says ------------------------------------------------------------------------------------------


class Limits(NamedTuple):
    """What a BSDF may reflect."""

    largest: float | None
    """The largest albedo that is allowed; None if it is not judged."""
    reason: str
    """The same in words."""
    page: str
    """Who says so if it is more than 1."""
    default: float | None
    """The largest albedo of the default parameters, if it has these and its page states it."""
    sums: str
    """What is wrong with reflectances that add to more than 1."""
    diffuse: float
    """What a diffuse lobe adds to the largest albedo that a page states for the others alone."""


def _limits(run: Run) -> Limits:
    models = run.probe.models
    own = models[0] if run.probe.is_ours else None
    is_default = run.given is not None and set(run.given) == {"type"}
    default = own.energy.default if own and own.energy and is_default else None
    sums = " ".join(dict.fromkeys(filter(None, map(_excess, models))))
    if run.conserves is not None:
        return Limits(1 if run.conserves else None, "it receives", "", default, sums, 0)
    # Of several BSDFs, blended or on two sides, each may have its part.
    stated = {model: (model.stated_albedo() if model else None) or 1 for model in models}
    brightest = max(stated, key=lambda model: stated[model])
    largest = max(stated[brightest], 1)
    page = "its page says" if own or brightest is None else f"the page of {brightest.plugins[0]} says"
    reason = f"the {_shown(largest)} that {page}" if largest > 1 else "it receives"
    return Limits(largest, reason, page, default, sums, max(map(_diffuse, models)))


def _diffuse(model: Model | None) -> float:
    """Return the diffuse reflectance beside a Fresnel term, which pages leave out of the largest albedo."""
    if model is None or not model.energy or not model.has_fresnel:
        return 0
    si = interaction([0, 0, 1])
    return sum(float(numbers(model.textures[name].eval(si), 1).max()) for name in model.named("diffuse"))


def _excess(model: Model | None) -> str:
    """Return what :meth:`Model.excess` says of the present colours that do not vary, as a sentence."""
    if model is None:
        return ""
    si = interaction([0, 0, 1])
    constant = {name: it for name, it in model.textures.items() if not it.is_spatially_varying()}
    words = model.excess({name: numbers(texture.eval(si), 1)[0] for name, texture in constant.items()})
    return f"Of {model.plugins[0]}, {words}." if words else ""


def _shown(albedo: float) -> str:
    return f"{albedo:.2f}" if isfinite(albedo) else "no limit"
