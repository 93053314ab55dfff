"""Generate the pictures of scenes/shading/README.md: each scene shaded, and path-traced below."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import mi_brdfs  # noqa: F401
from mi_brdfs.rendering.output import denoise, display_image

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np
from PIL import Image
from PIL.ImageOps import invert

from .labels import Label, labelled, labels_of
from .made import ROOT, Picture, saved
from .scenes import sources

SCENES = sorted((ROOT / "scenes" / "shading").glob("*.xml"))
PICTURES = ROOT / "docs" / "scenes" / "shading"
LARGER, FINER, SAMPLES = 2, 3, 64


def picture(path: Path, spp: int = SAMPLES) -> Image.Image:
    """Return the shaded scene, supersampled 3 × 3 for smooth edges, above the path-traced one, denoised, with labels,
    for which both are larger than the scene says."""
    width, height = (LARGER * int(size) for size in mi.load_file(str(path)).sensors()[0].film().size())
    scene = mi.load_file(str(path), width=str(width), height=str(height))
    fine = mi.load_file(str(path), width=str(FINER * width), height=str(FINER * height))
    shaded = np.array(mi.render(fine, spp=1)).reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    traced = np.array(mi.render(scene, integrator=mi.load_dict({"type": "path", "max_depth": 5}), spp=spp))
    image = Image.fromarray(np.array(display_image(mi.Bitmap(np.concatenate([shaded, denoise(traced)])))))
    names = [label._replace(y=label.y / 2) for label in labels_of(path)]
    halves = [Label(text, 0, y, False) for text, y in (("shaded", 0), ("path-traced", 0.5))]
    if np.array(image)[0].mean() < 128:
        return labelled(image, [*names, *halves])
    return invert(labelled(invert(image), [*names, *halves]))  # black letters on the light ground


def pictures() -> list[Picture]:
    return [
        Picture(PICTURES / f"{path.stem}.jpg", partial(sources, path, SAMPLES), saved(partial(picture, path)))
        for path in SCENES
    ]
