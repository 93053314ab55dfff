"""The check of parameters that vary over the surface."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from ..measure.arrays import Array, interaction, numbers
from ..measure.directions import hemisphere, on_side
from ..measure.probe import BSDFProbe, Part
from ..measure.variates import random
from .outcome import Findings, Outcome, relative
from .report import Finding
from .run import Run
from .traversal import restored, set_value, value_of

COUNT = 4000


def textures(run: Run) -> Findings:
    """Check that a parameter given as a texture acts as its value at the surface point does, wherever that is. All of
    them become bitmaps, in each of which some columns have a pattern of the parameter's value and another one, where
    the others have theirs only. At points all over them ``eval`` and ``eval_diffuse_reflectance`` are what they are
    with the texel's value everywhere, and weights are eval/pdf, to float32's rounding. For this the BSDF must be given
    as a dict."""
    probe, part = run.probe, run.probe.whole
    if run.given is None:
        yield Finding("textures", "whole", "skip", "To replace its parameters by textures, its dict is needed.")
        return
    params = mi.traverse(probe.bsdf)
    originals = {
        name: value_of(params, key)
        for key in params.keys()
        for name, _, rest in [key.partition(".")]
        if rest == "value" and not isinstance(run.given.get(name), dict)
    }
    changed = {name: original * 0.7 + 0.05 for name, original in originals.items()}
    given, refused = _textured(run.given, originals, changed)
    for name in refused:
        yield Finding("textures", name, "skip", "It does not take a bitmap of its kind beside the others.")
    names = [name for name in originals if name not in refused]
    if not names:
        yield Finding("textures", "whole", "skip", "It has no parameters that are constant textures.")
        return
    textured = BSDFProbe(mi.load_dict(given))
    uv, column = _points(len(originals))
    wi, variates = on_side(hemisphere(len(uv), 30), part.sides[0]), random(len(uv), 31)
    samples = textured.sample(part, wi, variates, uv)
    wo = np.where(np.arange(len(uv))[:, None] % 2, samples.wo, on_side(hemisphere(len(uv), 32), part.sides[0]))
    wo = wo.astype(np.float32)
    found = _numbers(textured, part, wi, wo, uv)
    usual = _numbers(probe, part, wi, wo, uv)
    tolerance = 3 * run.rounding(part)
    for k, parameter in enumerate(originals):
        if parameter in refused:
            continue
        original, other_value = originals[parameter], changed[parameter]
        outcome, key, own = Outcome("textures", parameter), f"{parameter}.value", column == k
        different = _is_changed(_bitmap(original, other_value, k, len(originals)), other_value, uv)
        with restored(params, key):
            set_value(params, key, other_value)
            other = _numbers(probe, part, wi, wo, uv)
        wanted = {word: np.where(different[:, None], other[word], usual[word]) for word in usual}
        comparisons = [
            (word, found[word], wanted[word], "{} is {:.4g} where its texel is {}, but {:.4g} if it is that everywhere")
            for word in wanted
        ]
        lit = samples.lit[:, None]
        reflected = samples.weight * samples.pdf[:, None] * lit
        words = "{} is {:.4g} where its texel is {}, but eval {:.4g}"
        comparisons.append(("the weight times pdf", reflected, samples.value * lit, words))
        for name, got, expected, words in comparisons:
            error = relative(got[own], expected[own])
            if error.max() > tolerance:
                lane, channel = np.unravel_index(int(np.argmax(error)), error.shape)
                lane = np.flatnonzero(own)[lane]
                value = numbers(other_value if different[lane] else original, 1)[0]
                texel = (
                    f"{', '.join(f'{number:.3g}' for number in value)} at uv = ({uv[lane, 0]:.3g}, {uv[lane, 1]:.3g})"
                )
                outcome.fault(words.format(name, got[lane, channel], texel, expected[lane, channel]), error.max())
        yield outcome.finding("As a texture it acts as its value at the point does.")


def _numbers(probe: BSDFProbe, part: Part, wi: Array, wo: Array, uv: Array) -> dict[str, Array]:
    return {
        "eval": probe.eval(part, wi, wo, uv),
        "eval_diffuse_reflectance": probe.diffuse_reflectance(wi, uv),
    }


PATTERN = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]], bool)
"""In which texels of its columns a parameter differs: no turn, flip or shift of the square leaves it as it is."""


def _points(count: int) -> tuple[Array, Array]:
    """Return ``(uv, column)``: points in the texels of each parameter, at some distance from their edges."""
    rows, width = PATTERN.shape
    rng = np.random.default_rng(33)
    texel = np.arange(max(COUNT, 200 * count)) % (count * width * rows)
    inside = rng.uniform(0.02, 0.98, (2, len(texel)))
    u = (texel % (count * width) + inside[0]) / (count * width)
    v = (texel // (count * width) + inside[1]) / rows
    return np.stack([u, v], axis=-1).astype(np.float32), texel % (count * width) // width


def _is_changed(bitmap: dict[str, Any], changed: Any, uv: Array) -> Array:
    """Return where a bitmap has the changed value, according to Mitsuba's texture itself."""
    texture, value = mi.load_dict(bitmap), numbers(changed, 1)[0]
    si = interaction([0, 0, 1], uv)
    texels = numbers(texture.eval_1(si) if len(value) == 1 else texture.eval_3(si), len(uv))
    return (abs(texels - value) < 1e-5).all(axis=1)


def _textured(
    given: dict[str, Any], originals: dict[str, Any], changed: dict[str, Any]
) -> tuple[dict[str, Any], list[str]]:
    """Return ``(dict, refused)``: the BSDF with bitmaps for its parameters, except those that it refuses: some take
    none, and of some pairs only one may be given."""
    bitmaps = {name: _bitmap(originals[name], changed[name], k, len(originals)) for k, name in enumerate(originals)}
    if _loads(given | bitmaps):
        return given | bitmaps, []
    refused: list[str] = []
    for name, bitmap in bitmaps.items():
        if _loads(given | {name: bitmap}):
            given = given | {name: bitmap}
        else:
            refused.append(name)
    return given, refused


def _loads(given: dict[str, Any]) -> bool:
    try:
        mi.load_dict(given)
    except (RuntimeError, TypeError):
        return False
    return True


def _bitmap(original: Any, changed: Any, k: int, count: int) -> dict[str, Any]:
    """Return texels without interpolation and conversion, in three columns for each of some parameters: the pattern in
    those of parameter k."""
    rows, width = PATTERN.shape
    data = np.tile(numbers(original, 1)[0], (rows, width * count, 1))
    data[:, width * k : width * (k + 1)][PATTERN] = numbers(changed, 1)[0]
    bitmap = mi.Bitmap(data.astype(np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest", "wrap_mode": "clamp"}
