"""The plugins that are written, and what those of Mitsuba 0.2 to 0.6 and their properties are called now."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any


class Entry:
    """A plugin of Mitsuba 3."""

    def __init__(self, type: str, words: str) -> None:
        self.type = type
        self.known: set[str] = set()
        """Its properties, and the kinds that it holds, as ``<kind>``."""
        self.renamed: dict[str, str] = {}
        """Those with another name in 0.6, and with a * those of 0.2 and 0.3."""
        self.supplied: dict[str, Any] = {}
        self.limits: dict[str, tuple[float, float]] = {}
        for old, name, value, low, high in re.findall(r"(?:(\w+\*?)>)?(<?\w+>?)(?:=(\S+))?(?:@(\S+)\.\.(\S+))?", words):
            self.known.add(name)
            if old:
                self.renamed[old] = name
            if value:
                self.supplied[name] = json.loads(value)
            if low:
                self.limits[name] = float(low), float(high)


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
