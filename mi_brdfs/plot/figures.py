"""Matplotlib figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from io import BytesIO
from textwrap import fill
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from . import lobes
from .given import Named, check_angles, named, quantity, scales_of, with_smooth_part
from .lobes import Curve, decades, largest

try:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator
except ImportError:
    raise ImportError("plots need Matplotlib: pip install 'mi_brdfs[plot]'") from None

# Okabe and Ito's colours, which the colour-blind can tell apart, without the yellow, too pale for lines.
COLOURS = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"
# Styles too, so that coinciding curves are both visible; their number is coprime to that of the colours.
STYLES = "-", (0, (4, 2)), (0, (1.5, 1)), (0, (6, 1.5, 1.5, 1.5))
INK, FAINT, GRID = "#222222", "#808080", "#dddddd"
TEXT, SMALL = 9, 8
LETTERS = 12
"""The approximate number of letters per inch."""
WIDTH = 8
DOTTED = 0, (1, 2)
QUANTITY = r"$f\,\cos\theta_o$"
# Hollow, so that a narrow lobe is visible inside.
RING = {"marker": "o", "fillstyle": "none", "markersize": 7, "markeredgewidth": 1.2}
DIAMOND = RING | {"marker": "D"}


def polar(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
) -> Figure:
    """Draw the lobes in the plane of incidence, as the radius over the angle to the normal, which points up.

    The radius is the luminance of f cosθ_o. wi is an arrow, on the left; dotted lines are the mirror directions. One
    BSDF gets one panel, with a colour for each angle; several get a row for each angle, and a colour each.
    Transmission, if any, is below the surface. Delta functions are left out.

    Args:
        bsdfs: plugin names, plugin dicts, loaded BSDFs of the active variant, XML texts, or paths of XML files, each of
            whose materials counts once.
        angles: of incidence, in degrees, in [0, 90).
        azimuth: of incidence, in degrees from dp_du.
        scale: of the radius, "linear", "log" or "both" side by side.
        labels: the names in the legend. By default the type of a dict with the parameters that distinguish it, and the
            id or class of a loaded BSDF.

    Returns:
        A figure that notebooks show and pyplot does not manage: ``figure.savefig(path)`` writes it.

    Raises:
        ValueError: if something is not a BSDF or has delta functions only, if angles or scale are wrong, or if the
            variant is scalar or polarized.
        Exception: whatever Mitsuba raises if a BSDF cannot be loaded.
    """
    return _planar(_draw_polar, (0.6, 1.05), bsdfs, angles, azimuth, scale, labels)


def cartesian(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
) -> Figure:
    """Draw the luminance of f cosθ_o in the plane of incidence over the signed angle θ_o, negative on the side of wi;
    transmission lies beyond ±90°. Dotted lines are the mirror directions. Everything else is as in :func:`polar`."""
    return _planar(_draw_cartesian, (0.62, 0.62), bsdfs, angles, azimuth, scale, labels)


def hemisphere(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    labels: Sequence[str] | None = None,
    resolution: int = 320,
) -> Figure:
    """Draw the luminance of f cosθ_o for all wo, in false colours on a logarithmic scale of at most five decades.

    The distance from the middle of a disc is the angle θ_o. wi, a ring, is on the left at any azimuth; the mirror
    direction, a diamond, on the right. There is a column for each angle of incidence and a row for each BSDF, and
    another for its transmission. Each pixel is the mean over its area, so that narrower lobes keep their total
    brightness. ``resolution`` is the number of pixels across a disc; everything else is as in :func:`polar`.
    """
    check_angles(angles)
    found = with_smooth_part(named(bsdfs, labels))
    rows = [(it, side) for it in found for side in ((1, -1) if lobes.transmits(it.probe) else (1,))]
    pictures = [[lobes.disc(it.probe, theta, azimuth, side, resolution) for theta in angles] for it, side in rows]
    top = largest(picture for row in pictures for picture in row)
    middles = [line for row in pictures for picture in row for line in (picture[resolution // 2],
                                                                        picture[:, resolution // 2])]  # fmt: skip
    norm = LogNorm(np.clip(lobes.dim(middles), 1e-5 * top, 1e-2 * top), top)
    size = min((WIDTH - 0.8) / len(angles), 3)
    figure = _figure(size * len(angles) + 0.8, (size + 0.1) * len(rows) + 0.6)
    axes = figure.subplots(len(rows), len(angles), squeeze=False)
    for (it, side), line, row in zip(rows, axes, pictures, strict=True):
        for ax, theta, picture in zip(line, angles, row, strict=True):
            _draw_disc(ax, np.maximum(picture, norm.vmin), norm, theta, side > 0)
        if len(rows) > 1:
            label = it.label if side > 0 else f"{it.label}, below"
            line[0].set_ylabel(fill(label, int(LETTERS * size)), fontsize=TEXT, color=INK)
    for ax, theta in zip(axes[0], angles, strict=True):
        ax.set_title(_incidence(theta), fontsize=TEXT, color=INK)
    if len(rows) == 1:
        _title(figure, found[0].label)
    bar = figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, shrink=0.8, aspect=25, pad=0.02)
    bar.set_label(quantity(QUANTITY), fontsize=TEXT, color=INK)
    bar.ax.tick_params(labelsize=SMALL, labelcolor=INK)
    bar.outline.set_visible(False)
    marks = [Line2D([], [], linestyle="", color=INK, **mark) for mark in (RING, DIAMOND)]
    _legend(figure, marks, [r"$\omega_i$", "mirror direction"])
    return figure


def albedo(
    *bsdfs: str | dict | mi.BSDF,
    azimuth: float = 0,
    labels: Sequence[str] | None = None,
) -> Figure:
    """Draw the directional albedo over the angle of incidence: the luminance of all reflected and transmitted light,
    delta functions included. It is the mean weight of 8192 samples of the BSDF's own sampler, with the same variates at
    each angle. Everything else is as in :func:`polar`."""
    found = named(bsdfs, labels)
    figure = _figure(6, 3.8)
    ax = figure.subplots()
    ax.axhline(1, color=FAINT, linewidth=0.8, linestyle=DOTTED)
    handles = []
    for k, it in enumerate(found):
        handles += ax.plot(*lobes.albedo(it.probe, azimuth), label=it.label, **_look(k))
    _calm(ax)
    ax.set_xlim(0, 90)
    ax.set_xticks(range(0, 91, 15), [f"{angle}°" for angle in range(0, 91, 15)])
    ax.set_ylim(0, 1.05 * max(1, largest(handle.get_ydata() for handle in handles)))
    ax.set_xlabel(r"$\theta_i$", fontsize=TEXT)
    ax.set_ylabel(quantity("directional albedo"), fontsize=TEXT)
    _legend(figure, handles, [it.label for it in found])
    return figure


# --- The plane of incidence -----------------------------------------------------------------------------------------


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
) -> Figure:
    """Draw a row of panels for the BSDF or for each angle, and a column for each scale. ``heights`` are those of a
    panel of width 1, without and with transmission."""
    check_angles(angles)
    scales = scales_of(scale)
    found = with_smooth_part(named(bsdfs, labels))
    whole = any(lobes.transmits(it.probe) for it in found)

    def line(it: Named, theta: float, k: int) -> LabelledCurve:
        label = it.label if len(found) > 1 else _incidence(theta)
        return LabelledCurve(label, theta, lobes.in_plane_of_incidence(it.probe, theta, azimuth), _look(k))

    if len(found) > 1:
        panels = {_incidence(theta): [line(it, theta, k) for k, it in enumerate(found)] for theta in angles}
    else:
        panels = {found[0].label: [line(found[0], theta, k) for k, theta in enumerate(angles)]}
    width = WIDTH if len(scales) > 1 else 0.6 * WIDTH
    height = width / len(scales) * heights[whole]
    figure = _figure(width, height * len(panels) + 0.8)
    axes = figure.subplots(len(panels), len(scales), squeeze=False)
    for k, (title, lines) in enumerate(panels.items()):
        for ax, name in zip(axes[k], scales, strict=True):
            _calm(ax)
            draw(ax, lines, name == "log", whole)
            if len(panels) > 1:
                ax.set_title(title, fontsize=TEXT, color=INK)
            if k < len(panels) - 1:
                ax.set_xlabel("")
    if len(panels) == 1:
        _title(figure, title)
    thin = {"color": FAINT, "linewidth": 0.8}
    marks = {r"$\omega_i$": Line2D([], [], marker=">", markersize=4, **thin)} if draw is _draw_polar else {}
    marks["mirror direction"] = Line2D([], [], linestyle=DOTTED, **thin)
    handles = [Line2D([], [], **line.look) for line in lines]
    _legend(figure, [*handles, *marks.values()], [*(line.label for line in lines), *marks])
    return figure


def _draw_polar(ax: Axes, lines: list[LabelledCurve], log: bool, whole: bool) -> None:
    low, high = _range(lines) if log else (0, largest(line.curve.value for line in lines))
    end = 1.06 * (high - low)
    if log:
        powers = range(low, int(np.floor(high)) + 1)
        rings = {power - low: f"$10^{{{power}}}$" for power in powers}
    else:
        rings = {ring: f"{ring:g}" for ring in MaxNLocator(4).tick_values(0, end) if ring <= end}
    turns = np.arange(-150, 181, 30) if whole else np.arange(-90, 91, 30)
    round_ = np.linspace(-180, 180, 361) if whole else np.linspace(-90, 90, 181)
    for k, (ring, text) in enumerate(rings.items()):
        ax.plot(*_at(round_, ring), color=GRID, linewidth=0.6)
        if k % (1 + len(rings) // 6) == 0 and ring < 0.95 * end and (ring > 0 or not whole):
            ax.text(ring, -0.035 * end, text, color=INK, fontsize=SMALL - 1, ha="center", va="top")
    ax.plot(*_at(round_, end), color=FAINT, linewidth=0.6)
    for turn in turns:
        ax.plot(*_at(turn, np.array([0, end])), color=GRID, linewidth=0.6)
        ax.text(*_at(turn, 1.1 * end), f"{abs(turn)}°", color=INK, fontsize=SMALL, ha="center", va="center")
    for line in lines:
        thin = {"color": _shade(line, lines), "linewidth": 0.8}
        arrow = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, **thin}
        ax.annotate("", _at(-line.theta_i, end), (0, 0), arrowprops=arrow)
        ax.plot(*_at(line.theta_i, np.array([0, end])), linestyle=DOTTED, **thin)
    for line in lines:
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = np.maximum(np.log10(line.curve.value) - low, 0) if log else line.curve.value
        ax.plot(*_at(line.curve.theta, radius), label=line.label, **line.look)
    ax.plot([-end, end], [0, 0], color=INK, linewidth=1.5)
    ax.set(xlim=(-1.2 * end, 1.2 * end), ylim=((-1.2 if whole else -0.15) * end, 1.2 * end), xticks=[], yticks=[])
    ax.set_aspect("equal")
    ax.spines[:].set_visible(False)
    ax.set_xlabel(f"{quantity(QUANTITY)}, {'log' if log else 'linear'} radius", fontsize=TEXT, color=INK)


def _at(theta: Any, radius: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the point at an angle to the vertical, in degrees, and a distance."""
    return radius * np.sin(np.radians(theta)), radius * np.cos(np.radians(theta))


