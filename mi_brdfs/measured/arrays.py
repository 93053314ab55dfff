"""One spelling for NumPy and for Dr.Jit: formulas of directions are written once, and used on files by the one and in
kernels by the other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import drjit as dr
import numpy as np

from ..math import EPSILON, TINY

NUMPY = SimpleNamespace(
    sqrt=lambda x: np.sqrt(np.maximum(x, 0)),
    atan2=np.arctan2,
    select=np.where,
    maximum=np.maximum,
    floor=np.floor,
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
    floor=dr.floor,
)


def vector(x: Any, y: Any, z: Any) -> SimpleNamespace:
    """Return a vector of NumPy arrays or Dr.Jit floats, by component."""
    return SimpleNamespace(x=x, y=y, z=z)


def components(w: np.ndarray) -> SimpleNamespace:
    """Return an array of vectors, shape (…, 3), by component."""
    w = np.asarray(w, dtype=np.float64)
    return vector(w[..., 0], w[..., 1], w[..., 2])


def stacked(w: SimpleNamespace) -> np.ndarray:
    """Return a vector by component as an array of shape (…, 3)."""
    return np.stack(np.broadcast_arrays(w.x, w.y, w.z), axis=-1)
