"""What drawings on a page share: colours, pictures as PNG, and the numbers of a scale."""

from __future__ import annotations

import base64

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array

# Viridis and ColorBrewer's RdBu, legible without telling red from green.
DENSITY = "440154 472d7b 3b528b 2c728e 21918c 28ae80 5ec962 addc30 fde725"
DEVIATION = "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f"
LEVELS = 63
IMPOSSIBLE = LEVELS + 1
"""The level of what no density may be, which is red."""


def gradient(name: str, colours: str) -> str:
    """Return a gradient of SVG, to refer to by its name."""
    stops = colours.split()
    marks = (f'<stop offset="{k / (len(stops) - 1):g}" stop-color="#{stop}"/>' for k, stop in enumerate(stops))
    return f'<linearGradient id="{name}">{"".join(marks)}</linearGradient>'


def levels_of(values: Array) -> Array:
    """Return the levels, from 1, of values from 0 to 1; 0 where they are NaN or -∞."""
    levels = 1 + np.round(np.clip(np.nan_to_num(values), 0, 1) * (LEVELS - 1))
    return np.where(np.isnan(values) | (values == -np.inf), 0, levels).astype(np.uint8)


def png(levels: Array, colours: str) -> str:
    """Return a picture in base64, transparent where the level is 0."""
    stops = np.array([[*bytes.fromhex(stop), 255] for stop in colours.split()])
    places = np.linspace(0, len(stops) - 1, LEVELS)
    shades = np.stack([np.interp(places, np.arange(len(stops)), channel) for channel in stops.T], axis=-1)
    palette = np.concatenate([[[0, 0, 0, 0]], np.round(shades), [[230, 0, 60, 255]]]).astype(np.uint8)
    stream = mi.MemoryStream()
    mi.Bitmap(palette[levels]).write(stream, mi.Bitmap.FileFormat.PNG, 9)
    return base64.b64encode(stream.raw_buffer()).decode()


def ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two others, two to five of them."""
    least = (high - low) / 5
    step = next(step for step in 10 ** np.floor(np.log10(least)) * np.array([1, 2, 5, 10]) if step >= least)
    return [round(k * step, 12) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def brief_number(value: float) -> str:
    """Return a number with two digits."""
    return f"{float(f'{value:.2g}'):g}"
