"""Execute the notebooks, which carry their outputs."""

from __future__ import annotations

import base64
import io
import json
import re
from functools import partial
from pathlib import Path
from typing import Any

from PIL import Image

from .made import ROOT, Picture

FOLDER = ROOT / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
COLOURS, GROUND, QUALITY, WIDTH = 128, 0.55, 82, 1500
SECONDS = 900
ALONE = """\
import importlib.metadata as metadata
import os

os.environ.pop("MI_BRDFS_DATA", None)
found = metadata.entry_points
metadata.entry_points = lambda **which: () if which.get("group") == "mi_brdfs.models" else found(**which)
get_ipython().run_line_magic("config", "InlineBackend.figure_format = 'retina'")
"""
"""A first cell that hides the models of other packages, and the measured materials of whoever runs it, and doubles the
resolution of pictures."""


def pictures() -> list[Picture]:
    """Return the notebooks, which are stale once their code has changed."""
    return [Picture(path, partial(_code, path), _execute) for path in NOTEBOOKS]


def read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def write(path: Path, notebook: dict[str, Any]) -> None:
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def _code(path: Path) -> list[str | bytes]:
    return ["".join(cell["source"]) for cell in code_cells(read(path))]


def _execute(path: Path) -> None:
    """Execute a notebook from its start, and keep what it shows, in pictures of a moderate size."""
    try:
        import nbformat
        from nbclient import NotebookClient
    except ImportError:
        raise SystemExit("notebooks need Jupyter: pip install 'mi_brdfs[notebook]'") from None
    notebook = read(path)
    executed = nbformat.read(path, 4)
    executed.cells.insert(0, nbformat.v4.new_code_cell(ALONE))
    where = {"metadata": {"path": str(path.parent)}}
    NotebookClient(executed, timeout=SECONDS, resources=where, coalesce_streams=True, record_timing=False).execute()
    done = [cell for cell in executed.cells[1:] if cell.cell_type == "code"]
    for cell, result in zip(code_cells(notebook), done, strict=True):
        cell["execution_count"] = result.execution_count - 1
        cell["outputs"] = [*map(_output, result.outputs)]
    write(path, notebook)


def _output(output: dict[str, Any]) -> dict[str, Any]:
    """Return an output as it is kept: text by lines, pictures reduced, and those within HTML by
    themselves."""
    if output["output_type"] == "stream":
        return {"name": output["name"], "output_type": "stream", "text": output["text"].splitlines(keepends=True)}
    data, metadata = dict(output["data"]), {}
    kept = {"text/plain": data["text/plain"].splitlines(keepends=True)}
    if found := re.search(r"data:image/jpeg;base64,\s*([^\"']+)", data.get("text/html", "")):  # of mi.Bitmap
        kept = {"image/jpeg": found[1], "text/plain": ["Bitmap"]}
    elif "image/png" in data:
        kind, kept_picture = _reduced(data["image/png"])
        kept = {kind: kept_picture, "text/plain": kept["text/plain"]}
        if shown := output["metadata"].get("image/png"):
            metadata = {kind: shown}
    count = {"execution_count": output["execution_count"] - 1} if "execution_count" in output else {}
    return {**output, **count, "data": kept, "metadata": metadata}


def _reduced(encoded: str) -> tuple[str, str]:
    """Return the kind of a picture, and the picture with fewer columns: a PNG with fewer colours if most of it is one
    ground, as in plots, or else a JPEG, since smooth shading would have rings."""
    image = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    buffer, area = io.BytesIO(), image.width * image.height
    is_drawn = max(image.getcolors(area))[0] > GROUND * area
    if image.width > WIDTH:
        image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    if is_drawn:
        few = image.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(buffer, "png", optimize=True)
    else:
        image.save(buffer, "jpeg", quality=QUALITY, subsampling=0, optimize=True)
    return "image/png" if is_drawn else "image/jpeg", base64.b64encode(buffer.getvalue()).decode()
