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
OPENED = {"brushed_copper": 45, "rough_plaster": 45, "measured_paint": 70}
"""The angles of incidence at which they open, in degrees: black paint shines at grazing angles only."""
PAGES: dict[str, tuple[str, list[str]]] = {
    "brushed_copper": (
        "brushed copper",
        ["ward", "--labels", "brushed copper", *COPPER, "--vary", "alpha_u=0.03,0.1,0.3"],
    ),
    "rough_plaster": (
        "plaster, of Lambert and of Oren and Nayar",
        ["lambert", "orennayar", "-Dreflectance=#d8c8b0", "--vary", "sigma=0.1,0.3,0.5"],
    ),
    "measured_paint": (
        "a measured black paint and its fit",
        [MEASURED.name, "fit.json:walter", "--labels", "measured,fitted walter", "--exposure", "3"],
    ),
}
"""What each page shows: in words, and as arguments of ``mi-brdfs explore``."""


def links() -> str:
    """Return a paragraph that leads to the pages, with a picture of each."""
    cells = (f'<a href="{name}.html"><img src="{name}.jpg" alt="">{words}</a>' for name, (words, _) in PAGES.items())
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
            for name, (_, words) in PAGES.items():
                file = Path(f"{name}.html")
                _run("explore", *words, "--export", str(file))
                page = _linked(file.read_text(encoding="utf-8"))
                file.write_text(_opened(page, OPENED[name]), encoding="utf-8")
                file.with_suffix(".jpg").write_bytes(_picture(file.read_text(encoding="utf-8")))
        for used in ("fit.json", MEASURED.name):
            Path(used).unlink()
    finally:
        os.chdir(before)


def _linked(page: str) -> str:
    """Return an exported page whose name leads to the site."""
    return re.sub(r"<h1>mi_brdfs", '<h1><a href="index.html" style="color: inherit">mi_brdfs</a>', page, count=1)


def _opened(page: str, theta: float) -> str:
    """Return an exported page that opens at an angle of incidence."""
    content = json.loads(EXPORTED.search(page)[0])
    (angles,) = (it for it in content["scrubbers"] if it["name"] == "theta")
    angles["start"] = angles["values"].index(theta)
    return EXPORTED.sub(lambda _: json.dumps(content).replace("<", "\\u003c"), page, count=1)


def _picture(page: str) -> bytes:
    """Return the first picture of an exported page, a JPEG."""
    content = json.loads(EXPORTED.search(page)[0])
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
