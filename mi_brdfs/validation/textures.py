"""The check of parameters that vary over the surface."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from .outcome import Findings, Outcome, relative
from .report import Finding
from .subject import Subject, direction, hemisphere, numbers, on_side, random

COUNT = 4000


def textures(run) -> Findings:
    """A parameter given as a texture acts as its value at the surface point does. All of them become bitmaps with a
    texel for each, in which this one's value differs: there eval is what it is with these values everywhere, and
    weights are eval/pdf, to float32's rounding. For this the BSDF must be given as a dict."""
    subject, part = run.subject, run.subject.whole
    if run.given is None:
        yield Finding("textures", "whole", "skip", "To replace its parameters by textures, its dict is needed.")
        return
    params = mi.traverse(subject.bsdf)
    originals = {
        name: type(params[key])(params[key])
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
    textured = Subject(mi.load_dict(given), subject.angles)
    wi, variates = on_side(direction(35, 50), part.sides[0]), random(COUNT, 31)
    for name in names:
        outcome, key = Outcome("textures", name), f"{name}.value"
        uv = (list(originals).index(name) + 1.5) / (len(originals) + 1), 0.5
        samples = textured.sample(part, wi, variates, uv)
        wo = np.where(np.arange(COUNT)[:, None] % 2, samples.wo, hemisphere(COUNT, 32)).astype(np.float32)
        params[key] = changed[name]
        params.update()
        value, expected = textured.eval(part, wi, wo, uv), subject.eval(part, wi, wo, uv)
        params[key] = originals[name]
        params.update()
        tolerance = 3 * subject.rounding(part)
        for got, wanted, words in (
            (value, expected, "eval is {:.4g} where its texel is {}, but {:.4g} if that is its value everywhere"),
            (
                samples.weight * samples.pdf[:, None],
                samples.value * samples.lit[:, None],
                "the weight times pdf is {:.4g} where its texel is {}, but eval {:.4g}",
            ),
        ):
            error = relative(got, wanted)
            if error.max() > tolerance:
                k = np.unravel_index(int(np.argmax(error)), error.shape)
                texel = ", ".join(f"{number:.3g}" for number in numbers(changed[name], 1)[0])
                outcome.fault(words.format(got[k], texel, wanted[k]), error.max())
        yield outcome.finding("As a texture it acts as its value at the point does.")


def _textured(given: dict[str, Any], originals: dict, changed: dict) -> tuple[dict[str, Any], list[str]]:
    """``(dict, refused)``: the BSDF with bitmaps for its parameters, but for those that it refuses: some take none, and
    of some pairs only one may be given."""
    bitmaps = {
        name: _bitmap([changed[name] if other == name else originals[name] for other in [None, *originals]])
        for name in originals
    }
    if _loads(given | bitmaps):
        return given | bitmaps, []
    refused = []
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


def _bitmap(texels) -> dict[str, Any]:
    """Texels side by side, without interpolation and conversion."""
    data = np.stack([numbers(texel, 1)[0] for texel in texels])[None].astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(data), "raw": True, "filter_type": "nearest", "wrap_mode": "clamp"}
