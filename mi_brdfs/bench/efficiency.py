"""Efficiency: how much of a sample's work is not lost to noise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import mitsuba as mi
import numpy as np

from ..validation.sampling import variates
from ..validation.subject import Part, Subject, brightness, direction, interaction, numbers
from . import sizes
from .cases import Plugin
from .report import Figure, Target

WHOLE, GAIN = "whole", "gain"
UP_TO_60 = {"walter alpha 0.5": 0.91, "walter alpha 1": 0.97}
"""What is asked of ``walter`` beyond the targets of all."""


class Sampling(NamedTuple):
    """What the samples of a part say: arrays over the angles and azimuths."""

    albedo: np.ndarray
    eta: np.ndarray
    """0 where the part is black."""

    def least(self) -> np.ndarray:
        """Over the azimuths."""
        return self.eta.min(axis=1)


def efficiency(run) -> Iterator[Figure]:
    """η = E[w]²/E[w²] of the luminance w of the weights that ``sample`` returns, those of zero counted: 1 is perfect,
    and 1/η - 1 the relative variance of one sample under uniform light. Of anisotropic parts it is the least over three
    azimuths. From points that fill the space of the variates evenly: good to 0.001.

    Targets: 0.95 for each lobe up to 60° and 0.85 beyond; for the mixture of several lobes 0.9 of their mean, weighted
    by what they reflect; no less than the built-in's; for ``walter`` 0.91 and 0.97 up to 60°; and for ``burley``, on
    average over all its sets and angles, 1.1 of ``principled``.
    """
    gains: dict[str, list[float]] = {}
    for case in run.steps(run.cases):
        ours = sampling(case.bsdf)
        theirs = sampling(case.builtin)[WHOLE].least() if case.same else None
        lobes = {name: part for name, part in ours.items() if name != WHOLE and part.albedo.any()}
        if len(lobes) < 2:
            lobes = {}  # the whole is a single lobe
        for name, part in {WHOLE: ours[WHOLE], **lobes}.items():
            subject = case.name if name == WHOLE else f"{case.name}, {name}"
            for k, (angle, eta) in enumerate(zip(sizes.ANGLES, part.least(), strict=True)):
                if name == WHOLE and lobes:
                    targets = [Target("≥", 0.9 * _mean(part, lobes.values(), k), "0.9 of its lobes' mean")]
                else:
                    targets = [Target("≥", 0.95 if angle <= 60 else 0.85, "each lobe")]
                if name == WHOLE and case.same:
                    targets.append(Target("≥", float(theirs[k]), f"that of {case.builtin['type']}"))
                if name == WHOLE and case.name in UP_TO_60 and angle <= 60:
                    targets.append(Target("≥", UP_TO_60[case.name], "walter up to 60°"))
                yield Figure("efficiency", subject, f"{angle}°", float(eta), targets=tuple(targets))
        if case.same:
            gain = float(np.mean(ours[WHOLE].least() / theirs))
            gains.setdefault(f"{case.bsdf['type']} over {case.builtin['type']}", []).append(gain)
            yield Figure("efficiency", case.name, GAIN, gain)
            for angle, eta in zip(sizes.ANGLES, theirs, strict=True):
                yield Figure("efficiency", case.beside, f"{angle}°", float(eta))
    for pair, of_sets in gains.items():
        targets = (Target("≥", 1.1, "on average"),) if pair == "burley over principled" else ()
        yield Figure("efficiency", pair, GAIN, float(np.mean(of_sets)), targets=targets)


def _mean(whole: Sampling, lobes: Iterable[Sampling], k: int) -> float:
    """The mean efficiency of the lobes, weighted by what they reflect, at an angle and at the whole's worst azimuth
    there."""
    worst = int(np.argmin(whole.eta[k]))
    albedo, eta = np.array([(lobe.albedo[k, worst], lobe.eta[k, worst]) for lobe in lobes]).T
    return float(albedo @ eta / albedo.sum())


def sampling(bsdf: Plugin) -> dict[str, Sampling]:
    """What samples say of the whole BSDF, and of each component if there are several."""
    subject = Subject(mi.load_dict(bsdf), sizes.ANGLES)
    return {part.name: _sampling(subject.bsdf, part) for part in subject.parts}


def _sampling(bsdf: mi.BSDF, part: Part) -> Sampling:
    azimuths = sizes.AZIMUTHS if part.has(mi.BSDFFlags.Anisotropic) else sizes.AZIMUTHS[:1]
    directions = np.array([direction(theta, phi) for theta in sizes.ANGLES for phi in azimuths])
    points = variates(sizes.LOG2_POINTS, 1)
    wi, repeated = np.repeat(directions, len(points), axis=0), np.tile(points, (len(directions), 1))
    u, v = mi.Float(repeated[:, 0].copy()), mi.Point2f(np.ascontiguousarray(repeated[:, 1:].T))
    _, weight = bsdf.sample(part.context, interaction(wi), u, v, True)
    w = brightness(numbers(weight, len(wi))).reshape(len(sizes.ANGLES), len(azimuths), -1)
    albedo, squares = w.mean(axis=2), (w**2).mean(axis=2)
    eta = albedo**2 / np.where(squares > 0, squares, 1)
    full = len(sizes.ANGLES), len(sizes.AZIMUTHS)
    return Sampling(np.broadcast_to(albedo, full), np.broadcast_to(eta, full))
