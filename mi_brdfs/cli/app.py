"""The command-line application, and what all commands share."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable
from typing import Annotated

import typer

from ..mitsuba import guests
from .terminal import Exit, fail

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)


imported: list[str] = []
"""The arguments of --import."""


def main() -> None:
    """Run the command ``mi-brdfs``."""
    warnings.formatwarning = lambda message, *_: f"mi-brdfs: {message}\n"  # a sentence, as errors are
    app()


@app.callback()
def _describe() -> None:
    """Classical BRDFs for Mitsuba 3: list and check them, see what works on this machine, render scenes."""


def _import(names: list[str] | None) -> None:
    for name in names or []:
        try:
            guests.import_models(name)
            imported.append(name)
        except (ImportError, ValueError) as error:
            fail(f"--import {name}: {error}", Exit.USAGE)


Imports = Annotated[
    list[str] | None,
    typer.Option(
        "--import",
        metavar="FILE.py|MODULE",
        help="Register the models that this file or module defines; may be repeated.",
    ),
]


def command(name: str | None = None) -> Callable:
    """Register a function as a command, with the option --import."""

    def add(function: Callable) -> Callable:
        @functools.wraps(function)
        def importing(*args, imports: Imports = None, **kwargs):
            _import(imports)
            return function(*args, **kwargs)

        signature = inspect.signature(function, eval_str=True)
        option = inspect.Parameter("imports", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Imports)
        importing.__signature__ = signature.replace(parameters=[*signature.parameters.values(), option])
        importing.__annotations__ = {**inspect.get_annotations(function, eval_str=True), "imports": Imports}
        return app.command(name)(importing)

    return add
