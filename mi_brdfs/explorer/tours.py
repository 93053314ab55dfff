"""Guided tours: Markdown files, of a title, and of steps with a heading, a state as JSON, and some paragraphs."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

STEP = re.compile(
    r"^## (?P<title>[^\n]+)\n+```json\n(?P<state>.*?)\n```\n+(?P<text>.*?)\s*(?=^## |\Z)", re.MULTILINE | re.DOTALL
)


def parse(name: str, source: str) -> dict[str, Any]:
    """Return a tour as the page takes it, or raise a ValueError."""
    title = re.match(r"# (.+)\n", source)
    steps = [
        {"title": step["title"], "state": json.loads(step["state"]), "text": step["text"]}
        for step in STEP.finditer(source)
    ]
    if not title or not steps or len(steps) != len(re.findall(r"^## ", source, re.MULTILINE)):
        raise ValueError(f"{name}: a tour has a title, and steps with a heading, a block of JSON and a text.")
    return {"name": name, "title": title[1], "steps": steps}


@cache
def tours() -> list[dict[str, Any]]:
    """Return the tours of the pack, in the order of the numbers in their names."""
    found = sorted((Path(__file__).parent / "tours").glob("*.md"))
    return [parse(it.stem.partition("-")[2], it.read_text(encoding="utf-8")) for it in found]
