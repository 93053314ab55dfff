"""The drawings of a report."""

from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..measured.measurement import Measurement
from ..measured.report.summary import azimuths
from ..pages.figures import DIFFERENCE, SERIES, brief
from ..plot.measured import LitTable
from ..plot.planar import THIN
from ..plot.style import FAINT, GRID, INK, STYLES, calm, new_figure
from ..probe.arrays import Array
from ..probe.bsdf import BSDFProbe
from ..probe.curves import GRAZING, Curve, in_plane, value
from ..probe.directions import direction
from .metrics import METRICS
from .observations import Observations
from .result import Fit

CURVES = len(SERIES)
"""How many fits are drawn over the data."""
NODES = 60
"""The most nodes that are drawn of a lobe."""
NARROW = 5
"""How near to the mirror direction all above half of the peak is where its surroundings are stretched, in degrees."""
CELLS = 8, 28
"""The least and the most cells of a residual map, along each side."""
PAIRS = 20
"""How many pairs of directions a cell has on average, unless it were too large or too small."""


def probe_of(fit: Fit) -> BSDFProbe:
    return BSDFProbe(mi.load_dict(fit.bsdf))


def lobes(measurement: Measurement, fits: Sequence[BSDFProbe], cut: float) -> list[tuple[str, Figure]]:
    """Return ``(caption, figure)`` of f in the plane of incidence, of the data and of fits, for some angles of
    incidence; of anisotropic data for two azimuths."""
    first = LitTable(measurement)
    tables = [first]
    if first.grid.anisotropic:
        every = np.asarray(azimuths(first.grid))
        across = every[np.argmin(abs(np.cos(every - first.phi)))]
        tables.append(LitTable(measurement, float(across)))
    drawn = []
    for table in tables:
        angles = [float(theta) for theta in table.angles if theta <= cut][-2 if len(tables) > 1 else -4 :]
        for theta, nodes in zip(angles, table.nodes(angles), strict=True):
            turned = f", φi = {np.degrees(table.phi):.0f}°" if len(tables) > 1 else ""
            caption = f"θi = {theta:.3g}°{turned}"
            drawn.append((caption, _lobe(table, theta, caption, nodes, fits)))
    ends = [it.axes[0].get_ylim() for _, it in drawn]
    for _, it in drawn:
        it.axes[0].set_ylim(min(low for low, _ in ends), max(high for _, high in ends))
    return drawn


