"""Pages of the explorer, exported: they need no server and no installation."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
from pathlib import Path

from generate.made import ROOT

from mi_brdfs.cli import app

MEASURED = ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf"
COPPER = ("-Dalpha_v=0.3", "-Ddiffuse_reflectance=0.02", "-Dspecular_reflectance=#f9cfc0")
PAGES: dict[str, tuple[str, list[str]]] = {
    "brushed_copper": ("brushed copper", ["ward", *COPPER, "--vary", "alpha_u=0.03,0.1,0.3"]),
    "rough_plaster": (
        "smooth and rough plaster",
        ["lambert", "orennayar", "-Dreflectance=#d8c8b0", "--vary", "sigma=0.1,0.3,0.5"],
    ),
    "measured_paint": ("a measured black paint and its fit", [MEASURED.name, "fit.json:walter"]),
}
"""What each page shows: in words, and as arguments of ``mi-brdfs explore``."""


def links() -> str:
    """Return a paragraph that leads to the pages."""
    *most, last = (f'<a href="{name}.html">{words}</a>' for name, (words, _) in PAGES.items())
    return f"Try it without an installation: {', '.join(most)}, or {last}."


def write_pages(folder: Path) -> None:
    """Write the pages into a new folder."""
    folder.mkdir()
    before = os.getcwd()
    os.chdir(folder)  # pages name files as they are given
    try:
        shutil.copy(MEASURED, MEASURED.name)
        with contextlib.redirect_stdout(io.StringIO()):
            _run("fit", MEASURED.name, "--model", "walter", "--starts", "1", "--json", "fit.json")
            for name, (_, words) in PAGES.items():
                _run("explore", *words, "--export", f"{name}.html")
        for file in ("fit.json", MEASURED.name):
            Path(file).unlink()
    finally:
        os.chdir(before)


def _run(*words: str) -> None:
    if status := app(list(words), standalone_mode=False):
        raise RuntimeError(f"mi-brdfs {' '.join(words)} ended with {status}")
