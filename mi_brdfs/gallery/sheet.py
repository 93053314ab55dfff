"""Labelled pictures in rows, as one image."""

from __future__ import annotations

from typing import Any, NamedTuple

from PIL import Image, ImageDraw, ImageFont

PAPER, INK, FAINT = "white", "#222222", "#666666"
GAP = 8


class Row(NamedTuple):
    """Pictures of the same size, side by side."""

    heading: str
    """The heading above them; may be empty."""
    pictures: list[Image.Image]
    captions: list[str]
    """A caption below each picture; its second line is fainter."""


def sheet(rows: list[Row]) -> Image.Image:
    """Return the rows as one image. Columns are as wide as the pictures, or as the captions need."""
    size = rows[0].pictures[0].width
    font = ImageFont.load_default(max(11, size // 11))
    line = sum(font.getmetrics())
    captions = [caption for row in rows for caption in row.captions]
    column = max(size, *(_width(font, caption) for caption in captions)) + GAP
    lines = max(caption.count("\n") for caption in captions) + 1
    heights = [(line + GAP // 2 if row.heading else 0) + size + lines * line + 2 * GAP for row in rows]
    width = max([column * len(row.pictures) for row in rows] + [_width(font, row.heading) + GAP for row in rows])

    image = Image.new("RGB", (width + GAP, sum(heights) + GAP), PAPER)
    draw = ImageDraw.Draw(image)
    top = GAP
    for row, height in zip(rows, heights, strict=True):
        y = top
        if row.heading:
            draw.text((GAP, y), row.heading, INK, font)
            y += line + GAP // 2
        for k, (picture, caption) in enumerate(zip(row.pictures, row.captions, strict=True)):
            x = GAP + k * column
            image.paste(picture, (x + (column - GAP - size) // 2, y))
            for number, text in enumerate(caption.split("\n")):
                middle = (x + (column - GAP) / 2, y + size + GAP // 4 + number * line)
                draw.text(middle, text, FAINT if number else INK, font, anchor="ma")
        top += height
    return image


def _width(font: Any, text: str) -> int:
    return max(int(font.getlength(line)) + 1 for line in text.split("\n"))
