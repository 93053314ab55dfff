"""Colours as Mitsuba 0.6 read them, in its usual build: as linear sRGB."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import numpy as np

from ..srgb import decoded
from .document import Element, floats


def rgb_of(element: Element, folder: Path) -> list[float]:
    """Return the channels of an ``<rgb>``, ``<srgb>``, ``<spectrum>`` or ``<blackbody>``, one if all are the same.

    Raises:
        ValueError: in a sentence, for what 0.6 does not read either.
    """
    text = element.value.strip(", \t\n")
    try:
        if element.tag == "blackbody":
            kelvin = float(element.attributes.get("temperature", "").strip().rstrip("Kk"))
            rgb = _of_light(*_blackbody(kelvin, float(element.attributes.get("scale", 1))))
        elif "filename" in element.attributes:
            if not (path := folder / element.attributes["filename"]).is_file():  # a pipe would never end
                raise ValueError(f"there is no file {path}")
            rgb = _of_light(*np.loadtxt(path, usecols=(0, 1), ndmin=2, encoding="utf-8").T)
        elif ":" in text:
            pairs = [pair.split(":") for pair in re.split(r"[,\s]+(?=\S)", re.sub(r"\s*:\s*", ":", text))]
            rgb = _of_light(*np.array(pairs, float).T)
        elif re.fullmatch(r"#[0-9a-fA-F]{6}", text):
            rgb = [byte / 255 for byte in bytes.fromhex(text[1:])]
        else:
            rgb = floats(text)
    except (ValueError, OSError, RuntimeError) as error:
        raise element.error(f"it has no colour that can be read: {error}") from None
    if len(rgb) not in (1, 3) or not np.isfinite(rgb).all():
        raise element.error(f"{element.value!r} has not one or three numbers")
    return decoded(rgb).tolist() if element.tag == "srgb" else rgb


def _of_light(wavelengths: np.ndarray, values: np.ndarray) -> list[float]:
    """Return the linear sRGB of a spectrum without an illuminant, linear between its wavelengths in nm and 0 beyond, of
    which Y is the mean under the observer's."""
    if not (np.diff(wavelengths) > 0).all():
        raise ValueError("wavelengths must increase")
    scalar = importlib.import_module("mitsuba.scalar_rgb")  # whose functions compute without kernels
    return [float(v) for v in scalar.spectrum_list_to_srgb(wavelengths, values, bounded=False, d65=False)]


def _blackbody(kelvin: float, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return wavelengths in nm and Planck's radiance in W/(m² sr nm)."""
    h, c, k = 6.62607015e-34, 299792458.0, 1.380649e-23
    if not kelvin > 0:
        raise ValueError("its temperature must be above 0 K")
    wavelengths = np.arange(360.0, 831.0)
    metres = wavelengths * 1e-9
    with np.errstate(over="ignore"):  # of the cold ones, whose light is 0
        return wavelengths, scale * 1e-9 * 2 * h * c**2 / (metres**5 * np.expm1(h * c / (metres * k * kelvin)))
