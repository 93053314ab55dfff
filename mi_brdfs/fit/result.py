"""A fitted material, what the fit says of it, and the rows of tables that the command prints and its report shows."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from statistics import median
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from ..model import EnergyWarning
from ..parameters.xml import to_xml
from ..probe.bsdf import BSDFProbe
from ..probe.directions import direction
from ..probe.sources import text_of
from ..probe.variates import sobol
from .lanes import rgb_variant
from .observations import Data

ALIKE = 1.05
"""The ratio of errors up to which two models fit about as well."""
ANGLES = 0, 20, 40, 60, 70, 80
"""The angles at which the albedo is looked at, in degrees."""
LOG2_COUNT = 10
"""Samples for each of them."""
FEW = 5
"""Pairs of directions in a highlight below which its width is a guess."""
CORRELATED = 0.95
"""The correlation from which two parameters are told to be hard to tell apart."""


class Starts(NamedTuple):
    """From where a fit was tried."""

    tried: int
    warm: int
    """Of these, plugin dicts that were given, and a published material."""
    agree: int
    """Those that ended within 2 % of the best error."""


@dataclass(frozen=True, kw_only=True)
class Fit(Data):
    """A model fitted to a material."""

    model: str
    """The plugin, with the words of its choices that are not the defaults."""
    metric: str
    """What was made as small as possible."""
    bsdf: dict[str, Any]
    """The plugin dict."""
    errors: dict[str, dict[str, float]]
    """In every metric, by name, on the pairs that were ``fitted`` and on those ``held_out``; NaN if none was."""
    sigma: dict[str, float | list[float | None] | None]
    """The standard deviation of each parameter by the noise of the data; None at the end of a range, and where the data
    do not tell. It knows nothing of what all data have in common, as that negative ones have no weight."""
    correlations: dict[str, dict[str, float]]
    """Of the fitted numbers: "alpha", "diffuse_reflectance.r" …"""
    undetermined: list[str]
    """Numbers that can change together without a change of the values, or whose standard deviation is larger than their
    range, or all, if no more values were fitted."""
    bounds: list[str]
    """Numbers that ended at an end of their range."""
    starts: Starts
    bic: float
    """n ln(E²) + k ln n, for the error E of the fit, n values and k parameters: the lower, the better."""
    pairs: int
    """Pairs of directions that were fitted; about as many were held out."""
    in_highlight: int
    """The pairs whose value exceeds half of that of the mirror direction."""
    fixed: tuple[str, ...] = ()
    """Parameters that isotropic data say nothing about, left at their defaults."""
    flip: float | None = None
    """The FLIP error of a picture of it, where it was looked at: :func:`mi_brdfs.fit.appearance.by_flip`."""

    @property
    def held_out(self) -> float:
        """The error on what was held out, in the fitted metric."""
        return self.errors[self.metric]["held_out"]

    @property
    def error(self) -> float:
        """By which fits are ranked: the FLIP error where it was looked at, and else the held-out one."""
        return self.held_out if self.flip is None else self.flip

    @property
    def resolved(self) -> bool:
        """Whether the highlight is wide enough for the data to tell its width."""
        return self.in_highlight >= FEW

    @cached_property
    def albedo(self) -> float:
        """The largest directional albedo of any channel, at angles up to 80°."""
        turns = (0, 45, 90) if self.anisotropic else (0,)
        return float(self._albedos([direction(theta, phi) for theta in ANGLES for phi in turns]).max())

    def albedos(self, theta_i: float, phi_i: float = 0) -> list[float]:
        """Return the directional albedo of each channel, linear sRGB, at an angle of incidence in degrees."""
        return [float(albedo) for albedo in self._albedos([direction(theta_i, phi_i)])[0]]

    @cached_property
    def scattered(self) -> list[float]:
        """Its own albedo at each angle of ``scatter``, the mean of the channels."""
        if not self.scatter:
            return []
        return [float(it) for it in self._albedos([direction(theta) for theta, _, _ in self.scatter]).mean(axis=1)]

    def _albedos(self, wi: list[np.ndarray]) -> np.ndarray:
        with rgb_variant(), warnings.catch_warnings():
            warnings.simplefilter("ignore", EnergyWarning)  # the albedo tells
            probe = BSDFProbe(mi.load_dict(self.bsdf))
            return probe.weights(probe.whole, np.array(wi), sobol(LOG2_COUNT, 1)).mean(axis=1)

    def remarks(self, shown: bool = False) -> list[str]:
        """Return what to know of this fit, in sentences; without what tables say if these are ``shown``."""
        found = []
        if self.albedo > 1:
            found.append(f"The albedo is {self.albedo:.3g}: more light is reflected than arrives.")
        if not self.resolved:
            found.append(f"The highlight is narrower than the data resolve: {self.in_highlight} pairs lie in it.")
        if self.undetermined and not shown:
            found.append(f"Not determined by the data: {whole(self.undetermined)}.")
        if self.bounds and not shown:
            found.append(f"At the end of the range: {whole(self.bounds)}.")
        close = {tuple(sorted(pair)) for a, row in self.correlations.items() for b, r in row.items()
                 if abs(r) > CORRELATED and len(pair := {_colour(a), _colour(b)}) > 1}  # fmt: skip
        if close:
            pairs = sorted(close)
            name = pairs[0][1]
            fixed = shlex.quote(f"{name}={text_of(self.bsdf[name])}")
            told = f"other values of both fit about as well; fix one that is known, as in -D {fixed}"
            found.append(f"Hard to tell apart: {', '.join(map(' and '.join, pairs))}: {told}.")
        for (theta, stated, values), own in () if shown else zip(self.scatter, self.scattered, strict=True):
            if abs(own - stated) > 0.1 * stated:
                told = f"the file states {stated:.3g}, its values integrate to {values:.3g}"
                found.append(f"At {theta:g}° the albedo is {own:.3g}; {told}.")
        if self.fixed:
            found.append(f"Isotropic data leave at the default: {', '.join(self.fixed)}.")
        if self.negative or self.missing:
            found.append(f"Without weight: {self.negative} negative and {self.missing} missing values.")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return it as what JSON can hold; ``bsdf`` is the dict for ``mi.load_dict``."""
        scatter = [
            {"theta_i": theta, "stated": stated, "values": values, "fit": own}
            for (theta, stated, values), own in zip(self.scatter, self.scattered, strict=True)
        ]
        errors = {
            name: {part: value if np.isfinite(value) else None for part, value in parts.items()}
            for name, parts in self.errors.items()
        }
        words = {"albedo": self.albedo, "resolved": self.resolved, "remarks": self.remarks()}
        return asdict(self) | {"starts": self.starts._asdict(), "errors": errors, "scatter": scatter} | words

    def to_xml(self, id: str = "") -> str:
        """Return the BSDF as XML, to paste into a scene; with an id, to be a file of its own."""
        return to_xml(self.bsdf, id)


