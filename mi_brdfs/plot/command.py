"""The arguments of the command line: ``mi-brdfs plot ward --param alpha=0.1,0.2,0.4``."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from ..parameters.messages import listed
from ..probe.sources import degrees_of, value_of
from ..writing import replacing
from . import albedo, cartesian, hemisphere, page, polar, sphere

KINDS: dict[str, Callable] = {each.__name__: each for each in (polar, cartesian, hemisphere, albedo, sphere)}
"""The functions by the value of ``--kind``."""
PICTURES, PAGES = (".png", ".svg", ".pdf", ".jpg"), (".html",)
DPI = 200


def asked_for(targets: Sequence[str], parameters: Sequence[str]) -> list[str | dict]:
    """Return the BSDFs that words and ``--param`` options stand for: each word, as a plugin dict for each value of a
    swept parameter.

    Raises:
        ValueError: if an option is malformed or fits no word.
    """
    values: dict[str, list[Any]] = {}
    for option in parameters:
        name, _, given = option.partition("=")
        if not name or not given or "" in given.split(","):
            raise ValueError(f"--param {option}: write name=value, or name=a,b,c to draw each value")
        if name in values:
            raise ValueError(f"--param {name} is given twice; write {name}=a,b,c to draw each value")
        values[name] = [value_of(text) for text in given.split(",")]
    sweeps = [name for name, choices in values.items() if len(choices) > 1]
    if len(sweeps) > 1:
        raise ValueError(f"--param: {' and '.join(sweeps)} have several values each; only one parameter may")
    if not values:
        return list(targets)
    for word in targets:
        if word.startswith("<") or word.endswith(".xml"):
            raise ValueError(f"--param sets parameters of plugins given by type; those of {word} are in its XML")
    dicts: list[str | dict] = []
    for word in targets:
        fixed = {"type": word} | {name: choices[0] for name, choices in values.items()}
        dicts += [fixed | {name: choice} for name in sweeps for choice in values[name]] or [fixed]
    return dicts


def options_of(kind: str, angles: str | None, **options: Any) -> dict[str, Any]:
    """Return the arguments of a kind of figure from the options given, which are not None.

    Raises:
        ValueError: if it does not take one of them.
    """
    try:
        numbers = None if angles is None else degrees_of(angles)
    except ValueError as error:
        raise ValueError(f"--angles {error}") from None
    if not math.isfinite(azimuth := options.get("azimuth") or 0):
        raise ValueError(f"--azimuth {azimuth}: give degrees")
    options = {"angles": numbers, **options}
    taken = inspect.signature(KINDS[kind]).parameters
    if numbers and "angle" in taken:
        if len(numbers) > 1:
            raise ValueError(f"--angles {angles}: {kind} shows one angle of incidence")
        options["angle"], options["angles"] = numbers[0], None
    options = {name: value for name, value in options.items() if value is not None}
    for name in options:
        if name not in taken:
            raise ValueError(f"--{name} does not apply to {kind}")
    return options


def output_file(path: Path | None, kind: str, targets: Sequence[str]) -> Path:
    """Return the file to write, by default one in the working directory, named after its content.

    Raises:
        ValueError: if this kind of figure cannot be written in the format of the name.
    """
    suffixes = PAGES if kind == "sphere" else PICTURES
    if path is None:
        words = ["bsdf" if word.startswith("<") else Path(word).stem for word in dict.fromkeys(targets)]
        return Path(re.sub(r"[^\w-]+", "_", "-".join([*words, kind]))[-100:] + suffixes[0])
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: {kind} is written as {listed(suffixes)}")
    return path


def write(figure: Any, path: Path) -> None:
    """Write a figure; a Plotly figure as a page, with the library in a file beside it."""
    if path.suffix.lower() in PAGES:
        page.write(figure, path)
    else:
        data = BytesIO()  # where a disk is full, writers of formats raise other errors than OSError
        figure.savefig(data, format=path.suffix[1:].lower(), dpi=DPI)
        with replacing(path) as part:
            part.write_bytes(data.getvalue())
