"""The curve of sRGB, between linear values and those that files and displays have."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def encoded(linear: ArrayLike) -> np.ndarray:
    """Return the values of a display for linear ones; both are from 0 to 1, and what is beyond is clipped."""
    x = np.clip(np.nan_to_num(linear), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def encoded_8bit(linear: ArrayLike) -> np.ndarray:
    """Return the values of a display from 0 to 255."""
    return np.round(255 * encoded(linear)).astype(np.uint8)


def decoded(values: ArrayLike) -> np.ndarray:
    """Return the linear values that a display shows."""
    x = np.asarray(values)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
