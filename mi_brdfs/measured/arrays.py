"""One spelling for NumPy and for Dr.Jit: formulas of directions are written once, and used on files by the one and in
kernels by the other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import EPSILON, TINY

UNIT = 1e-3
"""By how much the length of a unit vector may be off."""
NUMPY = SimpleNamespace(
    sqrt=lambda x: np.sqrt(np.maximum(x, 0)),
    atan2=np.arctan2,
    select=np.where,
    maximum=np.maximum,
    minimum=np.minimum,
    floor=np.floor,
    integer=lambda x: x.astype(np.int64),
)


def _atan2(y: Any, x: Any) -> Any:
    """Return dr.atan2, and a constant where both are so small that its derivative would divide by 0."""
    far = abs(x) + abs(y) > EPSILON
    return dr.atan2(dr.select(far, y, 0), dr.select(far, x, 1))


DRJIT = SimpleNamespace(
    sqrt=lambda x: dr.sqrt(dr.maximum(x, TINY)),
    atan2=_atan2,
    select=dr.select,
    maximum=dr.maximum,
    minimum=dr.minimum,
    floor=dr.floor,
    integer=lambda x: mi.UInt32(x),  # that of the variant that is active then
)


def vector(x: Any, y: Any, z: Any) -> SimpleNamespace:
    """Return a vector of NumPy arrays or Dr.Jit floats, by component."""
    return SimpleNamespace(x=x, y=y, z=z)


def components(w: np.ndarray) -> SimpleNamespace:
    """Return unit vectors, shape (…, 3), by component. Raise a ValueError for other shapes and lengths: near grazing,
    half vectors would turn."""
    w = np.asarray(w, dtype=np.float64)
    if w.shape[-1:] != (3,):
        raise ValueError(f"directions must be arrays of shape (…, 3), not {w.shape}")
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    length = np.hypot(np.hypot(x, y), z)
    unit = abs(length - 1) <= UNIT
    if not np.all(unit):
        raise ValueError(f"directions must have the length 1, not {length[~unit][0]:.4g}")
    return vector(x, y, z)


def stacked(w: SimpleNamespace) -> np.ndarray:
    """Return a vector by component as an array of shape (…, 3)."""
    return np.stack(np.broadcast_arrays(w.x, w.y, w.z), axis=-1)
