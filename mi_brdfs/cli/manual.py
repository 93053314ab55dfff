"""Manual pages in a terminal of any width."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from itertools import groupby


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
