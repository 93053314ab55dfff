"""The check that rgb and spectral variants agree."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from ..measure.arrays import numbers
from ..measure.directions import angles_of, hemisphere, on_side
from ..measure.probe import BSDFProbe
from ..measure.variates import random
from .outcome import Findings, Outcome, told
from .report import Finding
from .run import Run

COUNT = 1000
TOLERANCE = 5e-3
"""Mitsuba fits spectra to rgb colours to about a thousandth."""
BRIGHT = 2.5
"""A grey that no reflectance may have, but other colours may."""


def spectral(run: Run) -> Findings:
    """Check that what is grey is the same in rgb and in spectral variants, to 0.5 %: all rgb colours become grey ones,
    as bright as they are. Those of plugins of ours are also tried brighter than 1, where they may be; Mitsuba's own
    plugins limit them to 1 in spectral variants. For this the BSDF must be given as a dict."""
    part = run.probe.whole
    if run.given is None:
        yield Finding("spectral", part.name, "skip", "To load it in two variants, its dict is needed.")
        return
    rgb, other = (f"{mi.variant().rpartition('_')[0]}_{kind}" for kind in ("rgb", "spectral"))
    if mi.variant() not in (rgb, other) or not {rgb, other} <= set(mi.variants()):
        yield Finding("spectral", part.name, "skip", f"It takes the variants {rgb} and {other}.")
        return
    wi = on_side(hemisphere(COUNT, 81), part.sides[0])
    with mi.variant_context(rgb):
        tried = _greys(run.given)
        wo = _load(tried[""]).sample(part, wi, random(COUNT, 82)).wo
        wo[::2] = on_side(hemisphere(COUNT, 83), part.sides[0])[::2]
        expected = {words: _load(given).eval(part, wi, wo) for words, given in tried.items()}
    if np.ptp(expected[""], axis=1).max() > 1e-4 * expected[""].max():
        yield Finding("spectral", part.name, "skip", "It has colours, of which spectral variants make other ones.")
        return
    with mi.variant_context(other):
        try:
            got = {words: _load(given).eval(part, wi, wo) for words, given in tried.items()}
        except (RuntimeError, TypeError) as failure:
            yield Finding("spectral", part.name, "skip", f"It does not work in {other}: {told(failure)}.")
            return
    outcome, worst = Outcome("spectral", part.name), 0.0
    for words in tried:
        wanted = expected[words].mean(axis=1)
        scale = np.maximum(wanted, 1e-6 * wanted.max() + 1e-12)[:, None]
        error = np.nan_to_num(abs(got[words] - wanted[:, None]) / scale, nan=np.inf)
        typical = float(np.quantile(error.max(axis=1), 0.99))
        worst = max(worst, typical)
        if typical > TOLERANCE:
            k, channel = np.unravel_index(int(np.argmax(error)), error.shape)
            outcome.fault(
                f"in grey{words}, eval for light from {angles_of(wi[k])} towards {angles_of(wo[k])} is "
                f"{got[words][k, channel]:.4g} in {other}, but {wanted[k]:.4g} in {rgb}",
                typical,
                wi=wi[k],
                wo=wo[k],
            )
    yield outcome.finding(f"Grey is the same in {rgb} and {other}, to {worst:.1g}.")


def _greys(given: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the BSDF in grey, by what is special of it in words. The variant must be one of rgb."""
    probe = _load(given)
    params = mi.traverse(probe.bsdf)
    bright: dict[str, Any] = {}
    for key in params.keys():
        name, _, rest = key.partition(".")
        if rest == "value" and (probe.is_ours or isinstance(params[key], mi.Color3f)):
            try:
                grey = given | {name: _rgb(float(numbers(params[key], 1).mean()))}
                _load(grey)
            except RuntimeError:  # it is a number
                continue
            given, bright = grey, bright | {name: _rgb(BRIGHT)}
    tried = {"": given}
    for name, colour in bright.items() if probe.is_ours else ():
        try:
            _load(given | {name: colour})
        except RuntimeError:  # a reflectance
            continue
        tried[f" with {name} = {BRIGHT:g}"] = given | {name: colour}
    return tried


def _load(given: dict[str, Any]) -> BSDFProbe:
    return BSDFProbe(mi.load_dict(given))


def _rgb(grey: float) -> dict[str, Any]:
    return {"type": "rgb", "value": (grey, grey, grey)}
