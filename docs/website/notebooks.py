"""Notebooks as pages, with the outputs that they carry."""

from __future__ import annotations

import base64
import itertools
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

GLANCE = "glance"
"""The tag of the cell whose first picture stands for the notebook, and the end of that picture's name."""
TABLE = re.compile(r"\S {2,}\S")
"""What is in texts with columns."""
WIDE = 900
"""The width of a picture, in pixels of the page, through which phones scroll."""


def markdown(path: Path, pictures: Path) -> str:
    """Return a notebook in Markdown, with solutions folded; write its pictures into a folder, a sibling of the page."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    drawn = (pictures / f"{path.stem}_{k}" for k in itertools.count())
    glance = pictures / f"{path.stem}_{GLANCE}"
    parts = []
    for solution, group in itertools.groupby(cells, lambda cell: "solution" in cell["metadata"].get("tags", ())):
        if solution:
            parts += _solutions(group, drawn)
            continue
        for cell in group:
            stands = GLANCE in cell["metadata"].get("tags", ())
            parts.append(_cell(cell, itertools.chain([glance], drawn) if stands else drawn))
    return "\n\n".join(parts) + "\n"


def _solutions(cells: Iterator[dict[str, Any]], drawn: Iterator[Path]) -> Iterator[str]:
    """Yield each solution, which begins with its number in bold, as text that unfolds."""
    texts: list[str] = []
    for cell in [*cells, None]:
        if texts and (cell is None or cell["cell_type"] == "markdown"):
            title, _, text = "\n\n".join(texts).partition(".** ")
            yield f"<details>\n<summary>{title.lstrip('*')}</summary>\n\n{text}\n\n</details>"
            texts = []
        if cell is not None:
            texts.append(_cell(cell, drawn))


def _cell(cell: dict[str, Any], drawn: Iterator[Path]) -> str:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return source
    outputs = [_output(output, drawn) for output in cell["outputs"]]
    return "\n\n".join([f"```python\n{source}\n```", *filter(None, outputs)])


def _output(output: dict[str, Any], drawn: Iterator[Path]) -> str:
    data = output.get("data", {})
    for kind in sorted(data.keys() & {"image/png", "image/jpeg"}):
        path = next(drawn).with_suffix(f".{kind.removeprefix('image/')}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode("".join(data[kind])))
        with Image.open(path) as image:
            width = output["metadata"].get(kind, {}).get("width", image.width)
        strip = ".strip " * (width >= WIDE)
        return f"![](/notebooks/{path.parent.name}/{path.name}){{{strip}width={width}}}"
    text = "".join(output.get("text", data.get("text/plain", ""))).rstrip()
    language = "output" if TABLE.search(text) else "text"  # neither has colours; the style sheet wraps only text
    return f"```{language}\n{text}\n```" if text else ""
