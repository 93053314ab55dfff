"""Controls by what a plugin declares, and by what ``mitsuba.traverse`` shows of others: nothing is said per model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import mitsuba as mi
import numpy as np

from ..model import Model
from ..parameters import File, Parameter, PerLobe, Preset, Quantity
from ..ranges import VALUES
from .state import Bsdf

Control = dict[str, Any]

WIDEST = 1e5
"""The end of a slider where the range has none."""
FINEST = 1e-3
"""The beginning of a logarithmic one, as a part of what ends it, where the range begins at 0."""
LOBES = "lobes"
"""The control of the number of lobes, which no plugin has as a parameter."""
FRESNEL = "Fresnel"
"""The group of the parameters that imply a word."""


def controls_of(model: type[Model], bsdf: Bsdf) -> list[Control]:
    """Return the controls of a model's plugin dict, in the order of its declarations."""
    return list(_controls(model.declared(), bsdf, ""))


def with_defaults(model: type[Model], bsdf: Bsdf) -> Bsdf:
    """Return a plugin dict with the numbers and colours of which it says nothing, and all colours as rgb: kernels
    depend on what is given, and on what kind."""
    found = {it["name"]: it["value"] for it in controls_of(model, bsdf) if it["kind"] in ("number", "colour")}
    return bsdf | {name: value for name, value in found.items() if value is not None}


def with_value(bsdf: Bsdf, control: Control, value: Any) -> Bsdf:
    """Return a plugin dict with a value of a control: those that it excludes go, and those that it needs come."""
    kept = {name: it for name, it in bsdf.items() if name not in control["excludes"]}
    return {**control["also"], **kept, control["name"]: value}


def _controls(declared: Iterable[Parameter], bsdf: Bsdf, group: str) -> Iterator[Control]:
    for parameter in declared:
        if isinstance(parameter, PerLobe):
            yield from _lobes(parameter, bsdf)
        elif parameter.spellings:
            yield from _spelled(parameter, bsdf, group)
        elif parameter.implied_words:
            yield from _implied(parameter, bsdf)
        elif False in parameter.words:
            name, default = parameter.names[0], parameter.fit_words[0]
            yield _control(name, parameter.text, "flag", bsdf.get(name, default), default, group)
        elif parameter.choices:
            name, *others = parameter.names
            usual = parameter.choices[0] if parameter.words else None  # none of a library need be named
            word = bsdf.get(name, usual)
            control = _control(name, parameter.text, "choice", word, usual, group)
            yield control | {"words": [*parameter.choices], "excludes": others, "optional": usual is None}
            own = parameter.words.get(word, {}) if isinstance(word, str) else {}
            yield from _controls(own.values(), bsdf, group)
        elif not isinstance(parameter, (File, Preset)):
            for row in parameter.rows():
                yield _control(row.name, row.text, "text", bsdf.get(row.name), None, group)


def _implied(parameter: Parameter, bsdf: Bsdf) -> Iterator[Control]:
    """Yield the controls of what implies a word, and of the words of others, which their parameters need."""
    name = parameter.name
    if parameter.brought:
        control = _control(name, parameter.text, "choice", bsdf.get(name), None, FRESNEL)
        yield control | {"words": [*parameter.brought], "optional": True, "excludes": parameter.rivals(name)}
    for word, own in parameter.words.items():
        # Colours of a word, η and k, cannot be alone.
        colours = [colour for colour, it in own.items() if any(q.colour for q in it.quantities(pairs=False))]
        needed: Bsdf = {colour: [1.0, 1.0, 1.0] for colour in colours}
        if word in parameter.brought:
            needed[name] = word
        for control in _controls(own.values(), bsdf, FRESNEL):
            also = {other: value for other, value in needed.items() if other != control["name"]}
            excludes = [*parameter.rivals(control["name"]), *control["excludes"]]
            yield control | {"optional": True, "excludes": excludes, "also": also}


def _spelled(parameter: Parameter, bsdf: Bsdf, group: str) -> Iterator[Control]:
    """Yield the controls of each way to give a parameter as numbers or colours; one gives way to another."""
    ways = parameter.spellings
    (first,), names = ways[0], [it.name for way in ways for it in way]
    is_other = any(name in bsdf for name in names[1:])
    middle = bsdf.get(first.name, first.default)
    for way in ways:
        here = [it.name for it in way]
        for it in way:
            default = first.default if it is first and not is_other else None
            yield _quantity(it, bsdf, default, group) | {
                "optional": len(ways) > 1 or first.default is None,
                "excludes": [name for name in names if name not in here],
                "also": {name: middle for name in here if name != it.name},
            }


def _lobes(parameter: PerLobe, bsdf: Bsdf) -> Iterator[Control]:
    numbers, words = _lobe_numbers(parameter, bsdf), [str(k) for k in range(1, len(parameter.numbers))]
    yield _control(LOBES, "number of lobes", "choice", str(len(numbers)), "1", "") | {"words": words}
    for number in numbers:
        yield from _controls(parameter.lobe(number), bsdf, f"lobe {number[1:]}" if number else "")


