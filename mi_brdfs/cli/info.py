"""``mi-brdfs info``"""

from __future__ import annotations

import re
from typing import Annotated

import typer
from rich.text import Text

from .. import info as manual
from .app import command
from .errors import one_line
from .terminal import fail, out


@command()
def info(type: Annotated[str, typer.Argument(metavar="TYPE", help="A type or alias, as `list` shows it.")]) -> None:
    """Show the manual page of a BRDF."""
    try:
        page = manual(type)
    except ValueError as error:
        fail(one_line(error))
    out.print(_styled(page))


def _styled(page: str) -> Text:
    """Return a manual page for the terminal: literals and headings styled instead of in reStructuredText markup."""
    lines = re.sub(r":\w+:`([^`]+)`", r"\1", page).splitlines()
    text = Text()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if _underlines(line):
            continue
        heading = bool(line.strip()) and _underlines(following)
        for index, part in enumerate(line.split("``")):
            text.append(part, "bold" if heading else "cyan" if index % 2 else "")
        text.append("\n")
    return text


def _underlines(line: str) -> bool:
    return re.fullmatch(r"(=|-|~){3,}", line.strip()) is not None
