"""Pictures of what a sampler draws beside its density, and of its weights beside eval/pdf, by the histograms of the
statistical tests; and of energy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from ..pages.figures import DENSITY, DIFFERENCE, SERIES, brief
from ..plot.style import FAINT, INK, SMALL, STYLES, calm, new_figure
from ..probe.arrays import Array
from ..probe.directions import from_plane, to_plane
from .trial import LARGEST, Trial

SURE = 1e-6
"""A p-value below which no luck is to blame."""
PIXELS = 190
"""The size of a picture."""
LEVELS = 64
"""How many colours a picture has: with more, its file would be larger and show no more."""
IMPOSSIBLE = 230 / 255, 0, 60 / 255, 1
"""The red of what no density may be."""
HIGHEST = 4
"""Where the chart of energy ends at the latest, so that what is right can still be seen."""
HEMISPHERE = 92.0
"""Half the size of a window, in degrees, that shows a side of the surface from horizon to horizon."""


class Maps(NamedTuple):
    """Two maps that should look alike, and how much the first is above the second; a value for each cell."""

    told: str
    names: tuple[str, str]
    unit: str
    """Of both."""
    values: Array
    """Shape (3, cells)."""
    reach: float
    """Where the scale of the difference ends."""
    ends: tuple[str, str]
    """That in words, at either end."""
    worst: Array | None = None
    """The direction in which they differ most, if that is no chance."""


class View(NamedTuple):
    """A square window on one side of the surface: its middle and half its size, in degrees of the projection
    :func:`~mi_brdfs.probe.directions.to_plane`, but with y downwards, as in pictures."""

    side: int
    x: float
    y: float
    half: float


def views(trial: Trial) -> Iterator[View]:
    """Yield a window for each side to which more than a ten-thousandth goes. It holds 99 % of what is drawn and
    expected there, and where the two deviate most if they do."""
    cells, worst = trial.partition, trial.test.worst
    x, y = to_plane(cells.centres, trial.axis)
    y = -y
    size = 180 * 2.0**-cells.level
    weights = trial.counts + np.fmin(trial.count * abs(cells.integrals), trial.count)
    for side in (1, -1):
        here = weights * (cells.centres[:, 2] * side > 0)
        if here.sum() < 1e-4 * trial.count:
            continue
        held = [*_ends(x, here, 0.005), *_ends(y, here, 0.005)]
        held += [worst] if trial.test.p_value < SURE and here[worst] else []
        low, high = (np.array([(p[held] + sign * size[held]) for p in (x, y)]) for sign in (-1, 1))
        low, high = low.min(axis=1), high.max(axis=1)
        # With room for the ring about where they deviate most.
        half, (x_middle, y_middle) = 1.1 * float((high - low).max()) / 2, (low + high) / 2
        yield View(side, x_middle, y_middle, half) if half < 45 else View(side, 0, 0, HEMISPHERE)


def _ends(values: Array, weights: Array, tail: float) -> tuple[int, int]:
    """Return which values have all but this part of the weights between them at either end."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    first, last = order[np.searchsorted(cumulative, [tail * cumulative[-1], (1 - tail) * cumulative[-1]])]
    return first, last


Summed = Callable[[Array], Array]
"""A function that sums the values of cells over those that a pixel holds."""


def densities(trial: Trial, summed: Summed) -> Maps:
    """Return the density of the samples drawn, what ``pdf`` says of it, and their difference in standard deviations."""
    cells = trial.partition
    each = trial.counts, np.fmin(trial.expected, LARGEST), cells.integrals, cells.solid_angles
    counts, expected, integrals, solid_angles = map(summed, each)
    deviation = (counts - expected) / np.sqrt(np.maximum(expected, 1))
    values = np.array([counts / trial.count / solid_angles, integrals / solid_angles, deviation])
    reach = float(np.clip(np.quantile(abs(deviation), 0.9), 5, 500))
    told = "the samples drawn, their pdf, and the difference"
    ends = f"−{reach:.0f}σ, too few", f"too many, +{reach:.0f}σ"
    worst = cells.centres[trial.test.worst] if trial.test.p_value < SURE else None
    return Maps(told, ("drawn", "pdf"), " per sr", values, reach, ends, worst)


