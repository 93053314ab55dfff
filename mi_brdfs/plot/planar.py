"""Figures of the plane of incidence: Matplotlib."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from textwrap import fill
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..given import angles_of_incidence
from ..probe import curves as lobes
from ..probe.curves import Curve, decades, largest
from . import style
from .given import Legend, Named, by_channel, check_azimuth, named, places, quantity, with_smooth_part
from .style import FAINT, GRID, INK, LETTERS, QUANTITY, SMALL, TEXT, UNBROKEN, WIDTH, Place, incidence, look

SCALES = {"linear": ("linear",), "log": ("log",), "both": ("linear", "log")}
MIRROR = {"marker": "v", "markersize": 5}
THIN = {"linewidth": 0.8}
COLUMNS, NARROWEST = 4, 2.8
"""The most panels side by side, and the least width of one, in inches."""


def polar(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
    normalize: bool = False,
    rgb: bool = False,
    side_by_side: bool = False,
    title: str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Draw the lobes in the plane of incidence, as the radius over the angle to the normal, which points up.

    The radius is the luminance of f cosθ_o, in 1/sr. wi is an arrow, on the left; triangles at the rim are the mirror
    directions. One BSDF gets one panel, with a colour for each angle; several get a row for each angle, and a colour
    each. Transmission, if any, is below the surface. Delta functions and negative values are left out.

    Args:
        bsdfs: plugin names, plugin dicts, loaded BSDFs of the active variant, XML texts, or paths of XML files, each of
            whose materials counts once.
        angles: of incidence, in degrees, in [0, 90).
        azimuth: of incidence, in degrees from dp_du.
        scale: of the radius, "linear", "log" or "both" side by side.
        labels: the names in the legend. By default the type of a dict with the parameters that distinguish it, and the
            id or class of a loaded BSDF; what the others have in common is above the legend.
        normalize: divide each curve by its maximum, to compare shapes.
        rgb: draw red, green and blue in place of the luminance, in a row for each angle; one black curve of what is
            grey, and the luminance where all is.
        side_by_side: draw each BSDF in a panel of its own, on the same scale, with a colour for each angle.
        title: above the figure; by default the name of the only BSDF, or the only angle.
        size: width and height in inches; by default what the panels need.

    Returns:
        A figure that notebooks show and pyplot does not manage: ``figure.savefig(path)`` writes it.

    Raises:
        ValueError: if something is not a BSDF or has delta functions only, if angles or scale are wrong, or if the
            variant is scalar or polarized, or has no channels that ``rgb`` could draw.
        Exception: whatever Mitsuba raises if XML cannot be loaded.
    """
    options = azimuth, scale, labels, normalize, rgb, side_by_side, title, size
    return _planar(_draw_polar, (0.58, 1.05), bsdfs, angles, *options)


