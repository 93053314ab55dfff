"""Generate the picture of scenes/polarization/README.md: what the Stokes parameters of a scene say."""

from __future__ import annotations

from functools import partial
from math import cos, sin
from pathlib import Path

import mi_brdfs  # noqa: F401
from mi_brdfs.rendering.output import display_image

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np
from PIL import Image, ImageDraw

from .labels import Label, labelled, labels_of
from .made import ROOT, Picture, saved
from .scenes import sources

SCENE = ROOT / "scenes" / "polarization" / "balls.xml"
PICTURE = ROOT / "docs" / "scenes" / "polarization" / "balls.jpg"
VARIANT = "llvm_ad_spectral_polarized"
LUMINANCE = [0.2126, 0.7152, 0.0722]
CELL = 16
"""The distance of the strokes, in pixels."""
CIRCULAR = 0.2
"""The part of circular light that has the full colour."""
QUALITY = 90


def stokes(path: Path, spp: int | None = None, **defaults: str) -> np.ndarray:
    """Return the Stokes parameters of a scene, shape (height, width, 4, 3), in linear sRGB."""
    with mi.variant_context(VARIANT):
        image = np.array(mi.render(mi.load_file(str(path), **defaults), spp=spp or 0))
    return image[..., -12:].reshape(*image.shape[:2], 4, 3)


def polarized(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of the light that are linearly and, positive if to the right, circularly polarized."""
    s = s @ LUMINANCE
    intensity = np.maximum(s[..., 0], 1e-6)
    return np.hypot(s[..., 1], s[..., 2]) / intensity, s[..., 3] / intensity


def picture(path: Path, spp: int | None = None) -> Image.Image:
    """Return four views of a scene: what the eye sees, how much of the light is linearly polarized, along which
    direction, and how much is circularly polarized."""
    s = stokes(path, spp)
    linear, circular = polarized(s)
    seen = np.array(display_image(mi.Bitmap(s[:, :, 0].astype(np.float32))))
    with mi.variant_context(VARIANT):
        names = labels_of(path)
    turned = np.stack([np.clip(circular / CIRCULAR, 0, 1), 0 * circular, np.clip(-circular / CIRCULAR, 0, 1)], axis=-1)
    views = {
        "what the eye sees": Image.fromarray(seen),
        "linearly polarized part": _view(np.repeat(linear[..., None], 3, axis=-1)),
        "its direction": _strokes(s @ LUMINANCE, Image.fromarray(seen // 3)),
        "circularly polarized part": _view(turned),
    }
    height, width = seen.shape[:2]
    sheet = Image.new("RGB", (2 * width, 2 * height))
    labels = [Label(name.text, name.x / 2, name.y / 2, name.inside) for name in names]
    for k, (text, view) in enumerate(views.items()):
        x, y = k % 2, k // 2
        sheet.paste(view, (x * width, y * height))
        labels.append(Label(text, x / 2 + 0.25, y / 2, False))
    return labelled(sheet, labels)


def _view(values: np.ndarray) -> Image.Image:
    return Image.fromarray((255 * np.clip(values, 0, 1) + 0.5).astype(np.uint8))


def _strokes(s: np.ndarray, image: Image.Image) -> Image.Image:
    """Draw strokes along the electric field, as long as much of the light in their cell is linearly polarized."""
    draw = ImageDraw.Draw(image)
    height, width = s.shape[:2]
    for y in range(0, height - CELL + 1, CELL):
        for x in range(0, width - CELL + 1, CELL):
            mean = s[y : y + CELL, x : x + CELL].mean(axis=(0, 1))
            length = 0.5 * CELL * np.hypot(mean[1], mean[2]) / max(mean[0], 1e-6)
            angle = 0.5 * np.arctan2(mean[2], mean[1])
            dx, dy = length * cos(angle), -length * sin(angle)
            cx, cy = x + CELL / 2, y + CELL / 2
            draw.line((cx - dx, cy - dy, cx + dx, cy + dy), "white", 1)
    return image


def pictures() -> list[Picture]:
    return [Picture(PICTURE, partial(sources, SCENE), saved(partial(picture, SCENE), QUALITY))]