class Median(NamedTuple):
    """A model over several materials."""

    error: float
    """By which models are ranked: the FLIP error where pictures were compared, and else the held-out one."""
    held_out: float
    fitted: float
    model: str
    files: int
    best_in: int
    flip: float | None


def _colour(number: str) -> str:
    """Return the parameter of a number: the name without the channel."""
    return number.partition(".")[0]


def whole(numbers: Sequence[str]) -> str:
    """Return names of numbers in words: colours by one name, with the channels that it is about if not with all."""
    channels = {it: [number[-1] for number in numbers if number.startswith(f"{it}.")] for it in map(_colour, numbers)}
    return ", ".join(it if len(own) in (0, 3) else f"{it} ({', '.join(own)})" for it, own in channels.items())


def notes(fit: Fit, best: Fit) -> str:
    """Return whether a fit is about as good as the best, and what of it calls for caution, in words."""
    words = ["about as good"] * (fit is not best and fit.error <= ALIKE * best.error)
    words += ["albedo above 1"] * (fit.albedo > 1) + ["unresolved"] * (not fit.resolved)
    return ", ".join(words + ([f"at its limit: {whole(fit.bounds)}"] if fit.bounds else []))


def number(value: float | None) -> str:
    """Return a number as text, empty if there is none."""
    return "" if value is None or not np.isfinite(value) else f"{value:.4g}"


def values(fit: Fit) -> list[tuple[str, float, str]]:
    """Return ``(name, value, how sure it is)`` of each fitted number: of a colour "name.r", ".g" and ".b"."""
    found = []
    for name, sigma in fit.sigma.items():
        value = fit.bsdf[name]
        numbers = value["value"] if isinstance(value, dict) else [value]
        channels = [f".{channel}" for channel in "rgb"] if len(numbers) == 3 else [""]
        deviations = sigma if isinstance(sigma, list) else [sigma]
        for k, (channel, number, deviation) in enumerate(zip(channels, numbers, deviations, strict=True)):
            sure = "" if deviation is None else f"± {deviation:.2g}"
            if name + channel in fit.bounds:
                sure = "at its limit"
            elif name + channel in fit.undetermined:
                sure = "undetermined"
            found.append((name + channel if k == 0 else channel, number, sure))
    return found


def medians(ranked: Sequence[Sequence[Fit]]) -> list[Median]:
    """Return the medians of each model's errors over materials, whose fits are ordered by rank; the best first."""
    fits = [it for own in ranked for it in own]
    winners = [own[0].model for own in ranked]
    found = []
    for model in dict.fromkeys(it.model for it in fits):
        own = [it for it in fits if it.model == model]
        held_out = median(it.held_out for it in own)
        fitted = median(it.errors[it.metric]["fitted"] for it in own)
        seen = [it.flip for it in own if it.flip is not None]
        flip = median(seen) if seen else None
        error = held_out if flip is None else flip
        found.append(Median(error, held_out, fitted, model, len(own), winners.count(model), flip))
    return sorted(found, key=lambda it: it.error)
