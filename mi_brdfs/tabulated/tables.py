"""What a measured file becomes in a variant."""

from __future__ import annotations

from weakref import WeakValueDictionary

import mitsuba as mi

from ..measured.coordinates import PolarAngle
from ..measured.files import checked, content_hash
from ..measured.formats import read
from ..measured.measurement import Axis, Extrapolation, Grid, Interpolation, Measurement, Quantity
from ..measured.scattered import as_grid
from .colour import Channels
from .proposal import NODES_I, Proposal, estimated_albedos
from .table import Table


class Tables:
    """f, the albedo over θi, and the density that directions are drawn from. ``captured`` is all that kernels read."""

    _shared: WeakValueDictionary[tuple, Tables] = WeakValueDictionary()

    @classmethod
    def of(
        cls,
        filename: str,
        interpolation: Interpolation,
        extrapolate: Extrapolation,
        quantity: Quantity,
        shared: bool,
    ) -> Tables:
        """Return the tables of a file, those in memory if they are ``shared`` and the file is still the same."""
        path = checked(filename)
        if not shared:
            return cls(read(path, quantity), interpolation, extrapolate)
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
        self.f = Table(converted, self.channels.spectrum, interpolation == "nearest", extrapolate == "hold")
        self.proposal = Proposal(self.channels.brightness(converted), interpolation, extrapolate)
        albedos = estimated_albedos(converted, NODES_I, interpolation, extrapolate)
        albedo = Grid(PolarAngle(), (Axis(NODES_I),), albedos)
        self.albedo = Table(albedo, self.channels.spectrum, nearest=False, hold=True)
        self.captured = [*self.f.captured, *self.albedo.captured, *self.channels.basis, self.proposal.warp]
