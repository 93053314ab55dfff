"""The check of parameters that vary over the surface."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, interaction, numbers, pinned
from ..probe.bsdf import BSDFProbe, Samples, Value, load
from ..probe.directions import beside
from ..probe.variates import random
from . import sampling
from .outcome import Findings, Outcome, Skipped, relative
from .report import Finding
from .run import Run
from .updates import loaded_or_none
from .values import compare_joint, eval_pdf

COUNT = 4000
SHAPE = 5, 7
"""Of the bitmaps, in texels: other than square, so that u and v cannot be exchanged."""


def textures(run: Run) -> Findings:
    """Check that a parameter given as a texture acts as its value at the surface point does, wherever that is, also
    outside the unit square. Constant parameters become bitmaps of random texels, and given textures stay. All over them
    ``eval``, ``eval_diffuse_reflectance`` and the weights of delta functions are what they are where each texture has
    the value of the point everywhere, and no other than if fewer points are evaluated; weights are eval/pdf, to
    float32's rounding; ``eval_pdf`` and ``eval_pdf_sample`` say what the others do; and samples carry as much light to
    the same directions, to six standard errors. For this the BSDF must be given as a dict."""
    varied, refused = _textured(run.probe, run.described("To replace its parameters by textures"))
    for name in refused:
        yield Finding("textures", name, "skip", "It does not take a bitmap of its kind beside the others.")
    if not varied:
        raise Skipped("It has no parameters that are textures.")
    everywhere = Outcome("textures", "whole")
    _compare(run, everywhere, varied, varied)
    outcomes = [Outcome("textures", name) for name in varied]
    if everywhere.faults:
        for outcome in outcomes:
            _compare(run, outcome, varied, {outcome.subject})
        if not any(outcome.faults for outcome in outcomes):
            outcomes = [everywhere]
    for outcome in outcomes:
        yield outcome.finding("As a texture it acts as its value at the point does.")


def _compare(run: Run, outcome: Outcome, varied: dict[str, mi.Texture], free: Collection[str]) -> None:
    """Compare the BSDF whose ``free`` parameters vary with one in which each lane has the values of its point; add
    faults."""
    part, given, tolerance = run.probe.whole, run.given or {}, 3 * run.rounding(run.probe.whole)
    uv = np.random.default_rng(33).uniform(-1, 2, (COUNT, 2)).astype(np.float32)
    wi = part.around(COUNT, 30)
    wo = beside(wi, 32)
    constant = {name: pinned(texture, interaction(wi, uv)) for name, texture in varied.items()}
    real = BSDFProbe(load(given | constant | {name: varied[name] for name in free}))
    samples = real.sample(part, wi, u := random(COUNT, 31), uv)
    wo[::2] = samples.wo[::2]
    other = BSDFProbe(load(given | constant))
    where = "where its textures have the values of this si.uv everywhere"
    reflectance = Value("eval_diffuse_reflectance", wo, real.diffuse_reflectance(wi, uv))
    found, few = [*real.values(wi, wo, uv), reflectance], slice(COUNT // 8)
    pinned_down = [it.value for it in other.values(wi, wo, uv)] + [other.diffuse_reflectance(wi, uv)]
    rows = [(it, expected, where) for it, expected in zip(found, pinned_down, strict=True)]
    if len(free) == len(varied):  # those that are pinned have as many lanes
        alone = [it.value for it in real.values(wi[few], wo[few], uv[few])]
        rows += [(it._replace(value=it.value[few]), value, "if fewer points are evaluated at once")
                 for it, value in zip(found, alone, strict=False)]  # fmt: skip
    error = relative(*_reflected(run.probe.sample(part, wi, u, uv)))
    if np.quantile(error, 0.999) <= tolerance:  # else it is no matter of textures
        reflected, value = _reflected(samples)
        rows.append((Value("the weight times pdf", wo, reflected), value, "is eval"))
    if not sampling.failing(run, part, eval_pdf):
        compare_joint(real, part, outcome, tolerance, wi, wo, u, samples, uv=uv, seed=31)
    for it, expected, why in rows:
        outcome.differing(tolerance, it.name, it.value, expected, why, wi, it.wo, uv=uv)
    if astray := sampling.strays(samples, other.sample(part, wi, u, uv), wi):
        outcome.fault(f"samples carry other light, or to other directions, than {where}", astray, seed=31)


def _reflected(samples: Samples) -> tuple[Array, Array]:
    """Return weights times pdf, and the values that these must be, where samples carry light."""
    lit = samples.lit[:, None]
    return samples.weight * samples.pdf[:, None] * lit, samples.value * lit


def _textured(probe: BSDFProbe, given: dict[str, Any]) -> tuple[dict[str, mi.Texture], list[str]]:
    """Return ``(textures, refused)``: bitmaps in place of constant parameters, those that are textures already, and
    which parameters refuse a bitmap: some take none, and of some pairs only one may be given."""
    varied = {}
    for name, value in given.items():
        if isinstance(value, (dict, mi.Texture)) and (texture := _texture(value)):
            varied[name] = texture
    params, rng = mi.traverse(probe.bsdf), np.random.default_rng(34)
    bitmaps = {}
    for key in params.keys():
        name, _, rest = key.partition(".")
        if rest == "value" and name not in varied:
            value = numbers(params[key], 1)[0]
            # Those of a colour are the coefficients of its spectrum in spectral variants, which no bitmap has.
            is_spectrum = mi.is_spectral and len(value) > 1
            value = np.full(3, 0.5) if is_spectrum else value
            texels = value + rng.random((*SHAPE, 1)) * (0.05 - 0.3 * value)  # up to a value that is 0.7 of it, and .05
            bitmaps[name] = mi.load_dict({"type": "bitmap", "bitmap": mi.Bitmap(texels.astype(np.float32)),
                                          "raw": not is_spectrum, "filter_type": "nearest"})  # fmt: skip
    if loaded_or_none(given | varied | bitmaps) is not None:
        return varied | bitmaps, []
    refused: list[str] = []
    for name, bitmap in bitmaps.items():
        if loaded_or_none(given | varied | {name: bitmap}) is not None:
            varied[name] = bitmap
        else:
            refused.append(name)
    return varied, refused


def _texture(value: Any) -> mi.Texture | None:
    """Return what is given for a parameter if it is a texture that varies."""
    loaded = loaded_or_none(value) if isinstance(value, dict) else value
    return loaded if isinstance(loaded, mi.Texture) and loaded.is_spatially_varying() else None