def cartesian(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
    normalize: bool = False,
    rgb: bool = False,
    side_by_side: bool = False,
    title: str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Draw the luminance of f cosθ_o in the plane of incidence over the signed angle θ_o, negative on the side of wi;
    transmission lies beyond ±90°. Triangles at the top are the mirror directions. Everything else is as in
    :func:`polar`."""
    options = azimuth, scale, labels, normalize, rgb, side_by_side, title, size
    return _planar(draw_cartesian, (0.62, 0.62), bsdfs, angles, *options)


class LabelledCurve(NamedTuple):
    """A curve of a panel."""

    label: str
    theta_i: float
    curve: Curve
    look: dict[str, Any]


def _planar(
    draw: Callable,
    heights: tuple[float, float],
    bsdfs: Sequence[Any],
    angles: Sequence[float],
    azimuth: float,
    scale: str,
    labels: Sequence[str] | None,
    normalize: bool,
    rgb: bool,
    side_by_side: bool,
    title: str | None,
    size: tuple[float, float] | None,
) -> Figure:
    """Draw a row of panels for the BSDF or for each angle, and a column for each scale; side by side, a column for each
    BSDF and a row for each scale. ``heights`` are those of a panel of width 1, without and with transmission."""
    angles = angles_of_incidence(angles)
    check_azimuth(azimuth)
    if scale not in SCALES:
        raise ValueError(f"there is no scale {scale!r}; there are {', '.join(SCALES)}")
    scales = SCALES[scale]
    found = with_smooth_part(named(bsdfs, labels))
    whole = any(lobes.transmits(it.probe) for it in found)
    beside = side_by_side and len(found) > 1
    measured = [k for k, it in enumerate(found) if it.probe.data]
    plane = lobes.in_plane_of_incidence
    channels, rgb, equal = by_channel(
        [[partial(plane, it.probe, theta, azimuth) for theta in angles] for it in found], rgb
    )
    by_bsdf = beside or not (rgb or len(found) > 1)
    where = places(() if by_bsdf or rgb else bsdfs, len(found))

    def lines(it: Named, k: int) -> list[list[LabelledCurve]]:
        rows: list[list[LabelledCurve]] = [[] for _ in angles]
        for name, curves in channels[k]:
            for j, (theta, curve) in enumerate(zip(angles, curves, strict=True)):
                if normalize:
                    curve = curve._replace(value=curve.value / largest([curve.value]))
                own_look = look(Place(j) if by_bsdf else where[k], name)
                if k in measured or (beside and measured):
                    own_look |= UNBROKEN
                own = incidence(theta) if by_bsdf else it.label
                rows[j].append(
                    LabelledCurve(f"{own}, {name}" if name in style.CHANNELS else own, theta, curve, own_look)
                )
        return rows

    each = [lines(it, k) for k, it in enumerate(found)]
    peaks = [largest(curve.curve.value for part in rows for curve in part) for rows in each]
    notes = [*Legend(bsdfs).constants(), *equal]
    if any((line.curve.value < 0).any() for rows in each for part in rows for line in part):
        notes.append("Negative values are left out.")
    if "linear" in scales and (ratio := max(peaks) / min(peaks)) > 50:  # the lowest curve cannot be seen
        notes.append(f"The maxima differ by a factor of {ratio:.0f}.")
        warnings.warn(f"the maxima differ by a factor of {ratio:.0f}; --normalize compares shapes", stacklevel=3)
    rows = each if by_bsdf else zip(*each, strict=True)
    headings = [it.label for it in found] if by_bsdf else [incidence(theta) for theta in angles]
    panels = [[curve for part in row for curve in part] for row in rows]
    columns = -(-len(panels) // -(-len(panels) // COLUMNS)) if beside else len(scales)
    width = max(WIDTH, NARROWEST * columns) if beside else WIDTH if len(scales) > 1 else 0.6 * WIDTH
    blocks = -(-len(panels) // columns) * len(scales) if beside else len(panels)
    height = width / columns * heights[whole] + (0.4 if beside else 0)
    figure = style.new_figure(width, height * blocks + 0.8, size)
    axes = figure.subplots(blocks, columns, squeeze=False)
    text = quantity(QUANTITY, normalize=normalize, rgb=rgb)
    everything = [curve for curves in panels for curve in curves]
    for k, (heading, curves) in enumerate(zip(headings, panels, strict=True)):
        for s, name in enumerate(scales):
            ax = axes[k // columns * len(scales) + s, k % columns] if beside else axes[k, s]
            style.calm(ax)
            draw(ax, curves, name == "log", whole, text, everything if beside or name == "log" else curves)
            if len(panels) > 1 and not s:
                loc, pad = ("center", 10) if beside else ("left", 4)
                pad -= 13 if draw is _draw_polar else 0  # beside the lobes there is room
                ax.set_title(fill(heading, int(LETTERS * width / columns)), fontsize=TEXT, color=INK, loc=loc, pad=pad)
            if k % columns if beside else s:
                ax.set_ylabel("")
                ax.tick_params(labelleft=not beside)
            if draw is _draw_polar and k % columns if beside else k < len(panels) - 1:
                ax.set_xlabel("")
    for ax in axes.flat:
        if not ax.lines:
            ax.remove()
    if title or len(panels) == 1:
        style.set_title(figure, style.plain(title) if title else headings[0])
    marks = {"mirror direction": Line2D([], [], linestyle="", **MIRROR, color=FAINT)}
    if draw is _draw_polar:
        marks = {r"$\omega_i$": Line2D([], [], marker=">", markersize=4, **THIN, color=FAINT), **marks}
    shown = {curve.label: curve for curve in everything}.values() if beside else curves
    handles = [Line2D([], [], **curve.look) for curve in shown]
    names = [*(curve.label for curve in shown), *marks]
    style.add_legend(figure, [*handles, *marks.values()], names, notes, where)
    return figure


def _draw_polar(
    ax: Axes, lines: list[LabelledCurve], log: bool, whole: bool, text: str, alike: list[LabelledCurve]
) -> None:
    low, high = _range(alike) if log else (0, largest(line.curve.value for line in alike))
    spec = ax.get_subplotspec()
    most = 12 // max(2, spec.get_gridspec().ncols)
    if log:
        end = 1.06 * (high - low)
        rings = {power - low: f"$10^{{{power}}}$" for power in range(low, int(np.floor(high)) + 1)}
    else:
        rings = {ring: f"{ring:g}" for ring in MaxNLocator(4).tick_values(0, 1.06 * high)}
        end = max(rings)  # a round number at the rim, since panels differ in their scale
    turns = np.arange(-150, 181, 30) if whole else np.arange(-90, 91, 30)
    round_ = np.linspace(-180, 180, 361) if whole else np.linspace(-90, 90, 181)
    for k, (ring, number) in enumerate(rings.items()):
        ax.plot(*_at(round_, ring), color=GRID, linewidth=0.6)
        is_shown = k % (1 + len(rings) // most) == 0 and not 0.95 * end < ring < end and (ring > 0 or not whole)
        if is_shown and (spec.is_last_row() or not log):
            ax.text(ring, -0.035 * end, number, color=INK, fontsize=SMALL - 1, ha="center", va="top")
    ax.plot(*_at(round_, end), color=FAINT, linewidth=0.6)
    for turn in turns:
        ax.plot(*_at(turn, np.array([0, end])), color=GRID, linewidth=0.6)
        ax.text(*_at(turn, 1.16 * end), f"{abs(turn)}°", color=INK, fontsize=SMALL, ha="center", va="center")
    for line in lines:
        colour = _shade(line, lines)
        arrow = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "color": colour, **THIN}
        ax.annotate("", _at(-line.theta_i, end), (0, 0), arrowprops=arrow)
        # Outside the rim, where no lobe is, and pointing inwards.
        inwards = MIRROR | {"marker": (3, 0, 180 - line.theta_i)}
        ax.plot(*_at(line.theta_i, 1.035 * end), color=colour, **inwards)
    for line in lines:
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = np.maximum(np.log10(line.curve.value) - low if log else line.curve.value, 0)
        ax.plot(*_at(line.curve.theta, radius), label=line.label, **line.look)
    ax.plot([-end, end], [0, 0], color=INK, linewidth=1.5)
    top = 1.25 * end
    ax.set(xlim=(-top, top), ylim=(-top if whole else -0.15 * end, top), xticks=[], yticks=[])
    ax.set_aspect("equal", anchor="S")  # in the middle, labels below would overlap the legend
    ax.spines[:].set_visible(False)
    radius = f"log radius, cut off below $10^{{{low}}}$" if log else "linear radius"
    ax.set_xlabel(f"{text},\n{radius}", fontsize=TEXT, color=INK)


def _at(theta: Any, radius: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the point at an angle to the vertical, in degrees, and a distance."""
    return radius * np.sin(np.radians(theta)), radius * np.cos(np.radians(theta))


def draw_cartesian(
    ax: Axes, lines: list[LabelledCurve], log: bool, whole: bool, text: str, alike: list[LabelledCurve]
) -> None:
    """Draw curves over the signed angle, with ``text`` for what they show, on a scale for all that are ``alike``."""
    end = 180 if whole else 90
    if log:
        low, high = _range(alike)
        ax.set_yscale("log")
        ax.set_ylim(10.0**low, 10 ** (high + 0.05 * (high - low)))
    else:
        ax.set_ylim(0, 1.05 * largest(line.curve.value for line in alike))
    for line in lines:
        above = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        ax.plot(line.theta_i, 1.025, color=_shade(line, lines), **MIRROR, **above)
        ax.plot(*line.curve, label=line.label, **line.look)
    ax.set_xlim(-end, end)
    turns = range(-end, end + 1, end // 3)
    # Labels of the ends would touch those of the other axis and of the next panel.
    ax.set_xticks(turns, ["" if abs(turn) == end else f"{turn}°".replace("-", "−") for turn in turns])
    ax.set_xlabel(r"$\theta_o$", fontsize=TEXT, color=INK)
    ax.set_ylabel(text, fontsize=TEXT, color=INK)


def _shade(line: LabelledCurve, lines: list[LabelledCurve]) -> str:
    """Return the colour of the marks of an angle of incidence: the curve's, unless the angle has curves of several or
    what is grey has black ones for all angles."""
    colours = {other.look["color"] for other in lines if other.theta_i == line.theta_i}
    return FAINT if len(colours) > 1 or INK in colours else line.look["color"]


def _range(lines: list[LabelledCurve]) -> tuple[int, float]:
    even = np.linspace(-lobes.GRAZING, lobes.GRAZING, 181)
    return decades([np.interp(even, *line.curve) for line in lines], largest(line.curve.value for line in lines))
