"""MERL .binary: tables in half and difference angles, the format of the 100 materials of Matusik et al. 2003.

Three int32 are the numbers of cells in θh, θd and φd, usually 90, 90 and 180; then follow the planes of red, green and
blue, float64 with φd running fastest and θh slowest. The cells are equal in √θh, θd and φd, and fill [0, √90°],
[0, 90°] and, because a reciprocal BRDF repeats itself after half a turn, φd of [0, 180°). Tables that are not
reciprocal have cells of the same size over the whole turn, 360 of them: a file with three or more times as many φd as
θd is taken to be one. Files with other numbers of cells are read as well, float32 ones are not: no program is known to
write them.

f is the value times 1/1500, 1.15/1500 and 1.66/1500 in red, green and blue. A value of -1, before or after that
scaling, marks what lies below the horizon or was not measured, and becomes NaN; other negative values are noise, and
stay.

Readers disagree on where in its cell a value belongs. Here it is at the centre, in the axes' own scale (√θh, θd, φd):
``nearest`` then is the look-up of MERL's own code, which rounds down to a cell, and ``trilinear`` interpolates between
centres. Readers that take the lower edges for the nodes see highlights narrower by half a cell.

W. Matusik, H. Pfister, M. Brand, L. McMillan, A data-driven reflectance model, ACM Transactions on Graphics 22(3),
2003, doi:10.1145/882262.882343.
"""

from __future__ import annotations

from math import prod
from pathlib import Path

import numpy as np

from ..arrays import stacked
from ..coordinates import HalfDifference
from ..files import BinaryFile
from ..grid import Axis, Grid
from ..measurement import Measurement
from ..source import Source

NAME = "MERL"
DESCRIPTION = "three int32, such as 90, 90, 180, then float64"
SCALE = np.array([1, 1.15, 1.66]) / 1500
"""What the channels are multiplied by, as MERL's own reader does."""
MISSING = -1
MOST = 4096
"""The most cells of an axis that a header is believed to mean."""


def recognizes(path: Path, head: bytes) -> bool:
    if path.suffix == ".binary" or len(head) < 12:
        return path.suffix == ".binary"
    dimensions = [int(n) for n in np.frombuffer(head, dtype="<i4", count=3)]
    return all(0 < n <= MOST for n in dimensions) and path.stat().st_size == 12 + 24 * prod(dimensions)


def read(path: Path) -> Measurement:
    file = BinaryFile(path)
    dimensions = [int(n) for n in file.take("i4", 3, "dimensions")]
    if not all(0 < n <= MOST for n in dimensions):
        raise file.error(f"the dimensions are {dimensions}; they must be of θh, θd and φd, as 90, 90, 180", 0)
    planes = file.take("f8", 3 * prod(dimensions), "values")
    if file.left:
        raise file.error(f"{file.left:,} bytes follow the values; the dimensions are {dimensions}")
    values = np.empty((*dimensions, 3), dtype=np.float32)
    for channel, plane in enumerate(planes.reshape(3, *dimensions)):
        with np.errstate(over="ignore", invalid="ignore"):
            np.multiply(plane, SCALE[channel], out=values[..., channel], casting="unsafe")
        values[..., channel][(plane == MISSING) | (values[..., channel] == MISSING)] = np.nan
    return Measurement(path, NAME, Grid(*cells(dimensions), values), material=path.stem)


def write(path: Path, source: Source, dimensions: tuple[int, int, int] = (90, 90, 180)) -> None:
    """Write the values at the centres of the cells, in linear sRGB, and -1 where one of the directions is below the
    horizon. Where φd of [0, 180°) stands for all of the turn, values are the means over both orders of the directions.

    Raises:
        ValueError: if the source is anisotropic.
        OSError: if the file cannot be written.
    """
    if source.anisotropic:
        raise ValueError("the BRDF is anisotropic, which MERL's tables cannot hold; .bsdf and .csv files can")
    evaluate = source.rgb().evaluate
    coordinates, axes = cells(dimensions)
    planes = np.full((3, *dimensions), float(MISSING))
    for k, root in enumerate(axes[0].nodes):
        theta_d, phi_d = np.meshgrid(axes[1].nodes, axes[2].nodes, indexing="ij")
        wi, wo = (stacked(w).reshape(-1, 3) for w in coordinates.directions(root, theta_d, phi_d))
        above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
        if above.any():
            wi, wo = wi[above], wo[above]
            f = (evaluate(wi, wo) + evaluate(wo, wi)) / 2 if coordinates.reciprocal else evaluate(wi, wo)
            planes[:, k].reshape(3, -1)[:, above] = (f / SCALE).T
    with path.open("wb") as file:
        file.write(np.array(dimensions, dtype="<i4").tobytes())
        file.write(planes.astype("<f8", copy=False).data)


def cells(dimensions: list[int] | tuple[int, int, int]) -> tuple[HalfDifference, tuple[Axis, ...]]:
    """Return the coordinates, and axes whose nodes are the centres of the cells."""
    theta_h, theta_d, phi_d = dimensions
    reciprocal = phi_d < 3 * theta_d
    turn = np.pi if reciprocal else 2 * np.pi
    axes = (
        Axis(centres(theta_h, 1), low=0, high=1),
        Axis(centres(theta_d, np.pi / 2), low=0, high=np.pi / 2),
        Axis(centres(phi_d, turn), period=turn),
    )
    return HalfDifference(reciprocal), axes


def centres(count: int, end: float) -> np.ndarray:
    """Return the centres of equal cells that fill [0, end]."""
    return (np.arange(count) + 0.5) * (end / count)
