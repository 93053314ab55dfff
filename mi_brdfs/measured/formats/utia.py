"""UTIA .bin: anisotropic tables of the database of Filip and Vávra 2014, in θi, φi, θv and φv.

There is no header: three planes, red, green and blue, float64 (or float32) with φv running fastest, then θv, φi and θi.
Both azimuths go round, and both polar angles start at 0 and end one step before 90°: usually 48 steps of 7.5° and 6 of
15°. The size of a file tells the steps if those of φ are half of those of θ, as there. Beyond the last θ the last value
is held. In between, values are interpolated in Δφ = φv - φi and φi, which leaves a highlight in its place; nodes stay
nodes.

The file does not say what its values are. They are taken as linear sRGB (D65), as by most published readers; two decode
them as non-linear sRGB, at scales that differ by 140. They are f unless the ``quantity`` asked for is f cosθv.

J. Filip, R. Vávra, Template-based sampling of anisotropic BRDFs, Computer Graphics Forum 33(7), 2014,
doi:10.1111/cgf.12477.
"""

from __future__ import annotations

from math import isqrt
from pathlib import Path
from typing import Literal

import numpy as np

from ..coordinates import TWO_PI, Spherical
from ..files import BinaryFile
from ..grid import Axis, Grid
from ..measurement import Measurement, Quantity

NAME = "UTIA"
DESCRIPTION = "a .bin of three planes of 288 × 288 float64"
RATIO = 8
"""How many times as many azimuths as polar angles a file has: 360°/90° times the ratio of the steps."""
LARGEST = 1e12
"""The largest f that is believed: the float64 of half a file, read as float32, are up to 1e38."""


def recognizes(path: Path, head: bytes) -> bool:
    return path.suffix.lower() == ".bin"


def read(path: Path, quantity: Quantity) -> Measurement:
    file = BinaryFile(path)
    for dtype in (np.dtype("f8"), np.dtype("f4")):
        theta = isqrt(isqrt(file.left // (3 * dtype.itemsize)) // RATIO)
        if theta and 3 * (theta * RATIO * theta) ** 2 * dtype.itemsize == file.left:
            break
    else:
        raise file.error(
            f"the {file.left:,} bytes are not three planes of n × n numbers, where n is 288, 6 polar angles times 48 "
            "azimuths, or another number of polar angles times 8 times as many azimuths"
        )
    phi = RATIO * theta
    planes = file.take(dtype, 3 * (theta * phi) ** 2, "values").reshape(3, theta, phi, theta, phi)
    if np.max(np.abs(planes), where=np.isfinite(planes), initial=0) > LARGEST:
        raise file.error(
            f"there are numbers beyond {LARGEST:g}, which no BRDF has; it is truncated, or of another format", 0
        )
    values = np.empty((theta, theta, phi, phi, 3), dtype=np.float32)
    k = np.arange(phi)
    for delta in range(phi):
        with np.errstate(over="ignore", invalid="ignore"):
            # Two arrays of indices with a slice between them put their axis first.
            values[:, :, delta] = planes[:, :, k, :, (k + delta) % phi].transpose(2, 3, 0, 1).astype(np.float32)
    polar = Axis(np.arange(theta) * (np.pi / 2 / theta))
    if quantity == "f cos":
        values /= np.cos(polar.nodes, dtype=np.float32)[:, None, None, None]
    azimuth = Axis(np.arange(phi) * (TWO_PI / phi), period=TWO_PI)
    grid = Grid(Spherical(mirrored=False, anisotropic=True), (polar, polar, azimuth, azimuth), values)
    held: Literal["f", "f cos"] = "f" if quantity == "stated" else quantity
    notes = {"scale": f"taken as {held} in linear sRGB, which the file does not say"}
    return Measurement(path, NAME, grid, material=path.stem, quantity=held, notes=notes)
