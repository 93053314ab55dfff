"""Figures of all directions of one angle of incidence, and of all angles of incidence: Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from textwrap import fill

import mitsuba as mi
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke

from ..given import angles_of_incidence
from ..probe import curves as lobes
from ..probe.curves import Curve, largest
from . import style
from .given import Legend, by_channel, check_azimuth, named, places, quantity, with_smooth_part
from .style import FAINT, GRID, INK, LETTERS, QUANTITY, SMALL, TEXT, WIDTH, incidence, look

WI = {"marker": "o", "fillstyle": "none", "markersize": 6, "markeredgewidth": 1.1}
MIRROR = {"marker": "+", "markersize": 8, "markeredgewidth": 1.1}
HATCHED = {"facecolor": "white", "edgecolor": GRID, "hatch": "////", "linewidth": 0}
"""The look of what was not measured."""
DARK = 0.2
"""The albedo from which on the scale of albedos reaches 1."""


def hemisphere(
    *bsdfs: str | dict | mi.BSDF,
    angles: Sequence[float] = (10, 40, 70),
    azimuth: float = 0,
    labels: Sequence[str] | None = None,
    resolution: int = 320,
    title: str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Draw the luminance of f cosθ_o for all wo, in false colours on a logarithmic scale of at most five decades.

    The distance from the middle of a disc is the angle θ_o. wi, a circle, is on the left at any azimuth; the mirror
    direction, a cross, on the right. Hatched is what was not measured. There is a column for each angle of incidence
    and a row for each BSDF, and another for its transmission. Each pixel is the mean over its area, so that narrower
    lobes keep their total brightness. ``resolution`` is the number of pixels across a disc; everything else is as in
    :func:`polar`.
    """
    angles = angles_of_incidence(angles)
    check_azimuth(azimuth)
    if resolution not in range(2, 4097):
        raise ValueError(f"resolution {resolution}: give from 2 to 4096 pixels")
    found = with_smooth_part(named(bsdfs, labels))
    rows = [(it, half) for it in found for half in ((1, -1) if lobes.transmits(it.probe) else (1,))]
    pictures = [[lobes.disc(it.probe, theta, azimuth, half, resolution) for theta in angles] for it, half in rows]
    top = largest(picture for row in pictures for picture in row)
    middles = [line for row in pictures for picture in row for line in (picture[resolution // 2],
                                                                        picture[:, resolution // 2])]  # fmt: skip
    norm = LogNorm(np.clip(lobes.dim(middles), 1e-5 * top, 1e-2 * top), top)
    side = min((WIDTH - 0.8) / len(angles), 3)
    figure = style.new_figure(side * len(angles) + 0.8, (side + 0.1) * len(rows) + 0.6, size)
    axes = figure.subplots(len(rows), len(angles), squeeze=False)
    for (it, half), line, row in zip(rows, axes, pictures, strict=True):
        for ax, theta, picture in zip(line, angles, row, strict=True):
            _draw_disc(ax, np.maximum(picture, norm.vmin), norm, theta, half > 0)
        if len(rows) > 1:
            label = it.label if half > 0 else f"{it.label}, below"
            line[0].set_ylabel(fill(label, int(LETTERS * side)), fontsize=TEXT, color=INK)
    for ax, theta in zip(axes[0], angles, strict=True):
        ax.set_title(incidence(theta), fontsize=TEXT, color=INK)
    if title or len(rows) == 1:
        style.set_title(figure, style.plain(title) if title else found[0].label)
    style.add_bar(ScalarMappable(norm, "viridis"), axes, quantity(QUANTITY), shrink=0.8, extend="min")
    marks = {name: Line2D([], [], linestyle="", color=INK, **mark)
             for name, mark in ((r"$\omega_i$", WI), ("mirror direction", MIRROR))}  # fmt: skip
    if any(np.isnan(picture).any() for row in pictures for picture in row):
        marks["not measured"] = Patch(**HATCHED)
    style.add_legend(figure, [*marks.values()], [*marks], Legend(bsdfs).constants())
    return figure


def albedo(
    *bsdfs: str | dict | mi.BSDF,
    azimuth: float = 0,
    labels: Sequence[str] | None = None,
    rgb: bool = False,
    title: str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Draw the directional albedo over the angle of incidence: the luminance, or with ``rgb`` each channel, of all
    reflected and transmitted light, delta functions included. It is the mean weight of 8192 samples of the BSDF's own
    sampler, with the same variates at each angle. A curve that grows without bound beyond 85° leaves the axes; how far
    it goes is above them. Everything else is as in :func:`polar`."""
    check_azimuth(azimuth)
    found = named(bsdfs, labels)
    figure = style.new_figure(6, 3.8, size)
    if title:
        style.set_title(figure, style.plain(title))
    ax = figure.subplots()
    handles = []
    channels, rgb, equal = by_channel([[partial(lobes.albedo, it.probe, azimuth)] for it in found], rgb)
    where = places(() if rgb else bsdfs, len(found))
    for it, place, own in zip(found, where, channels, strict=True):
        for name, (curve,) in own:
            label = f"{it.label}, {name}" if name in style.CHANNELS else it.label
            handles += ax.plot(*curve, label=label, **look(place, name))
    frame_albedo(ax, quantity("directional albedo", unit="", rgb=rgb))
    names = [handle.get_label() for handle in handles]
    style.add_legend(figure, handles, names, [*Legend(bsdfs).constants(), *equal], where)
    return figure


def frame_albedo(ax: Axes, text: str) -> None:
    """Set the axes of albedo curves that are drawn, with a line at 1 unless they are far below."""
    curves = [Curve(*line.get_data()) for line in ax.get_lines()]
    # Where energy is gained without end, the scale is that of angles up to 85°.
    top = largest(curve.value[(curve.theta <= 85) | (curve.value < 1.3)] for curve in curves)
    ax.axhline(1, color=FAINT, linewidth=0.8, zorder=1.5)
    style.calm(ax)
    ax.set_xlim(0, 90)
    ax.set_xticks(range(0, 91, 15), [f"{angle}°" for angle in range(0, 91, 15)])
    ax.set_ylim(0, 1.05 * (top if top < DARK else max(1, top)))
    if (gained := largest(curve.value for curve in curves)) > ax.get_ylim()[1]:
        ax.set_title(f"up to {gained:.2g}", loc="right", fontsize=SMALL, color=INK)
    ax.set_xlabel(r"$\theta_i$", fontsize=TEXT)
    ax.set_ylabel(text, fontsize=TEXT)


def _draw_disc(ax: Axes, picture: np.ndarray, norm: LogNorm, theta_i: float, above: bool) -> None:
    shown = ax.imshow(picture, "viridis", norm, extent=(-1, 1, -1, 1), origin="lower")
    shown.set_clip_path(Circle((0, 0), 1, transform=ax.transData))
    ax.add_patch(Circle((0, 0), 1, **HATCHED, zorder=-1))
    ink, halo, ring = (INK, "#ffffffc0", FAINT) if np.isnan(picture).any() else ("white", "#000000a0", "#ffffff80")
    outline = [withStroke(linewidth=2.4, foreground=halo)]
    for angle in (30, 60, 90):
        ax.add_patch(Circle((0, 0), angle / 90, fill=False, color=FAINT if angle == 90 else ring, linewidth=0.6))
    for angle in (30, 60):
        ax.text(0, -angle / 90, f"{angle}°", fontsize=7, color=ink, ha="center", va="center", path_effects=outline)
    for x, mark in ((-theta_i / 90, WI), (theta_i / 90, MIRROR)) if above else ():
        ax.plot(x, 0, color=ink, path_effects=outline, **mark)
    ax.set(xlim=(-1.03, 1.03), ylim=(-1.03, 1.03), xticks=[], yticks=[], aspect="equal")
    ax.set_frame_on(False)
