"""The efficiency of samplers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import mitsuba as mi
import numpy as np

from mi_brdfs.bench.comparison import ANGLES, Sampling, sampling
from mi_brdfs.probe.bsdf import BSDFProbe

from .cases import CASES, Case, Plugin
from .figure import Figure, Target

WHOLE, GAIN = "whole", "gain"
UP_TO_60 = {"walter alpha 0.5": 0.91, "walter alpha 1": 0.97}
"""Targets of ``walter`` beyond those of all models."""


def efficiency(cases: Sequence[Case] = CASES) -> Iterator[Figure]:
    """Measure η; anisotropic parts count with the least of three azimuths.

    Targets: 0.95 for each lobe up to 60° and 0.85 beyond; for the mixture of several lobes 0.9 of their mean, weighted
    by their albedos; no less than the built-in's; for ``walter`` 0.91 and 0.97 up to 60°; and for ``burley``, on
    average over all its sets and angles, 1.1 of ``principled``.
    """
    gains: dict[str, list[float]] = {}
    for case in cases:
        ours = samplings(case.bsdf)
        theirs = samplings(case.builtin)[WHOLE].least() if case.same else np.empty(0)
        lobes = {name: part for name, part in ours.items() if name != WHOLE and part.albedo.any()}
        if len(lobes) < 2:
            lobes = {}  # the whole is a single lobe
        for name, part in {WHOLE: ours[WHOLE], **lobes}.items():
            subject = case.name if name == WHOLE else f"{case.name}, {name}"
            for k, (angle, eta) in enumerate(zip(ANGLES, part.least(), strict=True)):
                if name == WHOLE and lobes:
                    targets = [Target("≥", 0.9 * mean_of_lobes(part, lobes.values(), k), "0.9 of its lobes' mean")]
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
            for angle, eta in zip(ANGLES, theirs, strict=True):
                yield Figure("efficiency", case.beside, f"{angle}°", float(eta))
    for pair, of_sets in gains.items():
        target = (Target("≥", 1.1, "on average"),) if pair == "burley over principled" else ()
        yield Figure("efficiency", pair, GAIN, float(np.mean(of_sets)), targets=target)


def mean_of_lobes(whole: Sampling, lobes: Iterable[Sampling], k: int) -> float:
    """Return the mean efficiency of the lobes, weighted by their albedos, at an angle and at the whole's worst azimuth
    there."""
    worst = int(np.argmin(whole.eta[k]))
    albedo, eta = np.array([(lobe.albedo[k, worst], lobe.eta[k, worst]) for lobe in lobes]).T
    return float(albedo @ eta / albedo.sum())


def samplings(bsdf: Plugin) -> dict[str, Sampling]:
    """Return the statistics of the samples of the whole BSDF, and of each component if there are several."""
    probe = BSDFProbe(mi.load_dict(bsdf))
    return {part.name: sampling(probe, part) for part in probe.parts}
