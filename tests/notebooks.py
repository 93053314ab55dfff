"""Notebooks, as tests read and run them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from unittest.mock import patch

import matplotlib
import mitsuba as mi
import numpy as np
from generate.notebooks import FOLDER, NOTEBOOKS, code_cells
from generate.notebooks import read as read_notebook

from mi_brdfs.fit import pictures

matplotlib.use("Agg")

import matplotlib.pyplot as plt

__all__ = ["FOLDER", "NOTEBOOKS", "code_cells", "read_notebook", "run_notebook"]


SAMPLES = 16
"""Samples per pixel, in a test, of renderings that take theirs from the scene: these are to be looked at, and others
are fitted and compared."""
MOST = 1 << 22
"""The most samples of others, unless they have as few for each pixel."""
FITTED = 1 << 16
"""Samples of a rendering within a fit to pictures: its noise, and sigma, are twice as large."""


def run_notebook(path: Path) -> dict[str, Any]:
    """Execute the code cells of a notebook in order, in ``llvm_ad_rgb`` and in its folder; the namespace that they
    leave."""
    names: dict[str, Any] = {}
    folder = os.getcwd()
    os.chdir(path.parent)
    try:
        few = patch.object(pictures, "SAMPLES", FITTED)
        with mi.variant_context("llvm_ad_rgb"), patch("mitsuba.render", noisy), few:
            for cell in code_cells(read_notebook(path)):
                exec(compile("".join(cell["source"]), f"{path.name}: {cell['id']}", "exec"), names)
    finally:
        os.chdir(folder)
        plt.close("all")
    return names


def noisy(scene, *args, render=mi.render, spp=SAMPLES, **options):
    """``mi.render`` with few samples, unless it is told their number, and not with very many."""
    pixels = int(np.prod(scene.sensors()[0].film().size()))
    return render(scene, *args, spp=min(spp, max(SAMPLES, MOST // pixels)), **options)
