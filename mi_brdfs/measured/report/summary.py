"""What a measured file is, and what its values say of themselves: ``mi-brdfs measured FILE``."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..files import FileError, named
from ..grid import Axis, Grid
from ..measurement import Measurement
from ..scattered import Samples, as_grid
from .albedo import albedos, coverage
from .counts import Counts, Range, census, in_one_plane
from .reciprocity import ReciprocityError, reciprocity_error

ANGLES = np.arange(0, 86, 5)
"""The angles of incidence at which albedos are integrated, in degrees, where they were measured."""
AZIMUTHS = 8
"""The most azimuths of incidence at which those of anisotropic materials are."""
FIGURES = 256
"""The most azimuths at the angle with the largest albedo, and the most stated albedos, that are looked at: evenly
chosen among all."""
AXES = {
    "sqrt_theta_h": "θh", "theta_d": "θd", "phi_d": "φd", "phi_h": "φh",
    "theta_i": "θi", "theta_o": "θo", "delta_phi": "Δφ", "phi_i": "φi",
    "azimuth": "azimuths", "radial": "radial angles",
}  # fmt: skip
"""The axes of tables in words."""
FEW = 6
"""The most stated albedos that are told one by one."""


@dataclass(frozen=True)
class Albedo:
    """A directional albedo, the angles of incidence in degrees, and the channel in words."""

    value: float
    theta_i: float
    phi_i: float
    channel: str


@dataclass(frozen=True)
class Scatter:
    """A total integrated scatter (TIS) that the file states, the directional albedo by its values, with nothing beyond
    them, as the mean over the channels, and the angles of incidence in degrees.

    They should be the same; but not every program that writes such files takes the cosine, or the whole hemisphere."""

    stated: float
    integrated: float
    theta_i: float
    phi_i: float


@dataclass(frozen=True)
class Summary:
    """What :func:`summarize` finds; angles are in degrees."""

    file: str
    format: str
    material: str
    symmetry: str
    """"isotropic", "isotropic and symmetric to the plane of incidence" or "anisotropic"."""
    quantity: str
    """"f" or "f cos": what the file holds."""
    grid: str
    """The nodes of each axis, in words."""
    wavelengths: str
    theta_i: Range
    theta_o: Range
    """From the least to the largest angle at which anything was measured."""
    coverage: Range
    """The least and the largest share of the hemisphere of wo, by solid angle, that was measured at one wi."""
    planar: bool
    """Whether all of it was measured in planes through the normal, of which the coverage is 0."""
    above: Counts
    """Of pairs of directions above the horizon."""
    below: Counts
    """Of the others: grids have nodes there, where files hold anything."""
    most_negative: float
    """Above the horizon, as a part of the largest value."""
    reciprocal: bool
    """Whether the coordinates of the table are the same for (wi, wo) and (wo, wi)."""
    reciprocity: ReciprocityError | None
    """None if reciprocal, or if no pair was measured both ways."""
    largest_albedo: Albedo | None
    """None if no angle of incidence up to 85° was measured."""
    scatter: list[Scatter]
    notes: dict[str, str] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return it as what JSON can hold."""
        return asdict(self)

    def rows(self) -> list[tuple[str, str]]:
        """Return what each finding is called, and what it is, in words."""
        above = self.above
        lowest = f", down to {percent(self.most_negative)} of the largest" if above.negative else ""
        rows = [
            ("format", self.format),
            ("material", self.material or "not named"),
            ("symmetry", self.symmetry),
            ("quantity", {"f": "f", "f cos": "f cosθo, here divided by the cosine"}[self.quantity]),
            ("wavelengths", self.wavelengths),
            ("values", f"{above.values + self.below.values:,}, of {self.grid}"),
            ("measured", self._range()),
            ("negative", _share(above.negative, above.values) + lowest),
            ("missing", _share(above.missing, above.values) + (" above the horizon" if self.below.missing else "")),
            ("zero", _share(above.zero, above.values)),
        ]
        if self.below.values:
            kinds = {"negative": self.below.negative, "missing": self.below.missing, "zero": self.below.zero}
            told = ", ".join(f"{count:,} {kind}" for kind, count in kinds.items() if count)
            rows.append(("below horizon", f"{self.below.values:,}" + (f", of which {told}" if told else "")))
        rows.append(("reciprocity", self._reciprocity()))
        if self.largest_albedo is not None:
            it = self.largest_albedo
            rows.append(("largest albedo", f"{it.value:.3g} at {self._place(it)}" + (it.channel and f", {it.channel}")))
        return rows + [("stated TIS", line) for line in self._scatter()]

    def _range(self) -> str:
        low, high = (f"{100 * share:.0f}" for share in self.coverage)
        ends = [f"{name} {start:.4g} to {end:.4g}°" for name, (start, end) in
                (("θi", self.theta_i), ("θo", self.theta_o))]  # fmt: skip
        if self.planar:
            return f"{', '.join(ends)}; in the plane of incidence only, the rest is interpolated"
        if low == high == "100":
            return f"all directions, {ends[0]}" if self.theta_i != (0, 90) else "all directions"
        return f"{', '.join(ends)}; {low if low == high else f'{low} to {high}'} % of the hemisphere at each θi"

    def _reciprocity(self) -> str:
        if self.reciprocal:
            return "exact, by the coordinates of the table"
        if self.reciprocity is None:
            return "unknown: no pair of directions was measured both ways"
        it = self.reciprocity
        return f"off by {percent(it.median)} in the median, {percent(it.percentile95)} at the 95th percentile"

    def _place(self, it: Albedo | Scatter) -> str:
        return f"θi = {it.theta_i:g}°" + (f", φi = {it.phi_i:g}°" if self.symmetry == "anisotropic" else "")

    def _scatter(self) -> list[str]:
        if len(self.scatter) <= FEW:
            told = "{:.4g} at {}; the values' albedo is {:.4g}"
            return [told.format(it.stated, self._place(it), it.integrated) for it in self.scatter]
        off = np.array([abs(it.integrated - it.stated) / max(it.stated, 1e-6) for it in self.scatter])
        worst = self.scatter[int(off.argmax())]
        return [
            f"{len(off)} figures, which differ from the values' albedo by {percent(np.median(off))} in the median, "
            f"most at {self._place(worst)}: {worst.stated:.4g}, and the albedo is {worst.integrated:.4g}"
        ]


