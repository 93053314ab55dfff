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

from ..coordinates import Spherical
from ..files import BinaryFile, decoded
from ..grid import Axis, Grid
from ..measurement import Measurement
from .merl import centres

NAME = "MBSDF"
MAGIC = "NVIDIA ARC MBSDF V1"
DESCRIPTION = f'the line "{MAGIC}"'
BLOCK = re.compile(rb"^MBSDF_DATA(_REFLECTION|_TRANSMISSION|)=\r?\n", re.MULTILINE)
"""The lines above blocks of data."""
CHANNELS = 1, 3
"""Of the types of blocks."""
LONGEST = 1 << 20
"""The most bytes of text above a block."""


def recognizes(path: Path, head: bytes) -> bool:
    return head.startswith(MAGIC.encode()) or path.suffix == ".mbsdf"


def read(path: Path) -> Measurement:
    file = BinaryFile(path)
    metadata: dict[str, str] = {}
    found: dict[str, np.ndarray] = {}
    while file.left:
        start = file.offset
        text = file.take("u1", min(file.left, LONGEST), "text").tobytes()
        if not start and text.splitlines()[0] != MAGIC.encode():
            raise file.error(f'the first line must be "{MAGIC}"', 0)
        if found and not text.strip():
            break
        block = BLOCK.search(text)
        if not block:
            raise file.error("text should follow, and below it a block of data", start)
        for line in decoded(text[: block.start()]).splitlines():
            key, equals, value = line.partition("=")
            if equals:
                metadata[key.strip()] = _unquoted(value)
        kind = "transmission" if b"TRANS" in block[0] else "reflection"
        if kind in found:
            raise file.error(f"a second block of {kind} follows", start + block.start())
        file.offset = start + block.end()
        found[kind] = _block(file)
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


def _unquoted(text: str) -> str:
    """Return the text between quotes, with what its escape sequences stand for."""
    return re.sub(r"\\([\\\"n])", lambda found: {"n": "\n"}.get(found[1], found[1]), text.strip().strip('"'))