def _draw_cartesian(ax: Axes, lines: list[LabelledCurve], log: bool, whole: bool) -> None:
    end = 180 if whole else 90
    if log:
        low, high = _range(lines)
        ax.set_yscale("log")
        ax.set_ylim(10.0**low, 10 ** (high + 0.05 * (high - low)))
    else:
        ax.set_ylim(0, 1.05 * largest(line.curve.value for line in lines))
    for line in lines:
        ax.axvline(line.theta_i, color=_shade(line, lines), linewidth=0.8, linestyle=DOTTED)
        ax.plot(*line.curve, label=line.label, **line.look)
    ax.set_xlim(-end, end)
    turns = range(-end, end + 1, end // 3)
    ax.set_xticks(turns, [f"{turn}°".replace("-", "−") for turn in turns])
    ax.set_xlabel(r"$\theta_o$", fontsize=TEXT, color=INK)
    ax.set_ylabel(quantity(QUANTITY), fontsize=TEXT, color=INK)


def _shade(line: LabelledCurve, lines: list[LabelledCurve]) -> str:
    """Return the colour of the marks of an angle of incidence: the curve's, unless all curves share the angle."""
    return FAINT if all(line.theta_i == other.theta_i for other in lines) else line.look["color"]


def _range(lines: list[LabelledCurve]) -> tuple[int, float]:
    even = np.linspace(-lobes.GRAZING, lobes.GRAZING, 181)
    return decades([np.interp(even, *line.curve) for line in lines], largest(line.curve.value for line in lines))


# --- The hemisphere ---------------------------------------------------------------------------------------------------


def _draw_disc(ax: Axes, picture: np.ndarray, norm: LogNorm, theta_i: float, above: bool) -> None:
    shown = ax.imshow(picture, "viridis", norm, extent=(-1, 1, -1, 1), origin="lower")
    shown.set_clip_path(Circle((0, 0), 1, transform=ax.transData))
    outline = [withStroke(linewidth=1.8, foreground="#00000060")]
    for angle in (30, 60, 90):
        ax.add_patch(Circle((0, 0), angle / 90, fill=False, color=FAINT if angle == 90 else "#ffffff80", linewidth=0.6))
    for angle in (30, 60):
        ax.text(0, -angle / 90, f"{angle}°", fontsize=7, color="white", ha="center", va="center", path_effects=outline)
    for x, mark in ((-theta_i / 90, RING), (theta_i / 90, DIAMOND)) if above else ():
        ax.plot(x, 0, color="white", path_effects=outline, **mark)
    ax.set(xlim=(-1.03, 1.03), ylim=(-1.03, 1.03), xticks=[], yticks=[], aspect="equal")
    ax.set_frame_on(False)


# --- What figures share ---------------------------------------------------------------------------------------------


class _Figure(Figure):
    """A figure that notebooks show without pyplot."""

    def _repr_png_(self) -> bytes:
        png = BytesIO()
        self.savefig(png, format="png")
        return png.getvalue()


def _figure(width: float, height: float) -> Figure:
    return _Figure(figsize=(width, height), dpi=144, layout="constrained", facecolor="white")


def _calm(ax: Axes) -> None:
    """Make everything except the data thin, grey and small."""
    ax.set_axisbelow(True)
    ax.grid(color=GRID, linewidth=0.6)
    ax.tick_params(which="both", labelsize=SMALL, labelcolor=INK, color=FAINT, length=0)
    for spine in ax.spines.values():
        spine.set(color=FAINT, linewidth=0.6)


def _title(figure: Figure, text: str) -> None:
    figure.suptitle(fill(text, int(LETTERS * figure.get_figwidth())), fontsize=TEXT + 1, color=INK)


def _legend(figure: Figure, handles: list, labels: list[str]) -> None:
    room = LETTERS * figure.get_figwidth()
    labels = [fill(label, int(room) - 10) for label in labels]
    # A formula is about two letters wide, and a handle six.
    widths = [max(map(len, re.sub(r"\$.*?\$", "xx", label).splitlines())) + 6 for label in labels]
    columns = len(labels) if sum(widths) < room else max(1, int(room / max(widths)))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=TEXT,
                  labelcolor=INK)  # fmt: skip


def _look(k: int) -> dict[str, Any]:
    """Return the colour and style of the k-th curve."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": STYLES[k % len(STYLES)], "linewidth": 1.6}


def _incidence(theta: float) -> str:
    return rf"$\theta_i$ = {theta:g}°"
