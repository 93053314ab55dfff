"""The plugins that are written, what those of Mitsuba 0.2 to 0.6 and their properties are called now, and the rules for
those of 0.6 that take more than another name."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .document import Element
    from .upgrade import Work


class Entry:
    """A plugin of Mitsuba 3."""

    def __init__(self, type: str, words: str) -> None:
        found = re.findall(r"(?:(\w+\*?)>)?(<?\w+>?)(?:=(\S+)|@(\S+)\.\.(\S+)|\|(\S+))?", words)
        self.type = type
        self.known = {name for _, name, *_ in found}
        """Its properties, and the kinds that it holds, as ``<kind>``."""
        self.renamed = {old: name for old, name, *_ in found if old}
        """Those with another name in 0.6, and with a * those of 0.2 and 0.3."""
        self.supplied = {name: json.loads(value) for _, name, value, *_ in found if value}
        self.limits = {name: (float(low), float(high)) for _, name, _, low, high, _ in found if low}
        self.words = {name: words.split("|") for _, name, *_, words in found if words}


PLUGINS: dict[str, dict[str, Entry]] = {}
"""Plugins by kind and by type, those that they replace, of 0.2 and 0.3 with a *, or "" for all others."""


def _read(lines: list[str]) -> None:
    groups = dict(re.findall(r"^(\$\w+): (.*)", "\n".join(lines), re.MULTILINE))
    for line in lines:
        if line[0] not in "#$":
            head, words = line.split(":", 1)
            while "$" in words:
                words = re.sub(r"\$\w+", lambda group: groups[group[0]], words)
            kind, *types = head.partition("<")[0].split()
            plugins = PLUGINS.setdefault(kind, {})
            for type in types:
                entry = Entry(type.rstrip("?"), words)
                rest = [""] * type.endswith("?")
                plugins.update(dict.fromkeys([entry.type, *rest, *head.partition("<")[2].split()], entry))


_read((Path(__file__).parent / "plugins.txt").read_text(encoding="utf-8").splitlines())

RULES: dict[tuple[str, str], Callable[[Work, Element], Element | None]] = {}
"""The functions that change a plugin of a kind and a type, whose parts are those of Mitsuba 3, in place, or return what
replaces it. Under "" and a kind is the one for all its other types."""


def rule(kind: str, *types: str) -> Callable:
    def declare(function: Any) -> Any:
        RULES.update({(kind, type): function for type in types})
        return function

    return declare
