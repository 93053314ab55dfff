"""What a measured file becomes in a variant: tables in kernels, and their channels as colours."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import clamp
from ..measured.arrays import DRJIT
from ..measured.coordinates import Coordinates
from ..measured.files import checked, content_hash
from ..measured.formats import read
from ..measured.grid import Axis, Extrapolation, Grid, Interpolation, corners
from ..measured.measurement import Measurement, Quantity
from ..measured.report.albedo import albedos
from ..measured.scattered import as_grid
from ..observer import to_srgb
from ..parameters import Range
from ..probe.arrays import luminance
from ..variants import is_scalar
from .proposal import Proposal

WAVELENGTHS, *BASIS = np.loadtxt(Path(__file__).with_name("basis.txt")).T
"""In nm, and three spectra for linear sRGB values, linear between these."""


class Tables:
    """f, the albedo at normal incidence, and the density of directions; ``captured`` is what of them kernels read."""

    _shared: WeakValueDictionary[tuple, Tables] = WeakValueDictionary()

    @classmethod
    def of(
        cls, filename: str, interpolation: Interpolation, extrapolate: Extrapolation, quantity: Quantity, shared: bool
    ) -> Tables:
        """Return the tables of a file, those in memory if they are ``shared`` and the file is still the same."""
        path = checked(filename)
        if not shared:
            own = cls(read(path, quantity), interpolation, extrapolate)
            own.f.limits = own.limits
            return own
        key = mi.variant(), path.resolve(), content_hash(path), interpolation, extrapolate, quantity
        found = cls._shared.get(key)
        if found is None:
            found = cls._shared[key] = cls(read(path, quantity), interpolation, extrapolate)
        return found

    def __init__(self, measurement: Measurement, interpolation: Interpolation, extrapolate: Extrapolation) -> None:
        data = measurement.data
        grid = as_grid(data, extrapolate)
        self.channels = Channels(measurement.wavelengths)
        self.anisotropic, self.reciprocal = grid.anisotropic, grid.coordinates.reciprocal
        converted = self.channels.converted(grid if interpolation == "nearest" else grid.closed)
        self.signed = converted.signed
        self.limits = (-np.inf if self.signed else 0.0), np.inf
        self.f = Table(converted, self.channels.spectrum, interpolation, extrapolate)
        self.proposal = Proposal(self.channels.brightness(converted), interpolation, extrapolate)
        (albedo,) = albedos(converted, np.zeros(1), extrapolate=extrapolate)
        self.albedo = Table(Grid(Coordinates(), (), albedo), self.channels.spectrum, "trilinear", "hold")
        self.captured = [*self.f.captured, *self.albedo.captured, *self.channels.basis, self.proposal.warp]


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
        self.axis = TableAxis(WAVELENGTHS)
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
        steps = self.axis.steps(wavelength, "trilinear", DRJIT)
        spectra = [sum(fetch(spectrum, k) * share for k, share in steps) for spectrum in self.basis]
        return sum(channel * value for channel, value in zip(rgb, spectra, strict=True))


class Table:
    """A grid whose values and nodes are arrays of the active variant.

    ``values`` is a tensor of the grid's shape. The channels are what they are in the grid; with ``wavelengths`` in nm,
    which :meth:`evaluate` then interpolates between, they are a further axis.
    """

    def __init__(
        self, grid: Grid, wavelengths: np.ndarray | None, interpolation: Interpolation, extrapolate: Extrapolation
    ) -> None:
        self.coordinates, self.interpolation, self.extrapolate = grid.coordinates.prepared(), interpolation, extrapolate
        self.axes = [TableAxis(axis.nodes, axis.period, axis.low, axis.high) for axis in grid.axes]
        self.spectrum = None if wavelengths is None else TableAxis(wavelengths)
        self.values = mi.TensorXf(np.ascontiguousarray(grid.usable, dtype=np.float32))
        self.channels = grid.values.shape[-1]
        self.limits: Range | None = None  # of values that may change

    @property
    def captured(self) -> list[Any]:
        """Everything that a kernel reads."""
        axes = [*self.axes, *([self.spectrum] if self.spectrum else [])]
        uneven = [axis.uneven for axis in axes if axis.uneven is not None]
        return [self.values, *uneven, *self.coordinates.captured]

    def evaluate(self, wi: mi.Vector3f, wo: mi.Vector3f, wavelengths: Any = None) -> list[Any]:
        """Return f for each channel or, where channels are a spectrum, for each of the ``wavelengths``."""
        places, scale = self.coordinates.locate_scaled(wi, wo, DRJIT)
        if self.extrapolate == "zero":
            for axis, place in zip(self.axes, places, strict=True):
                scale = dr.select(axis.measured(place, DRJIT), scale, 0)
        if self.spectrum is None:
            read = [[(channel, 1)] for channel in range(self.channels)]
        else:
            read = [self.spectrum.steps(wavelength, "trilinear", DRJIT) for wavelength in wavelengths]
        found = []
        nodes = corners(zip(self.axes, places, strict=True), self.interpolation, DRJIT)
        for channels in read:
            total = 0
            for (index, weight), (k, share) in itertools.product(nodes, channels):
                value = fetch(self.values.array, index * self.channels + k)
                total = total + (value if self.limits is None else clamp(value, *self.limits)) * (weight * share)
            found.append(total * scale)
        return found


class TableAxis(Axis):
    """An axis in the active variant."""

    @cached_property
    def uneven(self) -> Any:
        """The looped nodes as kernels read them, or None if they are as far apart as one another."""
        gaps = np.diff(self.looped)
        return None if np.allclose(gaps, gaps.mean() if len(gaps) else 0, rtol=1e-6, atol=0) else array(self.looped)

    def _position(self, x: Any) -> Any:
        first, end, last = float(self.looped[0]), float(self.looped[-1]), len(self.looped) - 1
        if self.uneven is None:
            return dr.clip((x - first) * (last / (end - first) if last else 1), 0, last)
        k = dr.binary_search(1, last, lambda k: fetch(self.uneven, k) <= x)
        below, above = fetch(self.uneven, k - 1), fetch(self.uneven, k)
        return mi.Float(k - 1) + dr.clip((x - below) / (above - below), 0, 1)


def array(values: np.ndarray) -> Any:
    """Return numbers as an array that kernels of the active variant read by :func:`fetch`."""
    return mi.TensorXf(np.ascontiguousarray(values, dtype=np.float32).ravel()).array


def fetch(values: Any, index: Any) -> Any:
    """Return the number at an index; scalar variants have no gather."""
    return values[index] if is_scalar() else dr.gather(mi.Float, values, index)