def _lobe_numbers(parameter: PerLobe, bsdf: Bsdf) -> list[str]:
    """Return the numbers in the names of each lobe of a plugin dict: "" where there is but one, without a number."""
    return [
        it for it in parameter.numbers[1:] if any(name in bsdf for own in parameter.lobe(it) for name in own.names)
    ] or [""]


def with_lobes(model: type[Model], bsdf: Bsdf) -> Bsdf:
    """Return a plugin dict with as many lobes as its ``lobes`` says; new ones are like the last."""
    wanted, found = bsdf[LOBES], {name: value for name, value in bsdf.items() if name != LOBES}
    parameter = next((it for it in model.declared() if isinstance(it, PerLobe)), None)
    if parameter is None or str(wanted) not in [str(k) for k in range(1, len(parameter.numbers))]:
        return found
    count = int(wanted)
    lobes = [_popped(parameter, number, found) for number in _lobe_numbers(parameter, found)]
    lobes = (lobes + count * lobes[-1:])[:count]
    for number, lobe in zip(parameter.numbers[1:] if count > 1 else [""], lobes, strict=False):
        found |= {f"{name}{number}": value for name, value in lobe.items()}
    return found


def _popped(parameter: PerLobe, number: str, bsdf: Bsdf) -> Bsdf:
    """Take the values of a lobe out of a plugin dict, or its defaults; return them by the names without a number."""
    lobe: Bsdf = {}
    for it in parameter.declared.values():
        names = zip(it.names, it.numbered(number).names, strict=True)
        given = {name: bsdf.pop(own) for name, own in names if own in bsdf}
        usual = {q.name: q.default for q in it.quantities(pairs=False) if q.default is not None}
        lobe |= given or usual
    return lobe


# --- Plugins that declare nothing -----------------------------------------------------------------------------------


def traversed(bsdf: mi.BSDF, usual: Mapping[str, Any]) -> list[Control]:
    """Return the controls of the numbers and colours that ``mitsuba.traverse`` shows, with their usual values."""
    found = []
    for key, value in mi.traverse(bsdf):
        is_value = isinstance(value, (int, float, mi.Float, mi.Color3f)) and not isinstance(value, bool)
        numbers = np.ravel(np.array(value, np.float64)) if is_value else np.zeros(0)
        if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
            continue
        name, short = key_to_name(key), key.rpartition(".")[2]
        given: Any
        if is_colour := len(numbers) == 3:
            given = [float(f"{it:.6g}") for it in numbers]
            limits = 0.0, 1.0 if max(given) <= 1 else math.ceil(2 * max(given))
        else:
            given = float(numbers[0])
            limits = _guess(short if short not in VALUES else name, given)
        quantity = Quantity(name, limits, None, key, is_colour)
        found.append(_quantity(quantity, {name: given}, usual.get(name, given), ""))
    return found


def key_to_name(key: str) -> str:
    """Return the property that a key of ``mitsuba.traverse`` belongs to."""
    head, _, last = key.rpartition(".")
    return head if head and last in VALUES else key


def _guess(name: str, value: float) -> tuple[float, float]:
    """Return a range for a number that declares none."""
    if "alpha" in name:
        return 1e-3, 1.0
    if 0 <= value <= 1:
        return 0.0, 1.0
    return (0.0, 2 * value) if value > 0 else (2 * value, -2 * value)


# --- Their form -----------------------------------------------------------------------------------------------------


def _control(name: str, text: str, kind: str, value: Any, default: Any, group: str) -> Control:
    return {
        "name": name, "text": text, "kind": kind, "value": value, "default": default, "group": group,
        "optional": False, "excludes": [], "also": {},
    }  # fmt: skip


def _quantity(it: Quantity, bsdf: Bsdf, default: Any, group: str) -> Control:
    value = bsdf.get(it.name, default)
    if it.colour:
        kind, (low, high), scale = "colour", it.limits, "linear"
        high = min(high, 10.0)
        value, default = ([x] * 3 if isinstance(x, (int, float)) else x for x in (value, default))
    else:
        kind, (low, high, scale) = "number", slider(*(it.usual or it.limits))
    control = _control(it.name, it.text, kind, value, default, group)
    return control | {"low": low, "high": high, "scale": scale, "optional": default is None}


def slider(low: float, high: float) -> tuple[float, float, str]:
    """Return the ends of a slider for a declared range, and its scale: logarithmic for what spans decades."""
    if math.isinf(high) or high > 1000:
        high = min(high, WIDEST)
        return (low if low > 0 else min(FINEST * high, 0.01)), high, "log" if low >= 0 else "linear"
    if 0 < low < 0.01 * high:
        return max(low, FINEST * high), high, "log"
    return low, high, "linear"
