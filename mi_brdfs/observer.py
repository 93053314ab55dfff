"""Spectra as linear sRGB."""

from __future__ import annotations

import functools
import importlib

import numpy as np


def to_srgb(wavelengths: np.ndarray) -> np.ndarray:
    """Return the weights, shape (wavelengths, 3), that turn a reflectance at some wavelengths in nm, linear between
    them and constant beyond, into linear sRGB under D65."""
    fine, weights = observer()
    position = np.interp(fine, wavelengths, np.arange(len(wavelengths)))
    below = position.astype(np.int64)
    share = (position - below)[:, None]
    result = np.zeros((len(wavelengths) + 1, 3))
    np.add.at(result, below, (1 - share) * weights)
    np.add.at(result, below + 1, share * weights)
    return result[:-1]


@functools.cache
def observer() -> tuple[np.ndarray, np.ndarray]:
    """Return ``(wavelengths, weights)``: each nm, and the linear sRGB of a reflectance under D65 as seen by the CIE
    1931 observer, per wavelength, shape (wavelengths, 3). They sum to white: 1 in each channel."""
    scalar = importlib.import_module("mitsuba.scalar_rgb")  # whose functions compute without kernels
    wavelengths = np.arange(360.0, 831.0)
    xyz = np.array([np.array(scalar.cie1931_xyz(w)).ravel() * float(scalar.cie_d65(w)) for w in wavelengths])
    rgb = np.array([np.array(scalar.xyz_to_srgb(list(each))).ravel() for each in xyz])
    return wavelengths, rgb / rgb.sum(axis=0)
