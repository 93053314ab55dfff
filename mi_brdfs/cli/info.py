"""``mi-brdfs info``"""

from __future__ import annotations

import re
from typing import Annotated

import typer
from rich.text import Text

from .. import info as manual
from ..mitsuba.errors import one_line
from .app import command
from .manual import folded, is_underline
from .terminal import fail, out


@command()
def info(type: Annotated[str, typer.Argument(metavar="TYPE", help="A type or alias, as `list` shows it.")]) -> None:
    """Show the manual page of a BRDF."""
    try:
        page = manual(type)
    except ValueError as error:
        fail(one_line(error))
    page = re.sub(r":\w+:`([^`]+)`", r"\1", page)
    out.print(_styled(folded(page, out.width) if out.is_terminal else page))


def _styled(page: str) -> Text:
    """Return a manual page for the terminal: literals and headings styled instead of in reStructuredText markup."""
    lines = page.splitlines()
    text = Text()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if is_underline(line):
            continue
        heading = bool(line.strip()) and is_underline(following)
        for index, part in enumerate(line.split("``")):
            text.append(part, "bold" if heading else "cyan" if index % 2 else "")
        text.append("\n")
    return text
