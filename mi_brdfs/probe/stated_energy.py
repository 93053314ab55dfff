"""A model's largest albedos as its class states them: measured, rounded and compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor, inf, isinf, log10
from typing import Any

from ..model import Energy, Model
from .largest_albedo import Maximum
from .parameter_space import accepted

ROUNDING = 1e-4
"""What float32 may exceed a limit by, relatively."""
SLACK = 0.02
"""What a search may fall short of the largest albedo by, relatively."""
NO_LIMIT = 100
"""What is above counts as infinite."""

Row = tuple[dict[str, Any], float]


def configurations(model: type[Model]) -> list[dict[str, Any]]:
    """Return the choices for which a model's class states the largest albedo, or all choices if it states none."""
    return [given for given, _ in model.energy.largest] if model.energy else accepted(model, {})


def energy_of(model: type[Model], default: float, found: Iterable[tuple[dict[str, Any], Maximum]]) -> Energy:
    """Return what a model's class should state, by the largest albedo of its defaults and of its configurations."""
    rows = [(given, rounded_up(setting.albedo, setting.noise)) for given, setting in found]
    return Energy(rounded_up(default), rows if model.energy else merged(rows))


def rounded_up(albedo: float, noise: float = 0.0) -> float:
    """Return the least number of three digits that an albedo does not exceed, or 1 if nothing but noise does."""
    if albedo > NO_LIMIT:
        return inf
    if albedo > 1 and not fault(1, albedo, noise):
        return 1.0
    least = albedo / (1 + ROUNDING)
    decimals = 2 - floor(log10(least)) if least > 0 else 0
    return round(ceil(least * 10**decimals) / 10**decimals, decimals)


def fault(stated: float, found: float, noise: float = 0.0) -> str:
    """Return what is wrong with a largest albedo that is stated, by what was found; or nothing."""
    if isinf(stated):
        return "" if found > NO_LIMIT else "there is a limit"
    if not found <= stated * (1 + ROUNDING) + 3 * noise:
        return "it is exceeded"
    return "" if found >= (1 - SLACK) * stated else "it is too high"


def merged(rows: Sequence[Row]) -> list[Row]:
    """Return fewer rows that say the same of combinations of words: a choice that makes no difference is left out, and
    words that make none stand together in a tuple."""
    fewer: list[Row] = []
    rest = list(rows)
    while rest:
        given: dict[str, Any] = {name: (word,) for name, word in rest[0][0].items()}
        for name in reversed(rest[0][0]):
            without = {other: words for other, words in given.items() if other != name}
            given = without if _is_row(without, rows, rest) else given
        for name in given:
            for word in dict.fromkeys(words[name] for words, _ in rest if name in words):
                wider = {**given, name: (*given[name], word)}
                given = wider if word not in given[name] and _is_row(wider, rows, rest) else given
        largest = max(albedo for words, albedo in rest if _covers(given, words))
        rest = [row for row in rest if not _covers(given, row[0])]
        fewer.append(({name: words if len(words) > 1 else words[0] for name, words in given.items()}, largest))
    return fewer


def _is_row(given: Mapping[str, Any], rows: Sequence[Row], rest: Sequence[Row]) -> bool:
    """Return whether a row may stand for all combinations that it covers: they are among the rest, have all of its
    choices and nearly the same albedo."""
    covered = [row for row in rows if _covers(given, row[0])]
    least, most = (pick(albedo for _, albedo in covered) for pick in (min, max))
    same = least >= (1 - SLACK) * most and (least <= 1) == (most <= 1)
    return same and all(row in rest and given.keys() <= row[0].keys() for row in covered)


def _covers(given: Mapping[str, Any], words: Mapping[str, Any]) -> bool:
    """Return whether no choice of a combination contradicts a row."""
    return all(words[name] in allowed for name, allowed in given.items() if name in words)
