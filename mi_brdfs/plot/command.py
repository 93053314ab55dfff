"""The arguments of the command line: ``mi-brdfs plot ward --param alpha=0.1,0.2,0.4``."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Any

from ..mitsuba.registry import plugin_names
from ..probe.sources import degrees_of, shared, split, value_of
from ..writing import replacing
from . import albedo, cartesian, hemisphere, polar
from .style import checked_size

KINDS: dict[str, Callable] = {each.__name__: each for each in (polar, cartesian, hemisphere, albedo)}
"""The functions by the value of ``--kind``."""
DPI = 200


def asked_for(targets: Sequence[str], parameters: Sequence[str]) -> list[str | dict]:
    """Return the BSDFs that words and ``--param`` options stand for: plugins with parameters as dicts, whose labels say
    what differs, and other words with the parameters that they have; one for each value of a swept parameter. Raise a
    ValueError if an option is malformed or fits no word."""
    given: dict[str, str] = {}
    for option in parameters:
        name, _, value = option.partition("=")
        if not name or not value:
            raise ValueError(f"--param {option}: write name=value, or name=a,b,c to draw each value")
        if name in given:
            raise ValueError(f"--param {name} is given twice; write {name}=a,b,c to draw each value")
        given[name] = value
    return [bsdf for word, own in zip(targets, shared(targets, given), strict=True) for bsdf in _swept(word, own)]


def _swept(word: str, given: dict[str, str]) -> Iterator[str | dict]:
    """Yield a word with its parameters, for each value of the one that has several."""
    word, own = split(word)
    values = {name: text.split(",") for name, text in (given | own).items()}
    for name, choices in values.items():
        if "" in choices:
            raise ValueError(f"{name}={','.join(choices)}: write name=value, or name=a,b,c to draw each value")
    if len(sweeps := [name for name, choices in values.items() if len(choices) > 1]) > 1:
        raise ValueError(f"{' and '.join(sweeps)} have several values each; only one parameter may")
    is_plugin = word in plugin_names()
    for chosen in product(*values.values()):
        pairs = dict(zip(values, chosen, strict=True))
        if not pairs:
            yield word
        elif is_plugin:
            yield {"type": word} | {name: value_of(text) for name, text in pairs.items()}
        else:
            yield f"{word}:{','.join(f'{name}={text}' for name, text in pairs.items())}"


def options_of(kind: str, angles: str | None, **options: Any) -> dict[str, Any]:
    """Return the arguments of a kind of figure from the options given, which are not None. Raise a ValueError if it
    does not take one of them."""
    try:
        numbers = None if angles is None else degrees_of(angles)
    except ValueError as error:
        raise ValueError(f"--angles {error}") from None
    options = {"angles": numbers, **options}
    taken = inspect.signature(KINDS[kind]).parameters
    options = {name: value for name, value in options.items() if value is not None}
    for name in options:
        if name not in taken:
            raise ValueError(f"--{name.replace('_', '-')} does not apply to {kind}")
    return options


def size_of(text: str | None) -> tuple[float, float] | None:
    """Return the width and the height that are given as 6x4, in inches, or raise a ValueError."""
    if text is None:
        return None
    try:
        return checked_size([float(side) for side in text.split("x")])
    except ValueError:
        raise ValueError(f"--size {text}: write WIDTHxHEIGHT, in inches from 1 to 50, as in 6x4") from None


def default_file(kind: str, targets: Sequence[str]) -> Path:
    """Return the file to write where none is named: in the working directory, named after its content."""
    words = dict.fromkeys("bsdf" if word.startswith("<") else Path(split(word)[0]).stem for word in targets)
    return Path(re.sub(r"[^\w-]+", "_", "-".join([*words, kind]))[-100:] + ".png")


def write(figure: Any, path: Path) -> None:
    """Write a figure."""
    data = BytesIO()  # where a disk is full, writers of formats raise other errors than OSError
    figure.savefig(data, format=path.suffix[1:].lower() or "png", dpi=DPI)
    with replacing(path) as part:
        part.write_bytes(data.getvalue())