def weights(trial: Trial, summed: Summed) -> Maps:
    """Return the mean weight of the samples, the mean of eval/pdf, and by which part of it the first is above."""
    weight, quotient, counts = map(summed, (*trial.weights, trial.counts))
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.array([weight / counts, quotient / counts, weight / quotient - 1])
    off = abs(values[2][np.isfinite(values[2])])
    reach = float(np.clip(np.quantile(off, 0.99), 0.01, 1)) if off.size else 1
    ends = f"−{reach:.0%}", f"too large, +{reach:.0%}"
    return Maps("the weights, eval/pdf, and the difference", ("weight", "eval/pdf"), "", values, reach, ends)


def rasters(trial: Trial, view: View, maps: Callable[[Trial, Summed], Maps] = densities) -> tuple[Array, Maps]:
    """Return three pictures of a window, NaN outside the hemisphere, and the maps that they are of. Cells smaller than
    a pixel are merged, so that none is missed.

    Shape (3, PIXELS, PIXELS), in rows from the top.
    """
    steps = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * view.half
    x, y = np.meshgrid(view.x + steps, view.y + steps)
    inside = np.hypot(x, y) < 90
    cells = trial.partition
    merged = cells.merged(int(np.log2(90 * PIXELS / view.half)))
    made = maps(trial, partial(np.bincount, merged))
    pictures = np.full((3, PIXELS, PIXELS), np.nan)
    places = from_plane(x[inside], -y[inside], view.side, trial.axis)
    pictures[:, inside] = made.values[:, merged[cells.cells(places)]]
    return pictures, made


def pictures(trial: Trial, weighed: bool = False) -> Iterator[tuple[str, Figure, tuple[str, str], tuple[str, str]]]:
    """Yield for each window what it shows, in words; what the sampler draws there, what ``pdf`` says of it and their
    difference side by side; and what the ends of the two scales stand for. Then the same of its weights if they are to
    be ``weighed``."""
    for maps in (densities, weights) if weighed else (densities,):
        for view in views(trial):
            drawn, made = rasters(trial, view, maps)
            if np.isfinite(drawn[2]).any():  # there are weights only where samples are
                yield _figure(trial, view, drawn, made)


def _figure(
    trial: Trial, view: View, pictures: Array, maps: Maps
) -> tuple[str, Figure, tuple[str, str], tuple[str, str]]:
    first, second, difference = pictures
    shown = pictures[:2][(pictures[:2] > 0) & (pictures[:2] < LARGEST)]
    low, high = (shown[k] for k in _ends(shown, shown, 1e-3)) if shown.size else (0.1, 1)
    low = min(low, high / 10)
    side, scale, palette = "above" if view.side > 0 else "below", LogNorm(low, high), DENSITY.resampled(LEVELS)
    expected, impossible = palette(scale(second)), (second < 0) | (second >= LARGEST)
    expected[impossible] = IMPOSSIBLE
    colours = {
        f"{maps.names[0]} {side}": palette(scale(first)),
        f"{maps.names[1]}, red where < 0 or infinite" if impossible.any() else maps.names[1]: expected,
        "difference": DIFFERENCE.resampled(LEVELS - 1)(Normalize(-maps.reach, maps.reach)(difference)),
    }
    # Without a layout that is computed, which takes ten times as long as the drawing.
    figure = Figure(figsize=(6.1, 2.3))
    places = {"left": 0.012, "right": 0.988, "bottom": 0.09, "top": 0.92, "wspace": 0.06}
    for ax, (title, each) in zip(figure.subplots(1, 3, gridspec_kw=places), colours.items(), strict=True):
        ax.set_title(title + ", zoomed" * (view.half < HEMISPHERE), loc="left", fontsize=SMALL, pad=3)
        _draw(ax, each, trial, view, maps.worst)
    return f"{side} the surface: {maps.told}", figure, (brief(low) + maps.unit, brief(high) + maps.unit), maps.ends


