"""NVIDIA .mbsdf: the measurements of the Material Definition Language (MDL), isotropic tables in θi, θo and Δφ.

Text comes first: the line "NVIDIA ARC MBSDF V1", then lines of metadata, key="value". A block of data follows the
line "MBSDF_DATA=" or "MBSDF_DATA_REFLECTION=", and one of transmission, which is not read, the line
"MBSDF_DATA_TRANSMISSION=". In a block three uint32 are its type (0: one channel, 1: rgb) and the numbers of steps of θ
and of φ; then come values of f, float32 with the channels and Δφ running fastest and θi slowest.

The steps divide θ in [0, 90°] and Δφ in [0, 180°] into equal cells. Values belong to their centres, as in the code by
which NVIDIA's SDK samples them; it also averages f over both orders of the directions, which is not done here.

NVIDIA, Material Definition Language 1.10, Language Specification, 2025, appendix B.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..axis import Axis
from ..coordinates import Spherical
from ..files import BinaryFile
from ..grid import Grid
from ..measurement import Measurement
from ..text import decoded
from .merl import centres

NAME = "MBSDF"
MAGIC = "NVIDIA ARC MBSDF V1"
DESCRIPTION = f'the line "{MAGIC}"'
BLOCKS = {
    "MBSDF_DATA=": "reflection",
    "MBSDF_DATA_REFLECTION=": "reflection",
    "MBSDF_DATA_TRANSMISSION=": "transmission",
}
"""The lines above blocks of data, and what these are of."""
CHANNELS = 1, 3
"""Of the types of blocks."""
LONGEST, LINES = 1 << 12, 10_000
"""The most bytes of a line of text, and the most lines."""


def recognizes(path: Path, head: bytes) -> bool:
    return head.startswith(MAGIC.encode()) or path.suffix == ".mbsdf"


def read(path: Path) -> Measurement:
    file = BinaryFile(path)
    if _line(file) != MAGIC:
        raise file.error(f'the first line must be "{MAGIC}"', 0)
    metadata: dict[str, str] = {}
    found: dict[str, np.ndarray] = {}
    lines = 0
    while file.left:
        start, line, lines = file.offset, _line(file), lines + 1
        key, equals, text = line.partition("=")
        if lines > LINES:
            raise file.error(f"there are more than {LINES:,} lines of text", start)
        if line in BLOCKS:
            if BLOCKS[line] in found:
                raise file.error(f"a second block of {BLOCKS[line]} follows", start)
            found[BLOCKS[line]] = _block(file)
        elif found and line.strip():
            raise file.error("another block of data or the end of the file should follow", start)
        elif equals:
            metadata[key.strip()] = _unquoted(text)
    if "reflection" not in found:
        raise file.error("the file ends, and it has no data of reflection")
    if "transmission" in found:
        metadata["transmission"] = "in the file, but not read"
    values = found["reflection"]
    theta, _, phi, _ = values.shape
    polar = Axis(centres(theta, np.pi / 2), low=0, high=np.pi / 2)
    azimuth = Axis(centres(phi, np.pi), low=0, high=np.pi)
    grid = Grid(Spherical(mirrored=True), (polar, polar, azimuth), values)
    return Measurement(path, NAME, grid, material=metadata.get("name") or path.stem, notes=metadata)


def _block(file: BinaryFile) -> np.ndarray:
    """Return the values of a block, shape (θ, θ, φ, 3): one channel becomes three equal ones."""
    kind, theta, phi = (int(n) for n in file.take("u4", 3, "type and numbers of steps"))
    if kind >= len(CHANNELS):
        raise file.error(f"the type of a block is {kind}; it must be 0, one channel, or 1, rgb", file.offset - 12)
    if not theta or not phi:
        raise file.error(f"there are {theta} steps of θ and {phi} of φ; there must be some", file.offset - 8)
    values = file.take("f4", theta * theta * phi * CHANNELS[kind], "values").reshape(theta, theta, phi, -1)
    return values if kind else np.repeat(values, 3, axis=-1)


def _line(file: BinaryFile) -> str:
    """Return the next line, and move behind it."""
    start = file.offset
    line, end, _ = file.take("u1", min(file.left, LONGEST), "text").tobytes().partition(b"\n")
    if not end:
        raise file.error("a line of text should follow, or a block of data", start)
    file.offset = start + len(line) + 1
    return decoded(line).rstrip("\r")


def _unquoted(text: str) -> str:
    """Return the text between quotes, with what its escape sequences stand for."""
    return re.sub(r"\\([\\\"n])", lambda found: {"n": "\n"}.get(found[1], found[1]), text.strip().strip('"'))
