"""Generate the balls that the explorer shows of published materials, on one sheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from mi_brdfs import preview, srgb
from mi_brdfs.explorer.materials import BALLS, BALLS_ACROSS, Materials
from mi_brdfs.explorer.stages import Setting, Stages, UserScene, rgba
from mi_brdfs.explorer.state import PRESET
from mi_brdfs.parameters import published
from mi_brdfs.preview import studio

from .made import Picture, code

FRAME, BALL, RISE, SAMPLES = 58, 42, 4, 64
"""The side of a picture and of the part around the ball, how much that lies above the middle, in pixels, and the
samples of each."""


def pictures() -> list[Picture]:
    return [Picture(BALLS, _sources, _draw)]


def _sources() -> list[str | bytes]:
    data = Path(published.__file__).with_name("published.json").read_bytes()
    return [data, repr((FRAME, BALL, RISE, SAMPLES, BALLS_ACROSS)), *map(code, (preview, studio, srgb))]


def _draw(path: Path) -> None:
    scenes, materials, names = Stages(UserScene()), Materials(), published.names()
    sheet = Image.new("RGB", (BALLS_ACROSS * BALL, -(-len(names) // BALLS_ACROSS) * BALL))
    margin = (FRAME - BALL) // 2
    for k, name in enumerate(names):
        ball = scenes.progress(Setting("studio", "sphere", FRAME))
        with materials.loaded(materials.expanded({"type": PRESET, "name": name})) as bsdf:
            while ball.spp < SAMPLES:
                ball.next_pass = SAMPLES
                ball.advance(bsdf)
        pixels = np.frombuffer(rgba(ball.pixels(), 0), np.uint8).reshape(FRAME, FRAME, 4)[..., :3]
        row, column = divmod(k, BALLS_ACROSS)
        part = Image.fromarray(pixels[margin - RISE : margin - RISE + BALL, margin : margin + BALL])
        sheet.paste(part, (column * BALL, row * BALL))
    sheet.save(path, quality=80, optimize=True)
