"""The words of messages and tables: what a value is, and how to show it."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import mitsuba as mi

_KINDS = {"Color": "a colour", "Spectrum": "a spectrum", "Array3": "a vector", "Transform": "a transform"}


def kind_of(value: Any) -> str:
    """Return a word or two for what a value is."""
    if isinstance(value, bool):
        return "a boolean"
    if isinstance(value, str):
        return "a string"
    if isinstance(value, mi.Texture):
        return "a texture"
    if isinstance(value, mi.Object):
        return "a BSDF" if isinstance(value, mi.BSDF) else f"a {value.class_name()}"
    if isinstance(value, (int, float)):
        return "a number"
    kind = type(value).__name__
    return next((known for part, known in _KINDS.items() if part in kind), f"a {kind}")


def shown(value: Any) -> str:
    """Return a value as it appears in a message, on one line."""
    if isinstance(value, mi.Object):
        return value.class_name()
    if hasattr(value, "wavelengths"):
        numbers = ", ".join(f"{number:g}" for number in value.values[:6])
        return f"[{numbers}, …]" if len(value.values) > 6 else f"[{numbers}]"
    text = brief(f"{value:.6g}" if isinstance(value, float) else str(value))
    return f'"{text}"' if isinstance(value, str) else text


def brief(text: str) -> str:
    """Return a scene author's text on one line, of at most 80 characters, without terminal control characters."""
    text = printable(" ".join(text.split()))
    return text if len(text) <= 80 else f"{text[:80]}…"


def printable(text: str) -> str:
    """Return a text on one line, without characters that control a terminal or that XML may not have."""
    return "".join(character if character.isprintable() else "�" for character in text)


def no_file(path: Path) -> str:
    """Return what to say of a path that is no file."""
    return f"{path}: {'not a file' if path.exists() else 'no such file'}"


def listed(words: Iterable[str], last: str = "or", quote: bool = False) -> str:
    """Join words as a sentence lists them: a, b or c."""
    words = [f'"{word}"' if quote else word for word in words]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def meant(name: str, known: Iterable[str], likeness: float = 0.6) -> str | None:
    """Return the known name that may have been meant by another one: the one in another case or with other underscores,
    a close one, of at least that ``likeness``, with the same letters if there is such, or one that begins with it.
    Return None if there is none."""
    known = list(known)
    plain = name.lower().replace("_", "")
    spelt = [it for it in known if it.lower().replace("_", "") == plain]
    close = difflib.get_close_matches(name, known, n=3, cutoff=likeness)
    same = [it for it in close if sorted(it) == sorted(name)]
    longer = [it for it in known if len(name) > 2 and it.startswith(name)]
    return next(iter([*spelt, *same, *close, *longer]), None)


def interval(low: float, high: float) -> str:
    return f"[{low:g}, {high:g}]" if math.isfinite(high) else f"[{low:g}, ∞)"


def number_or_none(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"
