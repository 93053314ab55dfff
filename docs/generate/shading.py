"""Generate the pictures of scenes/shading/README.md: each scene shaded, and path-traced below."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import mi_brdfs  # noqa: F401
from mi_brdfs.render import display_image

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np

from .made import ROOT, Picture
from .scenes import read

SCENES = sorted((ROOT / "scenes" / "shading").glob("*.xml"))
PICTURES = ROOT / "docs" / "scenes" / "shading"
FINER, SAMPLES, QUALITY = 3, 1024, 88


def picture(path: Path, spp: int = SAMPLES) -> mi.Bitmap:
    """Return the shaded scene, supersampled 3 × 3 for smooth edges, above the path-traced one."""
    scene = mi.load_file(str(path))
    width, height = scene.sensors()[0].film().size()
    fine = mi.load_file(str(path), width=str(FINER * width), height=str(FINER * height))
    shaded = np.array(mi.render(fine, spp=1)).reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    traced = np.array(mi.render(scene, integrator=mi.load_dict({"type": "path", "max_depth": 5}), spp=spp))
    return display_image(mi.Bitmap(np.concatenate([shaded, traced])))


def pictures() -> list[Picture]:
    return [Picture(PICTURES / f"{path.stem}.jpg", partial(read, path), partial(_draw, path)) for path in SCENES]


def _draw(scene: Path, path: Path) -> None:
    picture(scene).write(str(path), quality=QUALITY)
