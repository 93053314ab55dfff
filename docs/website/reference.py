"""Pages of the reference: manual pages with their formulas set."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection

from .formulas import Expression, Node
from .search import find
from .tex import tex

PROTECTED = re.compile(r"`[^`]*`|!?\[[^\]]*\]\([^)]*\)|(?:https?://|doi:)\S*[^\s.,;)]|<br>")
JOINER = "\u2060"
"""Keeps a formula and the punctuation after it on a line."""
DOI = re.compile(r"\bdoi:(\S+?)(?=[.,;)]*(?:\s|$))")
URL = re.compile(r"(?<![(<])(https?://\S+?)(?=[.,;)]*(?:\s|$))")


def with_formulas(page: str, parameters: Collection[str]) -> str:
    """Return a manual page in Markdown with its formulas in TeX: blocks that are indented, and those in the text and in
    tables, except for ranges and literals."""
    return outside_code(page, lambda text: "\n\n".join(_paragraph(it, parameters) for it in text.split("\n\n")))


def outside_code(page: str, change: Callable[[str], str]) -> str:
    """Return a page in Markdown with all changed but its blocks of code."""
    parts = re.split(r"(^```.*?^```$)", page, flags=re.MULTILINE | re.DOTALL)
    return "".join(part if k % 2 else change(part) for k, part in enumerate(parts))


def _paragraph(text: str, parameters: Collection[str]) -> str:
    if text.startswith("    "):
        return display(text, parameters)
    if text.lstrip("\n").startswith(("#", "![", "[![")):
        return text
    if text.lstrip("\n").startswith("|"):
        return "\n".join(_row(line, parameters) for line in text.split("\n"))
    return _linked(inline(text, parameters))


def _row(line: str, parameters: Collection[str]) -> str:
    """Set the formulas in the last cell of a row, which is text."""
    *cells, text, end = re.split(r"(?<!\\)\|", line) if line else ["", "", ""]
    return "|".join([*cells, inline(text, ()), end]) if line else line


def _linked(text: str) -> str:
    return DOI.sub(r"[doi:\1](https://doi.org/\1)", URL.sub(r"<\1>", text))


def inline(text: str, parameters: Collection[str]) -> str:
    """Return a paragraph with its formulas between dollar signs."""
    hidden = PROTECTED.sub(lambda match: "☐" * len(match[0]), text)
    out, at = [], 0
    for start, end, node in find(hidden, parameters):
        out += [
            text[at:start],
            f"${tex(node, display=False)}$",
            JOINER if text[end : end + 1] in tuple(".,;:)") else "",
        ]
        at = end
    return "".join([*out, text[at:]])


# --- Blocks ---------------------------------------------------------------------------------------------------------


def display(block: str, parameters: Collection[str]) -> str:
    """Return an indented block of formulas as an aligned display, a row for each statement."""
    rows = []
    for line in block.splitlines():
        for statement in re.split(r",\s{2,}", line.strip()):
            segments = _segments(statement, parameters)
            if not any(isinstance(segment, Expression) for segment in segments) and rows:
                rows[-1] += rf"\text{{, {_plain(statement)}}}"
            else:
                rows.append(_aligned(segments))
    return "$$\n\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}\n$$"


def _segments(statement: str, parameters: Collection[str]) -> list[str | Expression]:
    """Split a statement into text and formulas."""
    segments, at = [], 0
    for start, end, node in find(statement, parameters, display=True):
        segments += [statement[at:start], node]
        at = end
    return [segment for segment in [*segments, statement[at:]] if segment]


def _aligned(segments: list[str | Expression]) -> str:
    """Return a row, aligned at its first relation."""
    row = "".join(
        tex(segment) if isinstance(segment, Expression) else rf"\text{{{_plain(segment)}}}" for segment in segments
    )
    first = segments[0]
    if isinstance(first, Node) and first.kind == "relation":
        before = len(tex(first.parts[0]))
        return f"{row[:before]} &{row[before:]}"
    return rf"& \quad {row}" if row.startswith("+") else f"& {row}"


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", text.replace("`", "")).replace("_", r"\_")