def _lobe(table: LitTable, theta_i: float, caption: str, nodes: Curve, fits: Sequence[BSDFProbe]) -> Figure:
    azimuth = float(np.degrees(table.phi))
    curve = table.curve(theta_i)
    near = np.geomspace(0.02, 20, 30)
    theta = np.unique(np.concatenate([np.linspace(-GRAZING, GRAZING, 241), theta_i + near, theta_i - near, [theta_i]]))
    theta = theta[abs(theta) < 88]
    figure = new_figure(2.8, 2.2)
    ax = figure.subplots()
    calm(ax)
    ax.plot(*curve, color=FAINT, linewidth=3, alpha=0.45, solid_capstyle="round")
    step = max(1, len(nodes.theta) // NODES)
    order = np.argsort(nodes.theta)[::step]
    ax.plot(nodes.theta[order], nodes.value[order], linestyle="", marker="o", markersize=2.6, color=INK, alpha=0.7)
    wi, wo = direction(theta_i, azimuth), in_plane(theta, azimuth)
    for probe, colour, style in zip(fits, SERIES, STYLES, strict=False):
        ax.plot(theta, value(probe, wi, wo) / wo[:, 2], color=colour, linestyle=style, linewidth=1.5)
    even = np.interp(np.linspace(-GRAZING, GRAZING, 181), *curve)
    seen = nodes.value if len(nodes.value) else even[np.isfinite(even)]
    seen = seen[seen > 0]
    ax.set_yscale("log")
    if len(seen):
        ax.set_ylim(max(np.quantile(seen, 0.02) / 4, seen.max() * 1e-6), seen.max() * 3)
    ax.axvline(theta_i, color=FAINT, linestyle=(0, (1, 2)), **THIN)
    ticks, zero, label = np.arange(-90, 91, 45), 0.0, r"$\theta_o$"
    if np.all(abs(curve.theta[curve.value > 0.5 * np.nanmax(curve.value)] - theta_i) < NARROW):
        # A line at the scale of the hemisphere: its surroundings are stretched.
        ticks, zero, label = np.array([-90, -40, -10, 0, 10, 40, 90]), theta_i, r"$\theta_o - \theta_i$, stretched"
        ticks = ticks[abs(zero + ticks) <= 90]
        places = lambda x: np.sign(x - zero) * np.sqrt(abs(x - zero)), lambda y: zero + np.sign(y) * y * y
        ax.set_xscale("function", functions=places)
    ax.set_xticks(zero + ticks, [f"{turn}°".replace("-", "−") for turn in ticks])
    ax.set_xlim(-90, 90)
    ax.set_title(caption, fontsize=9, color=INK)
    ax.set_xlabel(label, fontsize=9, color=INK)
    ax.set_ylabel(table.quantity, fontsize=9, color=INK)
    return figure


class Residuals:
    """How a fit differs from the data in its metric, in cells of √θh × θd: their means, NaN where there are none."""

    def __init__(self, material: Observations, fit: Fit, probe: BSDFProbe) -> None:
        metric = METRICS[fit.metric]
        wi, wo = (w.astype(np.float64) for w in (material.wi, material.wo))
        model = probe.eval(probe.whole, material.wi, material.wo)[:, : material.channels] / wo[:, 2:] * wi[:, 2:]
        data = material.f * wi[:, 2:]
        light = material.usable * (material.solid_angle * wo[:, 2])[:, None]
        self.off = float((light * abs(model - data)).sum() / (light * abs(data)).sum())
        half = wi + wo
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        theta_h, theta_d, theta_i = (
            np.degrees(np.arccos(np.clip(cosine, -1, 1))) for cosine in (half[:, 2], (half * wi).sum(axis=1), wi[:, 2])
        )
        self.quantity = metric.text.partition(",")[0]
        self.edges = np.linspace(0, 1, 1 + int(np.clip(np.sqrt(len(wi) / PAIRS), *CELLS)))
        places = np.sqrt(theta_h / 90), theta_d / 90
        number, *_ = np.histogram2d(*places, self.edges)

        def cells(values: Array) -> Array:
            """Return the means of cells, of a value of each pair or of those channels of it that have a weight."""
            if values.ndim > 1:
                values = np.mean(values, axis=1, where=material.usable)
            with np.errstate(invalid="ignore"):
                return np.histogram2d(*places, self.edges, weights=values)[0] / number

        self.cells = cells(metric.transform(model) - metric.transform(data))
        worst = np.unravel_index(np.nanargmax(abs(self.cells)), self.cells.shape)
        self.worst = [float(cells(it)[worst]) for it in (theta_i, theta_h, model, data)]

    @property
    def told(self) -> str:
        """How far the fit is from the data, and where most, in words."""
        theta_i, theta_h, model, data = self.worst
        most = f"θi ≈ {theta_i:.0f}° and half angles near {theta_h:.0f}°"
        if (least := min(model, data)) > 0:
            times = brief(max(model, data) / least)
            most += f", where it is {times} times too {'bright' if model > data else 'dark'}"
        return f"The fit is off by {brief(100 * self.off)} % of the reflected light, most at {most}."

    @property
    def extent(self) -> float:
        """The residual that all but a few cells stay below."""
        return float(np.nanquantile(abs(self.cells), 0.97))

    def draw(self, limit: float) -> Figure:
        """Return them as a figure, with a scale from ``-limit`` to ``limit``."""
        figure = new_figure(3, 2.4)
        ax = figure.subplots()
        calm(ax)
        ax.grid(False)
        ax.add_patch(Rectangle((0, 0), 1, 1, fill=False, edgecolor=GRID, hatch="////", linewidth=0))
        ax.pcolormesh(self.edges, self.edges, np.ma.masked_invalid(self.cells.T), norm=Normalize(-limit, limit),
                      cmap=DIFFERENCE, rasterized=True)  # fmt: skip
        places = [0, 2, 10, 30, 60, 90]
        ax.set_xticks(np.sqrt(np.array(places) / 90), [f"{angle}°" for angle in places])
        ax.set_yticks(np.array([0, 30, 60, 90]) / 90, [f"{angle}°" for angle in (0, 30, 60, 90)])
        ax.set(xlim=(0, 1), ylim=(0, 1))
        ax.set_xlabel(r"$\theta_h$", fontsize=9, color=INK)
        ax.set_ylabel(r"$\theta_d$", fontsize=9, color=INK)
        return figure
