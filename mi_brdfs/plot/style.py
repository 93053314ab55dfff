"""What Matplotlib figures look like."""

from __future__ import annotations

import re
from collections.abc import Sequence
from io import BytesIO
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..parameters.messages import printable

# Okabe and Ito's colours, which the colour-blind can tell apart, without the yellow, too pale for lines.
COLOURS = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"
# Styles too, so that coinciding curves are both visible; their number is coprime to that of the colours.
STYLES = "-", (0, (3, 1.5)), (0, (1, 1.5)), (0, (4, 1.5, 1, 1.5)), (0, (4, 1.5, 1, 1.5, 1, 1.5))
UNBROKEN = {"linestyle": "-"}
"""The look of what has gaps, which must not be taken for dashes."""
CHANNELS = {"red": "#c62f2d", "green": "#2b8a3e", "blue": "#2b5fc4"}
LIGHTEST = 0.75
INK, FAINT, GRID = "#222222", "#808080", "#dddddd"
TEXT, SMALL = 9, 8
LETTERS = 12
"""The approximate number of letters per inch."""
WIDTH = 8
QUANTITY = r"$f\,\cos\theta_o$"


class _Figure(Figure):
    """A figure that notebooks show without pyplot."""

    is_sized = False
    """Whether its size was asked for, so that it does not grow with its legend."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        png = BytesIO()
        self.savefig(png, format="png", dpi=2 * self.dpi)  # as the format "retina" of Jupyter
        width, height = self.get_size_inches() * self.dpi
        return png.getvalue(), {"width": round(width), "height": round(height)}


def checked_size(size: Sequence[float]) -> tuple[float, float]:
    """Return a width and a height in inches, or raise a ValueError."""
    if np.shape(size) != (2,) or not all(1 <= side <= 50 for side in size):
        raise ValueError(f"size {size}: give a width and a height in inches, from 1 to 50, as in (6, 4)")
    return size[0], size[1]


def new_figure(width: float, height: float, size: tuple[float, float] | None = None) -> _Figure:
    """Return a figure of a width and a height in inches, or of the size that is asked for. Raise a ValueError if that
    is none."""
    width, height = checked_size(size) if size else (width, height)
    figure = _Figure(figsize=(width, height), dpi=144, layout="constrained", facecolor="white")
    figure.is_sized = size is not None
    figure.get_layout_engine().set(rect=(0, 0, 1, 1 - 0.08 / height))  # titles otherwise touch the edge
    return figure


def calm(ax: Axes) -> None:
    """Make everything except the data thin, grey and small."""
    ax.set_axisbelow(True)
    ax.grid(color=GRID, linewidth=0.6)
    ax.tick_params(which="both", labelsize=SMALL, labelcolor=INK, color=FAINT, length=0)
    for spine in ax.spines.values():
        spine.set(color=FAINT, linewidth=0.6)


def plain(text: str) -> str:
    """Return a text of the user's, in which Matplotlib is to see no formulas and SVG no control characters."""
    return printable(str(text)).replace("$", r"\$")


def set_title(figure: Figure, text: str) -> None:
    figure.suptitle(fill(text, int(LETTERS * figure.get_figwidth())), fontsize=TEXT + 1, color=INK)


def add_legend(
    figure: _Figure, handles: list, labels: list[str], constants: Sequence[str] = (), places: Sequence[Place] = ()
) -> None:
    """Add a legend below the figure, with the constants above its entries, of which each hue with several has a column,
    if there is room."""
    room = LETTERS * figure.get_figwidth()
    labels = [fill(label, int(room) - 10) for label in labels]
    # A formula is about two letters wide, and a handle six.
    widths = [max(map(len, re.sub(r"\$.*?\$", "xx", label).splitlines())) + 6 for label in labels]
    columns = len(labels) if sum(widths) < room else max(1, int(room / max(widths)))
    run = max((it.of for it in places if it.hue is not None), default=1)
    wanted = -(-len(labels) // run)
    if run > 1 and columns < len(labels) and wanted * max(widths) <= room:
        columns, blank = wanted, wanted * run - len(labels)
        handles, labels = [*handles, *blank * [Line2D([], [], linestyle="")]], [*labels, *blank * [""]]
    heading = "\n".join(fill(text, int(room)) for text in constants)
    if not figure.is_sized:
        rows = -(-len(labels) // columns) + max(label.count("\n") for label in labels) + heading.count("\n")
        figure.set_figheight(figure.get_figheight() + 0.18 * (rows - 1 + bool(heading)))
    added = figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=TEXT,
                          labelcolor=INK, title=heading or None, title_fontsize=TEXT)  # fmt: skip
    added.get_title().set(color=INK, multialignment="center")


def add_bar(colours: ScalarMappable, axes: Any, text: str, **options: Any) -> None:
    """Add a scale of colours beside axes."""
    bar = np.ravel(axes)[0].figure.colorbar(colours, ax=axes, aspect=25, pad=0.02, **options)
    bar.set_label(text, fontsize=TEXT, color=INK)
    bar.ax.tick_params(labelsize=SMALL, labelcolor=INK)
    bar.outline.set_visible(False)


class Place(NamedTuple):
    """The place of a curve among others: the number of its hue, None on a ramp of hues, and its step on a ramp."""

    hue: int | None
    at: int = 0
    of: int = 1


def look(place: Place, channel: str = "") -> dict[str, Any]:
    """Return the style of a curve, and its colour, a channel's or that of its place."""
    hue, at, of = place
    if hue is None:
        # Up to where a line can be told from white, and in inverted figures from black.
        return {"color": to_hex(colormaps["viridis"](LIGHTEST * at / (of - 1))), **UNBROKEN, "linewidth": 1.6}
    colour = CHANNELS.get(channel, INK) if channel else COLOURS[hue % len(COLOURS)]
    if of > 1:
        own = np.array(to_rgb(colour))
        ramp = LinearSegmentedColormap.from_list("", [0.5 * own, own, 1 - 0.5 * (1 - own)])
        colour = to_hex(ramp(at / (of - 1)))
    return {"color": colour, "linestyle": STYLES[hue % len(STYLES)], "linewidth": 1.6}


def incidence(theta: float) -> str:
    return rf"$\theta_i$ = {theta:g}°"
