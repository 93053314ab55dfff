"""Notebooks, as tests read and run them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from unittest.mock import patch

import matplotlib
import mitsuba as mi
from generate.notebooks import FOLDER, NOTEBOOKS, code_cells
from generate.notebooks import read as read_notebook

matplotlib.use("Agg")

import matplotlib.pyplot as plt

__all__ = ["FOLDER", "NOTEBOOKS", "code_cells", "read_notebook", "run_notebook"]


SHOWN = "anatomy_of_a_microfacet_brdf", "from_a_goniometer_to_a_picture", "meet_the_models"
"""Notebooks whose renderings are to be looked at; others fit them and compare them."""
SAMPLES = 16
"""Samples per pixel of these renderings in a test."""


def run_notebook(path: Path) -> dict[str, Any]:
    """Execute the code cells of a notebook in order, in ``llvm_ad_rgb`` and in its folder; the namespace that they
    leave."""
    names: dict[str, Any] = {}
    folder = os.getcwd()
    os.chdir(path.parent)
    try:
        with mi.variant_context("llvm_ad_rgb"), patch("mitsuba.render", noisy if path.stem in SHOWN else mi.render):
            for cell in code_cells(read_notebook(path)):
                exec(compile("".join(cell["source"]), f"{path.name}: {cell['id']}", "exec"), names)
    finally:
        os.chdir(folder)
        plt.close("all")
    return names


def noisy(scene, render=mi.render, spp=None):
    """``mi.render`` with few samples."""
    return render(scene, spp=SAMPLES)
