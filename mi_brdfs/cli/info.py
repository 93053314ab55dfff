"""``mi-brdfs list`` and ``mi-brdfs info``"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from itertools import groupby
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from ..mitsuba.registry import DATA, all_models, find_plugin
from ..model import Plugin
from ..parameters import nested
from ..parameters.vocabulary import OTHERS, key
from .app import command
from .terminal import Exit, fail, failing, out, print_table


@command("Look", "list", "list --search gold", name="list")
def list_(
    search: Annotated[
        str | None, typer.Option(metavar="WORD", help="Only those that a word leads to, also one of other programs.")
    ] = None,
) -> None:
    """List the BRDFs, then the plugin of measured files: type, aliases, summary."""
    table = Table("type", "aliases", *["option"] * (search is not None), "summary", box=None, pad_edge=False)
    for model in dict.fromkeys([*all_models(), *DATA.values()]):
        options = [] if search is None else _options(model, search)
        if options is not None:
            cells = [] if search is None else [" ".join(options)]
            table.add_row(model.plugins[0], " ".join(model.plugins[1:]), *cells, model.summary().replace("``", ""))
    if not table.row_count:
        fail(f"no model goes by the word {search}; `mi-brdfs list` has them all", Exit.USAGE)
    print_table(table)


def _options(model: type[Plugin], word: str) -> list[str] | None:
    """Return the parameters of a model and their words that a word leads to; None if it does not lead to the model."""
    wanted = key(word)
    others = [other.partition(" ") for other in OTHERS.get(wanted, ())]
    names = {wanted, *(name for name, _, option in others if not option)}
    found = [option for name, _, option in others if name in model.plugins and option]
    for parameter in nested(model.declared()):
        found += [name for name in parameter.names if name in names or key(name) == wanted]
        choices = map(str, parameter.choices)
        found += [f"{parameter.names[0]}={it}" for it in choices if it in names or key(it) == wanted]
    named = {it.partition("=")[0]: it for it in found}
    is_named = not names.isdisjoint(model.plugins) or wanted in key(" ".join([*model.plugins, model.summary()]))
    return sorted(named.values()) if found or is_named else None


@command("Look", "info walter", "info tabulated")
def info(type: Annotated[str, typer.Argument(metavar="TYPE", help="A type or alias, as `list` shows it.")]) -> None:
    """Show the manual page of a BRDF."""
    with failing(Exit.ERROR):
        page = find_plugin(type).manual()
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


# --- In a terminal of any width --------------------------------------------------------------------------------------


def folded(page: str, width: int) -> str:
    """Return a manual page whose paragraphs, list items and tables are no wider than ``width``, if that is possible:
    formulas and examples, which are indented, stay as they are. The wide table of parameters becomes a list."""
    lines = page.splitlines()
    blocks = [list(block) for filled, block in groupby(lines, key=lambda line: bool(line.strip())) if filled]
    return "\n\n".join("\n".join(_block(block, width)) for block in blocks)


def _block(lines: list[str], width: int) -> Iterator[str]:
    if max(map(len, lines)) <= width or lines[0].startswith(" "):
        yield from lines
    elif len(lines) > 2 and is_underline(lines[1]):
        yield from lines[:2]
        yield from _table(lines[2:], width)
    else:
        for item in _items(lines):
            hanging = "  " if item.startswith("* ") else ""
            yield from _wrapped(item, width, others=hanging)


def _wrapped(text: str, width: int, first: str = "", others: str = "") -> list[str]:
    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


def _items(lines: list[str]) -> Iterator[str]:
    """Yield each item of a list, or the one paragraph, on a line of its own."""
    item = ""
    for line in lines:
        if line.startswith("* ") and item:
            yield item
            item = ""
        item = f"{item} {line.strip()}".strip()
    yield item


def _table(lines: list[str], width: int) -> Iterator[str]:
    """Yield the rows of a table with aligned columns: the first cell, and below it, indented, the others, with their
    titles except that of the last one."""
    starts = [cell.start() for cell in re.finditer(r"\S+(?: \S+)*", lines[0])]
    titles, *rows = ([line[start:end].strip() for start, end in zip(starts, [*starts[1:], None], strict=True)]
                     for line in lines)  # fmt: skip
    for first, *others, last in rows:
        yield from _wrapped(first, width, others="  ")
        said = ", ".join(f"{title} {cell}" for title, cell in zip(titles[1:], others, strict=False) if cell)
        for text in (said, last):
            yield from _wrapped(text, width, "    ", "    ")


def is_underline(line: str) -> bool:
    """Return whether a line marks the one above it as a heading."""
    return re.fullmatch(r"(=|-|~){3,}", line.strip()) is not None
