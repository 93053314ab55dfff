"""MERL .binary, the tables of Matusik et al. 2003."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..coordinates import HalfDifference
from ..files import BinaryFile
from ..measurement import Axis, Grid, Measurement

NAME = "MERL"
DESCRIPTION = "three int32, such as 90, 90, 180, then float64"
SCALE = np.array([1, 1.15, 1.66]) / 1500
"""What the channels are multiplied by, as MERL's own reader does."""
MOST = 4096
"""The most nodes of an axis that a header is believed to mean."""


def recognizes(path: Path, head: bytes) -> bool:
    if len(head) < 12:
        return False
    dimensions = np.frombuffer(head, dtype="<i4", count=3)
    sizes = 12 + 24 * np.prod(dimensions.astype(np.float64))
    return path.suffix == ".binary" or (
        bool(np.all((dimensions > 0) & (dimensions <= MOST))) and sizes == path.stat().st_size
    )


def read(path: Path) -> Measurement:
    file = BinaryFile(path)
    dimensions = [int(n) for n in file.take("i4", 3, "dimensions")]
    if not all(0 < n <= MOST for n in dimensions):
        raise file.error(f"the dimensions are {dimensions}; they must be of θh, θd and φd, as 90, 90, 180", 0)
    theta_h, theta_d, phi_d = dimensions
    reciprocal = phi_d <= 2 * theta_d
    planes = file.take("f8", 3 * theta_h * theta_d * phi_d, "values")
    if file.left:
        raise file.error(f"{file.left:,} bytes follow the values; the dimensions are {dimensions}")
    values = np.empty((theta_h, theta_d, phi_d, 3), dtype=np.float32)
    for channel, plane in enumerate(planes.reshape(3, theta_h, theta_d, phi_d)):
        np.multiply(plane, SCALE[channel], out=values[..., channel], casting="unsafe")
    turn = np.pi if reciprocal else 2 * np.pi
    axes = (
        Axis(cells(theta_h, 1), low=0, high=1),
        Axis(cells(theta_d, np.pi / 2), low=0, high=np.pi / 2),
        Axis(cells(phi_d, turn), period=turn),
    )
    return Measurement(path, NAME, Grid(HalfDifference(reciprocal), axes, values), material=path.stem)


def cells(count: int, end: float) -> np.ndarray:
    """Return the centres of equal cells that fill [0, end]."""
    return (np.arange(count) + 0.5) * (end / count)
