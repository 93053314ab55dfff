"""Find the formulas in a text."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

from .formulas import BIG, FUNCTIONS, GREEK, PAIRS, SUPERSCRIPTS, Expression, read, tokens

STRONG = re.compile(
    rf"[=^√/·<>∝→≠|_{BIG}{''.join(SUPERSCRIPTS)}{''.join(GREEK)}Ē]|\w\+\w|\b(\d-[A-Z]|[a-z]-[a-z])\b|\b[A-Za-z]\("
)
INITIAL = re.compile(r"\.[-\s]*[A-Z]")
"""What follows the initial of a name."""
ENDS = re.compile(r"[.,;:)]")


def find(text: str, parameters: Collection[str] = (), display: bool = False) -> Iterator[tuple[int, int, Expression]]:
    """Yield the formulas in a paragraph with where they start and end, each as long as possible. Names of parameters
    may stand in them."""
    words = [match.span() for match in re.finditer(r"\S+", text)]
    done = 0
    for k, (start, _) in enumerate(words):
        if start < done:
            continue
        for first in _starts(text, start):
            if found := _longest(text, first, words[k:], parameters, display):
                end, node = found
                yield first, end, node
                done = end
                break


def _starts(text: str, start: int) -> Iterator[int]:
    yield start
    while text[start] == "(" and start + 1 < len(text):
        start += 1
        yield start


def _longest(text: str, first: int, words: list[tuple[int, int]], parameters, display) -> tuple[int, Expression] | None:
    """Return the end of the longest formula from here, and its tree."""
    ends = []
    for start, end in words:
        word = text[max(start, first) : end]
        core = re.sub(r"[.,;:)]+$", "", word)
        if core and not _is_mathematical(core, parameters):
            break
        last = end
        ends.append(last)
        while ENDS.match(text[last - 1]) and last - 1 > max(start, first):
            last -= 1
            ends.append(last)
        so_far = text[first:end]
        if re.search(r"[.,;:]$", word) and so_far.count("(") <= so_far.count(")"):
            break
    for end in sorted(set(ends), reverse=True):
        piece = text[first:end]
        if _is_formula(piece, text[end : end + 4], display):
            try:
                return end, read(piece)
            except ValueError:
                continue
    return None


def _is_mathematical(word: str, parameters: Collection[str]) -> bool:
    """Return whether all names of a word are symbols, functions or parameters."""
    try:
        names = [token.text for token in tokens(word.rstrip(".")) if token.kind == "name"]
    except ValueError:
        return False
    known = PAIRS | FUNCTIONS | set(parameters)
    bases = [name[0] if name[0] in GREEK else name.rstrip("'").partition("_")[0] for name in names]
    return all(len(base) == 1 or name in known or base in known for name, base in zip(names, bases, strict=True))


def _is_formula(piece: str, following: str, display: bool) -> bool:
    """Return whether a piece of text is meant as a formula: it has a sign or a letter that words do not have."""
    if re.fullmatch(r"[A-Za-z]'?", piece):
        name = piece.isupper() and INITIAL.match(following)
        return piece not in "aAI" and not following.startswith("'") and not name
    if piece in PAIRS:
        return True
    if re.search(r"\(\d{4}\)", piece):  # a year
        return False
    if re.match(r"a (?![=<>])", piece) or (not display and piece.endswith(" a")):
        return False
    return bool(STRONG.search(piece)) and not re.fullmatch(r"[\d./ -]+", piece)
