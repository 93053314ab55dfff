"""BSDFs as functions take them, a plugin dict, a word or a loaded BSDF; and angles of incidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from numbers import Real
from typing import Any

import mitsuba as mi

from .mitsuba.errors import one_line
from .parameters.messages import brief
from .probe.bsdf import load
from .probe.sources import BSDFSource, find_sources


def check_given(bsdf: Any) -> None:
    """Raise a ValueError unless something is a plugin dict, a word or a loaded BSDF."""
    # Without a variant there is no mi.BSDF yet.
    is_object = hasattr(bsdf, "eval_pdf")
    if not (is_object or isinstance(bsdf, str) or (isinstance(bsdf, dict) and isinstance(bsdf.get("type"), str))):
        raise ValueError(
            f"{brief(repr(bsdf))} is no BSDF; give a dict such as {{'type': 'ward'}}, the name of a plugin, or a "
            "loaded BSDF."
        )


def described(bsdf: str | dict[str, Any] | mi.BSDF) -> dict[str, Any] | mi.BSDF:
    """Return the only BSDF that a word stands for, and anything else as it is. Raise a ValueError if it stands for none
    or for several, or with what Mitsuba says where it cannot be loaded."""
    if not isinstance(bsdf, str):
        return bsdf
    sources = sources_of(bsdf)
    if len(sources) > 1:
        raise ValueError(f"{bsdf} has {len(sources)} materials; name one of them, such as {sources[0].word}.")
    with _as_value_error():
        return sources[0].load()


def sources_of(word: str) -> list[BSDFSource]:
    """Return the BSDFs that a word stands for. Raise a ValueError if it stands for none, or with what Mitsuba says
    where one cannot be loaded."""
    with _as_value_error():
        return list(find_sources(word))


def load_described(bsdf: dict[str, Any] | mi.BSDF) -> mi.BSDF:
    """Return a BSDF that is given as a dict, which may be loaded again, or loaded. Raise a ValueError if it is none of
    the active variant, or with what Mitsuba says where it cannot be loaded."""
    if isinstance(bsdf, dict):
        check_given(bsdf)
        with _as_value_error():
            loaded = load(bsdf)
    else:
        loaded = bsdf
    if not isinstance(loaded, mi.BSDF):
        kind = bsdf["type"] if isinstance(bsdf, dict) else type(bsdf).__name__
        raise ValueError(f"{kind} is not a BSDF of {mi.variant()}.")
    return loaded


def several(given: Any) -> list[Any]:
    """Return what is given, one or several, as a list."""
    return list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]


def angles_of_incidence(given: float | Iterable[float]) -> tuple[float, ...]:
    """Return one angle or several, in degrees. Raise a ValueError if there are none, or one is not in [0, 90)."""
    angles = several(given)
    if not angles:
        raise ValueError("There is no angle of incidence; give one or more, in degrees.")
    for angle in angles:
        if not (isinstance(angle, Real) and 0 <= float(angle) < 90):
            shown = f"{float(angle):g}" if isinstance(angle, Real) else repr(angle)
            raise ValueError(f"An angle of incidence must be in [0, 90) degrees, not {shown}.")
    return tuple(angles)


@contextmanager
def _as_value_error() -> Iterator[None]:
    """Raise what Mitsuba says as a ValueError, in one line."""
    try:
        yield
    except (RuntimeError, TypeError) as error:
        raise ValueError(one_line(error)) from error
