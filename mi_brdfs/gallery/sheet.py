"""Labelled pictures in rows, as one image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

PAPER, INK, FAINT, FIRST = "#15181d", "#e8eaed", "#9aa0a8", "#e8912d"
PROFILES = "Below each picture: the luminance along its middle line; orange: that of the first."
GAP = 8
FINER = 3
"""How many times larger profiles are drawn, for smooth lines."""


class Row(NamedTuple):
    """Pictures of the same size, side by side."""

    headings: dict[int, str]
    """The headings above, by the column where they begin."""
    pictures: list[Image.Image]
    captions: list[str]
    """A caption below each picture; its second line is fainter."""
    profiles: Sequence[np.ndarray] = ()
    """If any, the brightness across each picture, drawn below it beside the first one, which is orange."""


def sheet(rows: list[Row], width: int = 0) -> Image.Image:
    """Return the rows as one image, at least so wide. Columns are as wide as the pictures, or as the captions need."""
    size = rows[0].pictures[0].width
    font = ImageFont.load_default(max(11, size // 11))
    line = sum(font.getmetrics())
    captions = [caption for row in rows for caption in row.captions]
    most = max(len(row.pictures) for row in rows)
    column = max(size, *(_width(font, caption) + GAP for caption in captions)) + GAP
    column = max(column, (width - GAP) // most)
    lines = max(caption.count("\n") for caption in captions) + 1
    heights = [
        size + lines * line + 2 * GAP + bool(row.headings) * (line + GAP // 2) + bool(row.profiles) * (line + size // 3)
        for row in rows
    ]
    reach = [column * at + _width(font, text) + GAP for row in rows for at, text in row.headings.items()]
    reach += [_width(font, PROFILES) + GAP for row in rows if row.profiles]
    width = max(width, *(GAP + it for it in [column * most, *reach]))

    image = Image.new("RGB", (width, sum(heights) + GAP), PAPER)
    draw = ImageDraw.Draw(image)
    top = GAP
    for row, height in zip(rows, heights, strict=True):
        y = top
        for at, text in row.headings.items():
            draw.text((GAP + at * column, y), text, INK, font)
        y += line + GAP // 2 if row.headings else 0
        for k, (picture, caption) in enumerate(zip(row.pictures, row.captions, strict=True)):
            x = GAP + k * column
            left = x + (column - GAP - size) // 2
            image.paste(picture, (left, y))
            below = y + size
            if row.profiles:
                image.paste(_profile(row.profiles, k, size), (left, below))
                below += size // 3
            for number, text in enumerate(caption.split("\n")):
                middle = (x + (column - GAP) / 2, below + GAP // 4 + number * line)
                draw.text(middle, text, FAINT if number else INK, font, anchor="ma")
        if row.profiles:
            draw.text((GAP, top + height - GAP), PROFILES, FAINT, font, anchor="ld")
        top += height
    return image


def _profile(profiles: Sequence[np.ndarray], k: int, size: int) -> Image.Image:
    """Return the k-th profile over the first one, both from zero to the brightest of all."""
    width, height = size * FINER, size // 3 * FINER
    image = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(image)
    top = max(max(np.max(each) for each in profiles), 1e-9)
    floor = height - 2 * FINER
    for each, colour in ((profiles[0], FIRST), (profiles[k], INK)):
        x = (np.arange(len(each)) + 0.5) * width / len(each)
        y = floor - np.clip(each / top, 0, 1) * (floor - 3 * FINER)
        draw.line(list(zip(x.tolist(), y.tolist(), strict=True)), colour, 2 * FINER, joint="curve")
    return image.resize((size, height // FINER), Image.Resampling.LANCZOS)


def _width(font: Any, text: str) -> int:
    return max(int(font.getlength(line)) + 1 for line in text.split("\n"))
