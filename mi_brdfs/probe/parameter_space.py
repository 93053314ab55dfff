"""The settings of a model by its declarations: its choices, the ranges of its numbers, and what makes it white."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import copysign, isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import mitsuba as mi
import numpy as np

from ..parameters import Parameter, PerLobe
from .arrays import Array

if TYPE_CHECKING:
    from ..model import Model

LOWEST_VIEW = 89.9
"""The largest angle of view, in degrees."""
FARTHEST = 1e6
"""Where the search for a number ends whose range is infinite."""
LEAST = {"epd": {"alpha": 0.003}}
"""Where it begins for numbers that belong to a word, if not at the end of the range: the flanks of narrower lobes are
as steep as directions are rounded."""


# --- Numbers --------------------------------------------------------------------------------------------------------


class Dimension(NamedTuple):
    """A number that is free, and its range."""

    name: str
    low: float
    high: float

    def at(self, t: Array) -> Array:
        """Return the value at the fraction ``t`` of the range, in steps of equal ratio far from zero."""
        if self.low > 0:
            return self.low * (self.high / self.low) ** t
        low, high = np.arcsinh([self.low, self.high])
        return np.sinh(low + (high - low) * t).clip(self.low, self.high)


VIEW = (Dimension("cosine", float(np.cos(np.radians(LOWEST_VIEW))), 1), Dimension("azimuth", 0, np.pi / 2))
"""The axes of the direction of view."""


def view(cosine: Array, azimuth: Array) -> Array:
    """Return the direction of view."""
    sin = np.sqrt(1 - cosine * cosine)
    return np.stack([sin * np.cos(azimuth), sin * np.sin(azimuth), cosine], axis=-1)


def axes(model: type[Model], given: Mapping[str, Any]) -> list[Dimension]:
    """Return the numbers that are sought and not ``given``, both of a pair, and the direction of view."""
    least = {name: value for word in given.values() for name, value in LEAST.get(word, {}).items()}
    free = []
    for parameter in present(model.declared(), given):
        for it in parameter.quantities(pairs=True):
            if it.sought and not (it.colour or it.turns or parameter.name in given):
                low, high = (limit if isfinite(limit) else copysign(FARTHEST, limit) for limit in it.limits)
                free.append(Dimension(it.name, max(low, least.get(it.name, low)), high))
    return [*free, *VIEW]


def white(model: type[Model], given: Mapping[str, Any]) -> dict[str, float]:
    """Return the colours that make a model brightest: 1, but 0 for ``diffuse_reflectance`` beside others."""
    known = [(it, it.quantities(pairs=False)) for it in present(model.declared(), given)]
    colours = [(it.role, quantity) for it, quantities in known for quantity in quantities if quantity.colour]
    return {
        colour.name: 0.0 if role == "diffuse" and len(colours) > 1 else min(1.0, colour.limits[1])
        for role, colour in colours
    }


def present(declared: Iterable[Parameter], words: Mapping[str, Any], lobes: int = 1) -> Iterator[Parameter]:
    """Yield declared parameters with those of each lobe, and of the words that are given, among them."""
    for parameter in declared:
        if isinstance(parameter, PerLobe):
            for number in [""] if lobes == 1 else parameter.numbers[1 : lobes + 1]:
                yield from present(parameter.lobe(number), words, lobes)
            continue
        yield parameter
        if parameter.name in words:
            yield from present(parameter.words.get(words[parameter.name], {}).values(), words, lobes)


# --- Choices --------------------------------------------------------------------------------------------------------


def choices(declared: Iterable[Parameter], given: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return every combination of words for the choices among some parameters: all words of a choice, or what is
    ``given``, one or a tuple."""
    combinations: list[dict[str, Any]] = [{}]
    for parameter in declared:
        combinations = [one | more for one in combinations for more in _words(parameter, given)]
    return combinations


def _words(parameter: Parameter, given: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the words of a parameter, each with those of the choices that belong to it."""
    if isinstance(parameter, PerLobe):
        return choices(parameter.lobe(""), given)
    if not parameter.words or parameter.implied_words:
        return [{}]
    allowed = given.get(parameter.name, tuple(parameter.words))
    allowed = allowed if isinstance(allowed, tuple) else (allowed,)
    return [
        {parameter.name: word} | more
        for word in allowed
        for more in choices(parameter.words.get(word, {}).values(), given)
    ]


def accepted(model: type[Model], given: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what is ``given``, with every combination of words that it leaves open and that the plugin accepts. Raise
    a ValueError if there is none, or what Mitsuba raises where the plugin fails for another reason."""
    found, refusal = [], "there are no such choices"
    named = {name for name, value in given.items() if isinstance(value, (str, bool, tuple))}
    for words in choices(model.declared(), given):
        if named <= words.keys():
            setting = {**given, **words}
            try:
                load(model, setting, {})
                found.append(setting)
            except RuntimeError as error:
                if "ParameterError: " not in str(error):
                    raise
                refusal = str(error).rpartition("ParameterError: ")[2].strip()
    if not found:
        raise ValueError(f"{model.plugins[0]}: {dict(given)} is no configuration: {refusal}")
    return found


def load(model: type[Model], setting: Mapping[str, Any], textures: Mapping[str, mi.Texture]) -> mi.BSDF:
    """Return the plugin in white at a setting, with textures for what is free."""
    return mi.load_dict({"type": model.plugins[0], **white(model, setting), **setting, **textures})
