"""A measured table as it is drawn: its colours and luminance, and the lobes in the plane of incidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..measured import Measurement, Samples
from ..measured.arrays import components, stacked
from ..measured.coordinates import polar_angle, spherical
from ..measured.measurement import usable
from ..measured.observer import to_srgb
from ..measured.report.counts import batches, census
from ..measured.report.summary import azimuths, ends, table
from ..parameters.messages import brief, printable
from ..probe.arrays import luminance
from ..probe.curves import Curve, refined

ANGLES = 10, 40, 70
"""The angles of incidence of lobes, in degrees, in tables without such an axis; of others, at most LOBES nodes."""
LOBES = 4
NEAR = 0.5
"""How far from the plane of incidence, and in θi from the curve, nodes are drawn, in degrees."""


class LitTable:
    """A measurement as a table with a luminance, lit from an azimuth in radians, by default the table's first."""

    def __init__(self, measurement: Measurement, phi: float | None = None) -> None:
        measurement = in_colour(measurement)
        self.measurement, self.grid = measurement, table(measurement.data)
        name, material = printable(measurement.path.name), measurement.material
        name = name if material in ("", brief(measurement.path.stem)) else f"{material} ({name})"
        self.name = name.replace("$", r"\$")  # no formula, to Matplotlib
        self.incidence = ends(measurement.data, "theta_i", census(measurement.data).theta_i)
        self.phi = float(azimuths(self.grid)[0]) if phi is None else phi
        self.coloured = self.grid.values.shape[-1] > 1
        self.quantity = r"$f$ [1/sr]" + (", luminance" if self.coloured else "")

    def colour(self, f: np.ndarray) -> np.ndarray:
        """Return values in the gamut of sRGB, or as they are if they have one channel."""
        return np.maximum(f, 0)

    def luminance(self, f: np.ndarray) -> np.ndarray:
        return luminance(self.colour(f))

    @property
    def angles(self) -> np.ndarray:
        """The angles of incidence of lobes, in degrees."""
        data, names = self.measurement.data, self.grid.coordinates.names
        if isinstance(data, Samples):
            nodes = np.unique(np.round(np.degrees(polar_angle(components(data.wi))), 1))
        elif "theta_i" in names:
            nodes = np.degrees(self.grid.axes[names.index("theta_i")].nodes)
        else:
            nodes = np.array(ANGLES)
        nodes = nodes[nodes < max(85, nodes[0] + 1)]
        return nodes[np.unique(np.linspace(0, len(nodes) - 1, LOBES).round().astype(int))]

    def curve(self, theta_i: float) -> Curve:
        """Return the luminance of f in the plane of incidence, and NaN where nothing was measured."""
        wi, near = stacked(spherical(np.radians(theta_i), self.phi)), np.geomspace(0.01, 20, 40)

        def toward(theta: np.ndarray) -> np.ndarray:
            return stacked(spherical(np.radians(-theta), self.phi))

        peaks = [end + near * side for end in (-theta_i, theta_i) for side in (-1, 1)]
        theta = np.unique(np.concatenate([np.linspace(-90, 90, 361), *peaks]))
        curve = refined(lambda t: self.luminance(self.grid.evaluate(wi, toward(t))), theta[abs(theta) < 90])
        return curve._replace(value=np.where(self.grid.measured(wi, toward(curve.theta)), curve.value, np.nan))

    def nodes(self, angles: Sequence[float] | np.ndarray) -> list[Curve]:
        """Return what the table has near the plane of incidence, for each of some angles of incidence."""
        found: list[list[np.ndarray]] = [[] for _ in angles]
        for wi, wo, f in batches(self.measurement.data):
            sin = np.hypot(wi[:, 0], wi[:, 1])
            phi = [[np.cos(self.phi)], [np.sin(self.phi)]]
            x, y = np.where(sin > 1e-6, wi[:, :2].T / np.maximum(sin, 1e-6), phi)
            along, across = wo[:, 0] * x + wo[:, 1] * y, wo[:, 1] * x - wo[:, 0] * y
            theta_i, theta_o = np.degrees(np.arctan2(sin, wi[:, 2])), np.degrees(np.arctan2(-along, wo[:, 2]))
            # Far from the mirror direction, values change more slowly.
            near = abs(across) < np.radians(NEAR + 0.05 * abs(theta_o - theta_i))
            near &= (wi[:, 2] > 0) & (wo[:, 2] > 0)
            if self.grid.anisotropic:
                near &= x * np.cos(self.phi) + y * np.sin(self.phi) > np.cos(np.radians(NEAR))
            for k, wanted in enumerate(angles):
                mine = near & (abs(theta_i - wanted) < NEAR)
                # By as much as the mirror direction: a highlight stays in place.
                shifted = theta_o[mine] + wanted - theta_i[mine]
                found[k].append(np.stack([shifted, self.luminance(usable(f[mine]))]))
        return [Curve(*np.concatenate(parts, axis=1)) for parts in found]


def in_colour(measurement: Measurement) -> Measurement:
    """Return a measurement with linear sRGB in place of several wavelengths: less to look up in."""
    f, nm = measurement.data.values, measurement.wavelengths
    if nm is None or len(nm) == 1:
        return measurement
    values = np.where(np.isfinite(f).all(axis=-1, keepdims=True), usable(f) @ to_srgb(nm), np.nan)
    return replace(measurement, data=replace(measurement.data, values=values), wavelengths=None)
