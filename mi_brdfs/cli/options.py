"""Options that several commands share."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import writing
from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .terminal import Exit, fail

if TYPE_CHECKING:
    from ..probe.sources import BSDFSource

Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "-D",
        "--param",
        metavar="name=value",
        help="Set a parameter of each TYPE to a number, a word, true, false, #rrggbb or 'r;g;b', or a <default> of the "
        "XML; may be repeated.",
    ),
]


def parameters_of(definitions: list[str] | None) -> dict[str, str]:
    """Return the values of ``-D`` and ``--param`` options, as text. Of one name, the last counts."""
    parameters: dict[str, str] = {}
    for definition in definitions or []:
        name, equals, value = definition.partition("=")
        if not equals or not name:
            fail(f"-D {definition}: write -D name=value", Exit.USAGE)
        parameters[name] = value
    return parameters


def quantity_of(definitions: list[str] | None) -> Any:
    """Return what ``-D quantity=…`` says that a measured file holds, which has no other parameters."""
    parameters = {"quantity": "stated"} | parameters_of(definitions)
    for name in parameters.keys() - {"quantity"}:
        fail(f"-D {name}: a measured file has no parameter but quantity", Exit.USAGE)
    return parameters["quantity"]


def sources_of(word: str, parameters: dict[str, str]) -> list[BSDFSource]:
    """Return the BSDFs that a word stands for, or fail with a sentence."""
    from ..probe.sources import find_sources

    try:
        with unwrapped_ctrl_c():
            return list(find_sources(word, parameters))
    except Exception as error:
        text = one_line(error)
        fail(text if text.startswith((word, "-D")) else f"{word}: {text}", Exit.USAGE)


def check_names(names: list[str] | None, known: Collection[str], kind: str) -> None:
    for name in names or []:
        if name not in known:
            fail(f"--only {name}: there is no such {kind}; there are {', '.join(known)}", Exit.USAGE)


def check_output(option: str, file: Path | None) -> None:
    """Fail if a file cannot be written: before the work whose result it is to hold."""
    if file is None:
        return
    if not file.absolute().parent.is_dir():
        fail(f"{option} {file}: there is no folder {file.parent}", Exit.USAGE)
    if file.is_dir():
        fail(f"{option} {file}: it is a folder", Exit.USAGE)
    try:
        if file.is_file():
            file.open("ab").close()
        if file.is_file() or not file.exists():
            tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(file))).close()
    except OSError as error:
        fail(f"{option} {file}: it cannot be written: {error.strerror}", Exit.USAGE)


def write_text(file: Path | None, text: str) -> None:
    if file is not None:
        try:
            writing.write_text(file, text)
        except OSError as error:
            fail(f"cannot write {file}: {error.strerror}")


def write_json(file: Path | None, data: list | dict) -> None:
    write_text(file, json.dumps(data, indent=1) + "\n")
