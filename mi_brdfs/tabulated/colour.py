"""The channels of a table, as each variant's colours."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from ..measured.measurement import Axis, Grid
from ..measured.observer import to_srgb
from ..probe.arrays import luminance
from .basis import BASIS, WAVELENGTHS
from .table import Table, TableAxis, array, fetch


class Channels:
    """How a table's channels become colours of the active variant: linear sRGB where ``wavelengths`` are None, grey
    where there is one, and else a spectrum."""

    def __init__(self, wavelengths: np.ndarray | None) -> None:
        self.weights = self.spectrum = None
        if wavelengths is not None and len(wavelengths) > 1:
            if mi.is_spectral:
                self.spectrum = wavelengths
            else:
                self.weights = to_srgb(wavelengths)
        self.axis = TableAxis(Axis(WAVELENGTHS))
        self.basis = [array(spectrum) for spectrum in BASIS] if wavelengths is None and mi.is_spectral else []

    def converted(self, grid: Grid) -> Grid:
        """Return a grid with the channels that the variant's table has: rgb variants show spectra under D65,
        monochromatic ones the luminance. Only files in rgb keep colours outside sRGB, and only as rgb."""
        values, signed = grid.usable, grid.signed and mi.is_rgb
        if self.weights is not None:
            values = values @ self.weights
        if mi.is_monochromatic and values.shape[-1] == 3:
            values = luminance(values)[..., None]
        return replace(grid, values=values, signed=signed)

    def brightness(self, grid: Grid) -> Grid:
        """Return a converted grid with one channel: the luminance of rgb, and else the mean."""
        values = grid.usable
        weighed = luminance(values) if self.spectrum is None else values.mean(-1)
        return replace(grid, values=weighed[..., None], signed=False)

    def colour(self, table: Table, wi: mi.Vector3f, wo: mi.Vector3f, wavelengths: Any) -> mi.UnpolarizedSpectrum:
        """Return a table's values as a colour, at ``wavelengths`` in spectral variants."""
        found = table.evaluate(wi, wo, wavelengths)
        if not self.basis:
            return mi.UnpolarizedSpectrum(found[0] if len(found) == 1 else found)
        return mi.UnpolarizedSpectrum([self._upsampled(found, wavelength) for wavelength in wavelengths])

    def _upsampled(self, rgb: list[Any], wavelength: Any) -> Any:
        steps = self.axis.steps(wavelength, False)
        spectra = [sum(fetch(spectrum, k) * share for k, share in steps) for spectrum in self.basis]
        return sum(channel * value for channel, value in zip(rgb, spectra, strict=True))
