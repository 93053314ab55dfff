"""Terminal output: results go to stdout, errors and progress to stderr."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any, ClassVar, NoReturn

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn
from rich.segment import Segment
from rich.table import Table
from typer import rich_utils

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from ..parameters.messages import printable


class Terminal(Console):
    """A console that no text controls, as text of files and arguments might. What is no terminal gets results as they
    are, with the names of files that programs need. Where it cannot be written to, the rest is left out: files may
    still have to be written."""

    unwritten: ClassVar[str] = ""
    """Why results could not be written, but for nobody who reads on, as behind ``head``."""

    def print(self, *objects: Any, **options: Any) -> None:
        try:
            super().print(*objects, **options)
        except OSError as error:
            self.on_broken_pipe()
            if not self.stderr:
                Terminal.unwritten = str(error.strerror)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        for it in super().render(renderable, options):
            is_raw = it.control or not (self.stderr or self.is_terminal)
            yield it if is_raw else it._replace(text="\n".join(map(printable, it.text.split("\n"))))

    def on_broken_pipe(self) -> None:
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), (sys.stderr if self.stderr else sys.stdout).fileno())


out = Terminal(markup=False, emoji=False, highlight=False, soft_wrap=True)
err = Terminal(markup=False, emoji=False, highlight=False, soft_wrap=True, stderr=True)
rich_utils.Console = Terminal  # type: ignore[misc]  # where Typer tells what is wrong with arguments


class Exit(IntEnum):
    """Exit statuses other than 0."""

    ERROR = 1
    USAGE = 2
    NOT_JUDGED = 3
    INTERRUPTED = 130


def print_table(table: Table) -> None:
    """Print a table, with each row on one line where another program reads it."""
    console = Terminal(markup=False, emoji=False, highlight=False, width=None if out.is_terminal else 400)
    console.print(table)


def print_paragraph(text: str) -> None:
    """Print a text with its lines no longer than the terminal's, nor than 100 characters."""
    width = min(out.width, 100) if out.is_terminal else 100
    lines = textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    out.print("\n".join(lines))


def progress(doing: str, count: ProgressColumn | None = None) -> Progress:
    """Return a bar that says what is being done, how much of it is finished, and how long the rest will take; it is
    seen only on a terminal, and only until the end."""
    columns = [TextColumn(f"{doing} {{task.description}}", markup=False), BarColumn(), count or MofNCompleteColumn(),
               TimeRemainingColumn(), TextColumn("left")]  # fmt: skip
    return Progress(*columns, console=err, disable=not err.is_terminal, transient=True)


def fail(text: str, status: Exit = Exit.ERROR) -> NoReturn:
    err.print(f"mi-brdfs: {printable(text)}")
    raise typer.Exit(status)


@contextmanager
def failing(status: Exit, *wanted: type[Exception], about: str = "") -> Iterator[None]:
    """Fail with the sentence of an error, by default of those that Mitsuba raises; it begins with what it is about."""
    errors = wanted or (ValueError, RuntimeError)
    try:
        with unwrapped_ctrl_c():
            yield
    except typer.Exit:  # a RuntimeError, of what has failed in a sentence
        raise
    except errors as error:
        text = one_line(error)
        fail(text if text.startswith((about, "-D")) else f"{about}: {text}", status)


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Send what Mitsuba prints to stdout, its warnings, to stderr.

    Redirect file descriptors, as its log may write inside a signal handler, where no Python may run.
    """
    sys.stdout.flush()
    try:
        stdout = os.dup(1)
    except OSError:  # it is closed
        yield
        return
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(stdout, 1)
        os.close(stdout)