def summarize(measurement: Measurement) -> Summary:
    """Return what a measurement is and holds: its grid, its symmetry, what of it is negative or missing, how far it is
    from reciprocal, and how much light it reflects.

    Raises:
        FileError: if no value is a number.
    """
    data, found = measurement.data, census(measurement.data)
    if found.least > found.most:
        raise FileError(f"{measurement.path}: no value above the horizon is a number.")
    grid = as_grid(data, "zero")
    low, high = found.theta_i
    angles = np.unique([theta for theta in (*ANGLES, low, high) if low <= theta <= min(high, 85)])
    turns = thinned(azimuths(grid), AZIMUTHS)
    planar = in_one_plane(data)
    covered = np.zeros(1) if planar else np.array([coverage(grid, np.radians(angles), phi) for phi in turns])
    return Summary(
        file=named(measurement.path),
        format=measurement.format,
        material=measurement.material,
        symmetry=_symmetry(data),
        quantity=measurement.quantity,
        grid=_grid(data),
        wavelengths=_wavelengths(measurement),
        theta_i=found.theta_i,
        theta_o=found.theta_o,
        coverage=(float(covered.min(initial=1)), float(covered.max(initial=0))),
        planar=planar,
        above=found.above,
        below=found.below,
        most_negative=min(found.least, 0) / found.most if found.most > 0 else 0,
        reciprocal=isinstance(data, Grid) and data.coordinates.reciprocal,
        reciprocity=reciprocity_error(data),
        largest_albedo=_largest(measurement, grid, angles, turns),
        scatter=scatter(measurement, grid, azimuths(grid)),
        notes=dict(measurement.notes),
    )


