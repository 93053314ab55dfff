"""Generate the balls that the explorer shows of published materials and of models, on a sheet each."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from mi_brdfs import preview, srgb
from mi_brdfs.explorer.materials import BALLS, BALLS_ACROSS, Materials
from mi_brdfs.explorer.stages import Setting, Stages, UserScene, rgba
from mi_brdfs.explorer.state import PRESET
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.parameters import published
from mi_brdfs.preview import studio

from .made import Picture, code, saved

FRAME, BALL, RISE, SAMPLES = 58, 42, 4, 400
"""The side of a picture and of the part around the ball, how much that lies above the middle, in pixels, and the
samples of each."""


def pictures() -> list[Picture]:
    published_ones = [{"type": PRESET, "name": name} for name in published.names()]
    models = [{"type": model.plugins[0]} for model in own_models()]
    data = Path(published.__file__).with_name("published.json").read_bytes()
    examples = repr([model.example() for model in own_models()])
    row = BALLS.with_name("models.jpg")
    return [
        _picture(BALLS, data, published_ones, BALLS_ACROSS),
        _picture(row, examples, models, len(models)),
    ]


def _picture(path: Path, data: str | bytes, bsdfs: Sequence[dict], across: int) -> Picture:
    def sources() -> list[str | bytes]:
        return [data, repr((FRAME, BALL, RISE, SAMPLES, across)), *map(code, (preview, studio, srgb))]

    return Picture(path, sources, saved(partial(_drawn, bsdfs, across), 80))


def _drawn(bsdfs: Sequence[dict], across: int) -> Image.Image:
    scenes, materials = Stages(UserScene()), Materials()
    sheet = Image.new("RGB", (across * BALL, -(-len(bsdfs) // across) * BALL))
    margin = (FRAME - BALL) // 2
    for k, bsdf in enumerate(bsdfs):
        ball = scenes.progress(Setting("studio", "sphere", FRAME))
        with materials.loaded(materials.expanded(bsdf)) as loaded:
            while ball.spp < SAMPLES:
                ball.next_pass = SAMPLES
                ball.advance(loaded)
        pixels = np.frombuffer(rgba(ball.pixels(), 0), np.uint8).reshape(FRAME, FRAME, 4)[..., :3]
        row, column = divmod(k, across)
        part = Image.fromarray(pixels[margin - RISE : margin - RISE + BALL, margin : margin + BALL])
        sheet.paste(part, (column * BALL, row * BALL))
    return sheet
