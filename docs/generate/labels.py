"""Labels in pictures of scenes: the ids of shapes."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import mi_brdfs  # noqa: F401

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np
from PIL import Image, ImageDraw, ImageFont

SMALLEST = 9


class Label(NamedTuple):
    """A text and where it goes, as fractions of the picture: the middle of its upper edge or, inside a shape, of it."""

    text: str
    x: float
    y: float
    inside: bool


def labels_of(path: Path) -> list[Label]:
    """Return a label below each shape that has an id, or in its middle if it reaches the picture's edge or if another
    one with a label is below it."""
    scene = mi.load_file(str(path), optimize=False)
    width, height = scene.sensors()[0].film().size()
    y, x = np.mgrid[:height, :width]
    at = mi.Point2f((x.ravel() + 0.5) / width, (y.ravel() + 0.5) / height)
    ray, _ = scene.sensors()[0].sample_ray(0, 0, at, mi.Point2f(0.5))
    seen = scene.ray_intersect(ray).shape
    named = [shape for shape in scene.shapes() if shape.id() and not shape.id().startswith("_")]  # not Mitsuba's names
    areas = [np.array(seen == mi.ShapePtr(shape)).reshape(height, width) for shape in named]
    anything, margin = np.any(areas, axis=0), 0.01 * width
    labels = []
    for shape, where in zip(named, areas, strict=True):
        rows, columns = np.flatnonzero(where.any(axis=1)), np.flatnonzero(where.any(axis=0))
        inside = min(rows[0], columns[0], height - 1 - rows[-1], width - 1 - columns[-1]) < margin
        inside = inside or anything[min(rows[-1] + 2, height - 1), (columns[0] + columns[-1]) // 2]
        middle = [float(each[where].mean()) for each in (x, y)]
        below = (columns[0] + columns[-1]) / 2, rows[-1] + 0.01 * height
        at_x, at_y = middle if inside else below
        labels.append(Label(shape.id(), at_x / width, at_y / height, inside))
    return labels


def labelled(image: Image.Image, labels: list[Label]) -> Image.Image:
    """Return the picture with the labels, as large as they can be without touching each other."""
    image = image.copy()
    draw = ImageDraw.Draw(image)
    for size in range(max(image.width // 38, SMALLEST), SMALLEST - 1, -1):
        font = ImageFont.load_default(size)
        stroke = max(1, size // 9)
        boxes = [_box(draw, label, font, stroke, image.size) for label in labels]
        if not any(_touch(a, b) for a, b in combinations(boxes, 2)):
            break
    for label, box in zip(labels, boxes, strict=True):
        draw.text((box[0] + stroke, box[1]), label.text, "white", font, stroke_width=stroke, stroke_fill="#202020")
    return image


Box = tuple[float, float, float, float]


def _box(draw: ImageDraw.ImageDraw, label: Label, font: ImageFont.ImageFont, stroke: int, size: tuple) -> Box:
    left, _, right, bottom = draw.textbbox((0, 0), label.text, font, stroke_width=stroke)
    width, height = right - left, bottom + stroke
    x = min(max(label.x * size[0] - width / 2, 2), size[0] - width - 2)
    y = min(label.y * size[1] - (height / 2 if label.inside else 0), size[1] - height - 2)
    return x, y, x + width, y + height


def _touch(a: Box, b: Box) -> bool:
    gap = 12
    return a[0] < b[2] + gap and b[0] < a[2] + gap and a[1] < b[3] and b[1] < a[3]
