"""The manual page of a plugin, in lines of a console's width."""

from __future__ import annotations

import io
import re
import shutil

from rich.console import Console
from rich.markdown import Markdown
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from .model import EXAMPLE, Plugin

WIDEST = 100
"""The most characters in a line of text."""


def plain(plugin: type[Plugin]) -> str:
    """Return the page as text, in lines that fit into the terminal if there is one."""
    page, width = io.StringIO(), shutil.get_terminal_size((WIDEST, 0)).columns
    show(plugin, Console(file=page, width=min(width, WIDEST), color_system=None, force_jupyter=False, emoji=False))
    return re.sub(r"\n{3,}", "\n\n", re.sub(r" +$", "", page.getvalue(), flags=re.MULTILINE))


def show(plugin: type[Plugin], console: Console) -> None:
    """Print the page: what the plugin computes, an example to copy, and the tables."""
    text, _, example = re.sub(r":\w+:`([^`]+)`", r"\1", plugin.page()).partition(EXAMPLE)
    console.print(Markdown(text, "ansi_dark"))
    if example:
        _print_title("Example", console)
        console.print(Text(example))
    for title, rows, note in plugin.sections():
        _print_title(title, console)
        names = rows[0] if rows else ()
        table = Table(*names, box=None, pad_edge=False)
        for first, *cells, last in rows[1:]:
            if len(names) > 3:  # too many columns for a narrow terminal
                said = ", ".join(f"{name} {cell}" for name, cell in zip(names[1:], cells, strict=False))
                console.print(Text.assemble((first, "cyan"), ": ", said))
                console.print(Padding(Text(last), (0, 0, 0, 4)))
            else:
                table.add_row(*map(Text, (first, *cells, last)))
        console.print(*[table, ""] * bool(table.row_count), Markdown(note), sep="\n")


def _print_title(title: str, console: Console) -> None:
    console.print("", Text(title, "bold"), "-" * len(title), sep="\n")
