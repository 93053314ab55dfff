"""Pages of the explorer, exported: they need no server and no installation."""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import os
import re
import shutil
from pathlib import Path

from generate.made import ROOT

from mi_brdfs.cli import app

MEASURED = ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf"
COPPER = ("-Dalpha_v=0.3", "-Ddiffuse_reflectance=0.02", "-Dspecular_reflectance=#f9cfc0")
EXPORTED = re.compile(r'(?<=id="exported">).*?(?=</script>)', re.DOTALL)
PAGES: dict[str, tuple[str, float, list[str]]] = {
    "brushed_copper": (
        "brushed copper",
        45,
        ["ward", "--labels", "brushed copper", *COPPER, "--vary", "alpha_u=0.03,0.1,0.3"],
    ),
    "rough_plaster": (
        "plaster, of Lambert and of Oren and Nayar",
        45,
        ["lambert", "orennayar", "-Dreflectance=#d8c8b0", "--vary", "sigma=0.1,0.3,0.5"],
    ),
    "measured_paint": (
        "a measured black paint and its fit",
        70,  # it shines at grazing angles only
        [MEASURED.name, "fit.json:walter", "--labels", "measured,fitted walter", "--exposure", "3"],
    ),
}
"""What each page shows: in words, at which angle of incidence at first, and as arguments of ``mi-brdfs explore``."""


def links() -> str:
    """Return a paragraph that leads to the pages, with a picture of each."""
    cells = (f'<a href="{name}.html"><img src="{name}.jpg" alt="">{words}</a>' for name, (words, *_) in PAGES.items())
    return f'Try it without installing anything:\n\n<div class="live">{"".join(cells)}</div>'


def write_pages(folder: Path) -> None:
    """Write the pages into a new folder."""
    folder.mkdir()
    before = os.getcwd()
    os.chdir(folder)  # pages name files as they are given
    try:
        shutil.copy(MEASURED, MEASURED.name)
        with contextlib.redirect_stdout(io.StringIO()):
            _run("fit", MEASURED.name, "--model", "walter", "--starts", "1", "--json", "fit.json")
            for name, (_, theta, words) in PAGES.items():
                _run("explore", *words, "--export", f"{name}.html")
                _finish(Path(f"{name}.html"), theta)
        for used in ("fit.json", MEASURED.name):
            Path(used).unlink()
    finally:
        os.chdir(before)


def _finish(file: Path, theta: float) -> None:
    """Let the name of an exported page lead to the site, and the page open at an angle; write its picture beside it."""
    page = file.read_text(encoding="utf-8")
    page = page.replace("<h1>mi_brdfs", '<h1><a href="index.html" style="color: inherit">mi_brdfs</a>', 1)
    content = json.loads(EXPORTED.search(page)[0])
    (angles,) = (it for it in content["scrubbers"] if it["name"] == "theta")
    angles["start"] = angles["values"].index(theta)
    file.write_text(EXPORTED.sub(lambda _: json.dumps(content).replace("<", "\\u003c"), page, 1), encoding="utf-8")
    file.with_suffix(".jpg").write_bytes(_picture(content))


def _picture(content: dict) -> bytes:
    """Return the first picture that an exported page holds, a JPEG."""
    data, at = gzip.decompress(base64.b64decode(content["data"])), 0
    for _, length, is_text in content["frames"]:
        frame, at = data[at : at + length], at + length
        end = 4 + int.from_bytes(frame[:4], "little")
        if not is_text and json.loads(frame[4:end])["type"] == "picture":
            return frame[end:]
    raise ValueError("the page has no picture")


def _run(*words: str) -> None:
    if status := app(list(words), standalone_mode=False):
        raise RuntimeError(f"mi-brdfs {' '.join(words)} ended with {status}")