def _draw(ax: Axes, colours: Array, trial: Trial, view: View, worst: Array | None) -> None:
    """Draw a picture, with where the light comes from and where a mirror sends it."""
    left, right, size = view.x - view.half, view.x + view.half, 2 * view.half
    top, bottom = view.y - view.half, view.y + view.half
    ax.imshow(colours, interpolation="none", extent=(left, right, bottom, top))
    ax.axhline(0, color=FAINT, linewidth=0.6, linestyle=(0, (3, 4)))
    wi = trial.incident.wi
    theta = float(np.degrees(np.arctan2(np.hypot(wi[0], wi[1]), abs(wi[2]))))
    for colour, width in ("white", 2.2), ("black", 0.9):
        ax.plot(theta, 0, "+", color=colour, markersize=7, markeredgewidth=width)
        if wi[2] * view.side > 0:
            ax.plot(-theta, 0, "o", color=colour, markersize=5, markeredgewidth=width, fillstyle="none")
    if worst is not None and worst[2] * view.side > 0:
        x, y = to_plane(worst[None], trial.axis)
        for colour, width in ("white", 2.6), ("black", 1.2):
            ring = {"markersize": 13, "markeredgewidth": width, "fillstyle": "none", "clip_on": False}
            ax.plot(x, -y, "o", color=colour, **ring)
    ax.set(xlim=(left, right), ylim=(bottom, top), yticks=[], frame_on=False)
    if view.half == HEMISPHERE:
        marked = [-60, 0, 60]
        for radius, style in (30, (0, (3, 4))), (60, (0, (3, 4))), (90, "-"):
            ax.add_patch(Circle((0, 0), radius, fill=False, color=FAINT, linewidth=0.6, linestyle=style))
    else:
        low, high = max(left + 0.05 * size, -90), min(right - 0.05 * size, 90)
        marked = [tick for tick in MaxNLocator(4).tick_values(low, high) if low <= tick <= high]
    ax.set_xticks(marked, [f"{tick:g}°" for tick in marked])
    ax.tick_params(labelsize=SMALL, length=0, pad=1)


def chart(energy: dict[str, dict[str, Any]]) -> Figure:
    """Return a chart of the albedo and the efficiency of a part over the angle of incidence."""
    figure = new_figure(4, 2.1)
    ax = figure.subplots()
    calm(ax)
    ax.grid(axis="x", visible=False)
    largest, at = 1.0, 0.0
    looks = dict(zip(("albedo", "efficiency"), zip(SERIES, STYLES, strict=False), strict=False))
    for kind, data in energy.items():
        colour, style = looks[kind]
        values = {name: value["albedo"] if kind == "albedo" else value for name, value in data.items() if "°" in name}
        for behind in (False, True):
            points = [
                (float(name.split("°")[0]), value)
                for name, value in values.items()
                if name.endswith("behind") == behind and np.isfinite(value)
            ]
            ax.plot(*zip(*points, strict=True), color=colour, linestyle=style, linewidth=0.8 if behind else 1.6)
            largest, at = max([(largest, at), *((value, theta) for theta, value in points)])
    ax.set(xlim=(0, 90), ylim=(0, min(largest, HIGHEST) * 1.02))
    if largest > HIGHEST:
        side = "right" if at > 45 else "left"
        ax.set_title(f"↑ {largest:.3g} at {at:g}°", loc=side, fontsize=SMALL, color=INK, pad=3)
    ax.set_xticks([0, 30, 60, 90], ["0°", "30°", "60°", "90°"])
    ax.set_xlabel("θi", fontsize=SMALL, color=INK)
    ax.set_ylabel("albedo, η" if "efficiency" in energy else "albedo", fontsize=SMALL, color=INK)
    return figure
