"""The command-line application, and what all commands share."""

from __future__ import annotations

import errno
import functools
import inspect
import os
import sys
import warnings
from collections.abc import Callable
from io import TextIOWrapper
from typing import Annotated, Any, cast

import mitsuba as mi
import typer
from rich.markup import escape

from .. import __version__
from ..mitsuba import guests
from ..mitsuba.errors import unwrapped_ctrl_c
from ..parameters.messages import printable
from ..starting import Terminated, exit_on_sigterm, raise_on_ctrl_c
from .files import begin, check_inputs
from .terminal import Exit, Terminal, err, fail, out

app = typer.Typer(
    no_args_is_help=True, pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]}
)

imported: list[str] = []
"""The arguments of the command's --import."""


def main() -> None:
    """Run the command ``mi-brdfs``."""
    warnings.formatwarning = lambda message, *_: f"mi-brdfs: {printable(str(message))}\n"  # a sentence, as errors are
    if sys.stdout is None:  # a daemon may have closed it
        sys.stdout = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    # Names of files need not be UTF-8, nor need what output goes to, as on Windows.
    is_utf8 = sys.stdout.encoding.lower().replace("-", "") == "utf8"
    cast(TextIOWrapper, sys.stdout).reconfigure(errors="surrogateescape" if is_utf8 else "replace")
    exit_on_sigterm()
    try:
        app(prog_name="mi-brdfs")
    except OSError as error:
        # Python raises the second one wherever it looks at a path.
        if error.errno not in (errno.ENOSPC, errno.ENAMETOOLONG):
            raise
        err.print(f"mi-brdfs: {error.filename}: {error.strerror}")
        sys.exit(Exit.ERROR)
    except SystemExit as ended:
        if ended.code or not Terminal.unwritten:
            raise
        err.print(f"mi-brdfs: cannot write to the standard output: {Terminal.unwritten}")
        sys.exit(Exit.ERROR)


def _print_version(wanted: bool) -> None:
    if wanted:
        out.print(f"mi-brdfs {__version__}, Mitsuba {mi.__version__}")
        raise typer.Exit


@app.callback()
def _describe(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Classical BRDFs for Mitsuba 3: list and check them, see what works on this machine, render scenes."""
    begin()


def _import(names: list[str] | None) -> None:
    imported[:] = names or []
    for name in imported:
        try:
            guests.import_models(name)
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


def command(panel: str, *examples: str, name: str | None = None) -> Callable:
    """Register a function as a command in a panel of the help, which ends with examples, with the option --import;
    Ctrl-C and missing extras end it in a sentence."""
    lines = [f"mi-brdfs {escape(example)}" for example in examples]

    def add(function: Callable) -> Callable:
        @functools.wraps(function)
        def importing(*args: Any, imports: Imports = None, **kwargs: Any) -> Any:
            try:
                with unwrapped_ctrl_c():
                    raise_on_ctrl_c()
                    _import(imports)
                    check_inputs({**kwargs, "imports": imports})
                    return function(*args, **kwargs)
            except KeyboardInterrupt:
                err.print("Interrupted; nothing was written.")
                raise typer.Exit(Exit.INTERRUPTED) from None
            except SystemExit as error:
                if isinstance(error, Terminated):
                    raise
                fail(f"code of a model ended the command: SystemExit: {error}")
            except ImportError as error:
                if error.name:  # a module is broken; what an extra brings is told without one
                    raise
                fail(str(error))

        signature = inspect.signature(function, eval_str=True)
        option = inspect.Parameter("imports", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Imports)
        importing.__doc__ = " ".join((function.__doc__ or "").split())  # lines end where the terminal's do
        parameters = [*signature.parameters.values(), option]
        importing.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        importing.__annotations__ = {**inspect.get_annotations(function, eval_str=True), "imports": Imports}
        return app.command(name, rich_help_panel=panel, epilog="\n\n".join(["Examples:", *lines]))(importing)

    return add
