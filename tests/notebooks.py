"""Notebooks, as tests read and run them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib
import mitsuba as mi

matplotlib.use("Agg")

import matplotlib.pyplot as plt

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def read_notebook(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def run_notebook(path: Path) -> dict[str, Any]:
    """Execute the code cells of a notebook in order, in ``llvm_ad_rgb``; the namespace that they leave."""
    names: dict[str, Any] = {}
    try:
        with mi.variant_context("llvm_ad_rgb"):
            for cell in code_cells(read_notebook(path)):
                assert not cell["outputs"], "clear all outputs before you save a notebook"
                exec(compile("".join(cell["source"]), f"{path.name}: {cell['id']}", "exec"), names)
    finally:
        plt.close("all")
    return names
