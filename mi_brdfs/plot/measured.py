"""Figures of measured files, and the tables that they draw: Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from ..measured import Measurement, Samples, read
from ..measured.arrays import components, stacked
from ..measured.coordinates import HalfDifference, polar_angle, spherical
from ..measured.grid import usable
from ..measured.report.albedo import albedos
from ..measured.report.counts import batches, census, in_one_plane
from ..measured.report.summary import azimuths
from ..measured.scattered import as_grid
from ..observer import to_srgb
from ..probe.arrays import luminance
from ..probe.curves import Curve, largest, refined
from .maps import HATCHED, frame_albedo
from .planar import MIRROR, LabelledCurve, draw_cartesian
from .style import CHANNELS, FAINT, INK, SMALL, TEXT, UNBROKEN, Place, add_bar, calm, incidence, look, new_figure, plain

ANGLES = 10, 40, 70
"""The angles of incidence of lobes, in degrees, in tables without such an axis; of others, at most LOBES nodes."""
LOBES = 4
NEAR = 0.5
"""How far from the plane of incidence, and in θi from the curve, nodes are drawn, in degrees."""
PIXELS = 256
DECADES = 5
"""The most decades of brightness that a slice shows."""
NODES = 40
"""About how many nodes are marked on a curve, so that marks stay apart."""
NODE = {"linestyle": "", "marker": "o", "markersize": 3, "fillstyle": "none", "markeredgewidth": 0.8}
STATED = {"linestyle": "", "marker": "o", "markersize": 4, "color": INK}


def measured(*files: str | Path | Measurement) -> Figure:
    """Draw what measured files hold, a row of three panels for each.

    * The slice φd = 90° of half and difference angles: highlights are on the left, grazing incidence at the top, and
      retro-reflection at the bottom. Hues are those of the material, brightness is the logarithm of the luminance.
      Nothing was measured where the ground is hatched.
    * f in the plane of incidence, over the signed angle θo, negative on the side of wi: curves as the table
      interpolates, and points where it has nodes.
    * The directional albedo over θi, of what was measured, and points where the file states it.

    Anisotropic materials are lit from the first azimuth of their table.

    Args:
        files: paths, or what :func:`mi_brdfs.measured.read` returned.

    Raises:
        FileError: if one cannot be read.
        ValueError: if there are none.
    """
    if not files:
        raise ValueError("there is no measured file to draw")
    found = [file if isinstance(file, Measurement) else read(file) for file in files]
    figure = new_figure(9, 3.6 * len(found))
    for measurement, row in zip(found, figure.subfigures(len(found), squeeze=False)[:, 0], strict=True):
        it = LitTable(measurement)
        for ax, draw in zip(row.subplots(1, 3), (_draw_slice, _draw_lobes, _draw_albedo), strict=True):
            draw(ax, it)
            ax.set_box_aspect(1)
        row.suptitle(it.name, fontsize=TEXT + 1, color=INK)
    return figure


def _draw_slice(ax: Axes, it: LitTable) -> None:
    middles = (np.arange(PIXELS) + 0.5) / PIXELS
    theta_h, theta_d = np.meshgrid(middles, middles)
    pair = HalfDifference().directions(np.sqrt(theta_h), theta_d * np.pi / 2, np.full_like(theta_h, np.pi / 2))
    wi, wo = map(stacked, pair)
    f, seen = it.grid.evaluate(wi, wo), it.measurement.data.measured(wi, wo)
    colour = np.maximum(f, 0)
    lit = luminance(colour)
    norm = _norm(lit[seen])
    brightness = norm(np.maximum(lit, norm.vmin)).filled(0)
    if colour.shape[-1] == 3:
        # Of a grey, the display's value is the brightness, as in the bar.
        hue = colour / np.maximum(colour.max(axis=-1, keepdims=True), 1e-30)
        shown, palette = brightness[..., None] * hue ** (1 / 2.2), "gray"
    else:
        shown, palette = colormaps["viridis"](brightness)[..., :3], "viridis"
    patch = Rectangle((0, 0), 90, 90, **HATCHED, zorder=-1)
    ax.add_patch(patch)
    ax.imshow(np.dstack([shown, seen]), extent=(0, 90, 0, 90), origin="lower")
    made_up = ", interpolated" if in_one_plane(it.measurement.data) else ""
    add_bar(ScalarMappable(norm, palette), ax, it.quantity + made_up, location="top", extend="both")
    calm(ax)
    ax.grid(False)
    turns = range(0, 91, 30)
    for axis, name in ((ax.xaxis, r"$\theta_h$ at $\varphi_d$ = 90°"), (ax.yaxis, r"$\theta_d$")):
        axis.set_ticks(turns, [f"{turn}°" for turn in turns])
        axis.set_label_text(name, fontsize=TEXT, color=INK)
    if not seen.all():
        _legend(ax, [patch], ["not measured"])


def _norm(values: np.ndarray) -> LogNorm:
    """Return the scale of a slice: from black, well below what is dim, up to its peak or as many decades as can be told
    apart."""
    lit = values[values > 0]
    if not len(lit):
        return LogNorm(0.1, 1, clip=True)
    low = max(np.quantile(lit, 0.1), np.median(lit) / 30) / 10
    return LogNorm(low, np.clip(lit.max(), 10 * low, 10**DECADES * low), clip=True)


def _draw_lobes(ax: Axes, it: LitTable) -> None:
    names = [incidence(float(f"{theta:.3g}")) for theta in it.angles]
    curves = [
        LabelledCurve(name, theta, it.curve(theta), look(Place(k)) | UNBROKEN)
        for k, (name, theta) in enumerate(zip(names, it.angles, strict=True))
    ]
    calm(ax)
    draw_cartesian(ax, curves, True, False, it.quantity, curves)
    ax.tick_params(axis="x", labelsize=SMALL - 1.5)  # larger ones would touch in so narrow a panel
    for line, nodes in zip(curves, it.nodes(it.angles), strict=True):
        ax.plot(*nodes, color=line.look["color"], **NODE, markevery=max(1, len(nodes.theta) // NODES))
        ax.set_ylim(top=max(ax.get_ylim()[1], 1.3 * largest([nodes.value])))
    marks = [Line2D([], [], linestyle="", color=FAINT, **MIRROR), Line2D([], [], color=FAINT, **NODE)]
    _legend(ax, [*ax.get_lines()[1 : 2 * len(curves) : 2], *marks], [*(c.label for c in curves), "mirror", "nodes"])


def _draw_albedo(ax: Axes, it: LitTable) -> None:
    low, high = it.incidence
    angles = np.unique(np.append(np.arange(0, 90, 3), [low, min(high, 89)]))
    angles = angles[(angles >= low) & (angles <= high)]
    values = albedos(as_grid(it.measurement.data, "zero"), np.radians(angles), it.phi, extrapolate="zero")
    colour = np.maximum(values, 0)
    names = list(CHANNELS) if colour.shape[-1] == 3 else [""]
    handles = []
    for channel, name in enumerate(names):
        handles += ax.plot(angles, colour[:, channel], label=name or "integrated", **look(Place(channel), name))
    stated = {theta: albedo[0] for theta, albedo in it.measurement.stated_albedos.items()}
    if stated:
        handles += ax.plot(np.degrees(list(stated)), list(stated.values()), label="stated", **STATED)
    frame_albedo(ax, "directional albedo")
    _legend(ax, handles, [handle.get_label() for handle in handles])


def _legend(ax: Axes, handles: list, labels: list[str]) -> None:
    """Add a legend below a panel."""
    columns = 2 if len(labels) in (2, 4) else 3
    ax.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=columns, frameon=False,
              fontsize=SMALL, labelcolor=INK)  # fmt: skip


# --- Tables -----------------------------------------------------------------------------------------------------------


class LitTable:
    """A measurement as a table with a luminance, lit from an azimuth in radians, by default the table's first."""

    def __init__(self, measurement: Measurement, phi: float | None = None) -> None:
        measurement = in_colour(measurement)
        self.measurement, self.grid = measurement, as_grid(measurement.data)
        self.name = plain(measurement.title)
        self.incidence = census(measurement.data).theta_i
        self.phi = float(azimuths(self.grid)[0]) if phi is None else phi
        self.coloured = self.grid.values.shape[-1] > 1
        self.quantity = r"$f$ [1/sr]" + (", luminance" if self.coloured else "")

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
        curve = refined(lambda t: luminance(np.maximum(self.grid.evaluate(wi, toward(t)), 0)), theta[abs(theta) < 90])
        seen = self.measurement.data.seen(wi, toward(curve.theta))
        return curve._replace(value=np.where(seen, curve.value, np.nan))

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
                found[k].append(np.stack([shifted, luminance(usable(f[mine]))]))
        return [Curve(*np.concatenate(parts, axis=1)) for parts in found]


def in_colour(measurement: Measurement) -> Measurement:
    """Return a measurement with linear sRGB in place of several wavelengths: less to look up in."""
    f, nm = measurement.data.values, measurement.wavelengths
    if nm is None or len(nm) == 1:
        return measurement
    values = np.where(np.isfinite(f).all(axis=-1, keepdims=True), usable(f) @ to_srgb(nm), np.nan)
    return replace(measurement, data=replace(measurement.data, values=values), wavelengths=None)