def channel_names(measurement: Measurement) -> list[str]:
    """Return what each channel is."""
    if measurement.wavelengths is not None and np.isfinite(measurement.wavelengths).all():
        return [f"{wavelength:g} nm" for wavelength in measurement.wavelengths]
    count = measurement.data.values.shape[-1]
    return ["red", "green", "blue"] if count == 3 else [""] if count == 1 else [f"channel {k}" for k in range(count)]


def _symmetry(data: Grid | Samples) -> str:
    if data.anisotropic:
        return "anisotropic"
    mirrored = isinstance(data, Grid) and data.coordinates.mirrored
    return "isotropic and symmetric to the plane of incidence" if mirrored else "isotropic"


def _grid(data: Grid | Samples) -> str:
    channels = data.values.shape[-1]
    of = f" × {channels} channels" if channels > 1 else ""
    if isinstance(data, Samples):
        return f"{len(data.values):,} pairs of directions{of}"
    named = zip(data.axes, data.coordinates.names, strict=True)
    return (
        " × ".join(f"{len(axis.nodes)} {AXES.get(name, name.replace('_', ' '))}{_sector(axis)}" for axis, name in named)
        + of
    )


def _sector(axis: Axis) -> str:
    """Return which part of a turn was measured, if not all of it."""
    if axis.period is None or axis.whole:
        return ""
    return f" from {np.degrees(axis.low):.4g} to {np.degrees(axis.high):.4g}°"


def _wavelengths(measurement: Measurement) -> str:
    nm = measurement.wavelengths
    if nm is None:
        return "linear sRGB"
    if np.isnan(nm).any():
        return f"{len(nm)}, not stated"
    return f"{nm[0]:g} nm" if len(nm) == 1 else f"{len(nm)} from {min(nm):g} to {max(nm):g} nm"


def azimuths(grid: Grid) -> np.ndarray:
    """Return the azimuths of incidence, in radians, at which a material was measured; 0 for an isotropic one."""
    if not grid.anisotropic:
        return np.zeros(1)
    if "phi_i" in grid.coordinates.names:
        return grid.axes[grid.coordinates.names.index("phi_i")].nodes
    return np.arange(AZIMUTHS) * (2 * np.pi / AZIMUTHS)


def _largest(measurement: Measurement, grid: Grid, angles: np.ndarray, turns: np.ndarray) -> Albedo | None:
    """Return the largest albedo at some angles and azimuths, or at the same angle and any azimuth."""
    if not len(angles):
        return None

    def found(theta: np.ndarray, phis: np.ndarray) -> np.ndarray:
        return np.array([albedos(grid, np.radians(theta), phi, extrapolate="zero") for phi in phis])

    values, every = found(angles, turns), thinned(azimuths(grid), FIGURES)
    angle = values.max(axis=(0, 2)).argmax()
    values = found(angles[[angle]], every)[:, 0]
    turn, channel = np.unravel_index(values.argmax(), values.shape)
    phi = round(float(np.degrees(every[turn])), 4)
    return Albedo(float(values.max()), float(angles[angle]), phi, channel_names(measurement)[channel])


def scatter(measurement: Measurement, grid: Grid, turns: np.ndarray) -> list[Scatter]:
    """Return what a file states for the first of its azimuths of incidence, and what its values add to."""
    found = []
    given = [
        (theta, phi, one)
        for theta, stated in measurement.stated_albedos.items()
        for phi, one in zip(turns, stated, strict=False)
        if np.isfinite(one)
    ]
    for theta, phi, one in thinned(given, FIGURES):
        (integrated,) = albedos(grid, np.array([theta]), phi, extrapolate="zero")
        found.append(Scatter(one, float(integrated.mean()), *(round(float(np.degrees(it)), 6) for it in (theta, phi))))
    return found


def thinned(items: Any, most: int) -> Any:
    """Return at most so many of an array or a list, evenly chosen."""
    return items[:: max(1, -(-len(items) // most))]


def _share(count: int, of: int) -> str:
    if not count:
        return "none"
    return f"{count:,} ({percent(count / of)})"


def percent(part: float) -> str:
    """Return a part of a whole in words."""
    percent = 100 * part
    return "less than 0.001 %" if abs(percent) < 0.001 else f"{percent:.2g} %" if percent < 99.5 else f"{percent:.0f} %"
