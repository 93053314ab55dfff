"""Pictures of what a sampler draws beside its density, by the histograms of the statistical tests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from ..probe.arrays import Array
from ..probe.directions import from_plane, to_plane
from .svg import DENSITY, DEVIATION, IMPOSSIBLE, brief_number, levels_of, png, ticks
from .trial import Trial

SURE = 1e-6
"""A p-value below which no luck is to blame."""
PIXELS, GAP = 190, 10
"""The size of a picture, and the distance of the next."""
HEMISPHERE = 92.0
"""Half the size of a window, in degrees, that shows a side of the surface from horizon to horizon."""
LARGEST = 2.0**127
"""A density that float32 cannot tell from an infinite one."""


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
        half, (x_middle, y_middle) = float((high - low).max()) / 2, (low + high) / 2
        yield View(side, x_middle, y_middle, half) if half < 45 else View(side, 0, 0, HEMISPHERE)


def _ends(values: Array, weights: Array, tail: float) -> tuple[int, int]:
    """Return which values have all but this part of the weights between them at either end."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    first, last = order[np.searchsorted(cumulative, [tail * cumulative[-1], (1 - tail) * cumulative[-1]])]
    return first, last


def rasters(trial: Trial, view: View) -> Array:
    """Return the density of the samples drawn, what ``pdf`` says of it, and their difference in standard deviations, in
    each pixel of a window; NaN outside the hemisphere. Cells smaller than a pixel are merged, so that none is missed.

    Shape (3, PIXELS, PIXELS), in rows from the top.
    """
    steps = ((np.arange(PIXELS) + 0.5) / PIXELS * 2 - 1) * view.half
    x, y = np.meshgrid(view.x + steps, view.y + steps)
    inside = np.hypot(x, y) < 90
    cells = trial.partition
    merged = cells.merged(int(np.log2(90 * PIXELS / view.half)))
    counts, expected, integrals, solid_angles = (
        np.bincount(merged, each)
        for each in (trial.counts, np.fmin(trial.expected, LARGEST), cells.integrals, cells.solid_angles)
    )
    pictures = np.full((3, PIXELS, PIXELS), np.nan)
    pictures[:, inside] = np.array([
        counts / trial.count / solid_angles,
        integrals / solid_angles,
        (counts - expected) / np.sqrt(np.maximum(expected, 1)),
    ])[:, merged[cells.cells(from_plane(x[inside], -y[inside], view.side, trial.axis))]]  # fmt: skip
    return pictures


def pictures(alt: str, trials: Sequence[Trial]) -> str:
    """Return a figure of what the sampler of a part draws, for each direction of incidence."""
    rows = []
    for trial in trials:
        where, seen, p = f"light from {trial.incident.name}", list(views(trial)), trial.test.p_value
        panels = "".join(_panels(f"{alt}, {where}", trial, view) for view in seen)
        told = f'<span class="{"" if p >= SURE else "fail"}">p = {p:.2g}</span>' if seen else "next to nothing is drawn"
        rows.append(f"<div><p>{escape(where.capitalize())}: {told}</p>{panels}</div>")
    return f"""<figure>
<figcaption>The samples drawn should look like the pdf, and the difference, in standard deviations, like noise: all seen
from above, at the distance θ from the centre, with the light from the left (the circle; the cross is the mirror
direction, or straight on), in the colours of the scale below and white for nothing.</figcaption>
<div class="rows">
{"".join(rows)}
</div>
</figure>"""


def _panels(alt: str, trial: Trial, view: View) -> str:
    """Return the three pictures of a window, side by side."""
    drawn, density, deviation = rasters(trial, view)
    samples = np.concatenate([drawn, density])
    samples = samples[(samples > 0) & (samples < LARGEST)]
    low, high = (samples[k] for k in _ends(samples, samples, 1e-3)) if samples.size else (0.1, 1)
    low = min(low, high / 10)
    side = f"{'above' if view.side > 0 else 'below'} the surface"
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn_levels, levels = (levels_of(np.log(values / low) / np.log(high / low)) for values in (drawn, density))
    impossible = (density < 0) | (density >= LARGEST)
    levels[impossible] = IMPOSSIBLE
    panels = [
        (f"drawn, {side}", png(drawn_levels, DENSITY)),
        ("pdf, red where negative or infinite" if impossible.any() else "pdf", png(levels, DENSITY)),
        ("difference", png(levels_of(deviation / 10 + 0.5), DEVIATION)),
    ]
    overlay = _overlay(trial, view)
    drawing = "".join(
        f'<g transform="translate({k * (PIXELS + GAP)} 14)"><text y="-4">{title}</text>'
        f'<rect width="{PIXELS}" height="{PIXELS}" fill="#fff"/>'
        f'<image width="{PIXELS}" height="{PIXELS}" href="data:image/png;base64,{data}"/>{overlay}</g>'
        for k, (title, data) in enumerate(panels)
    )
    scale, right = 2 * PIXELS + GAP, 3 * PIXELS + 2 * GAP
    return f"""<svg class="panels" viewBox="0 0 {right} {PIXELS + 58}" role="img"
aria-label="{escape(alt)}, {side}: the samples drawn, their pdf, and the difference">
{drawing}
<g transform="translate(0 {PIXELS + 34})">
<rect width="{scale}" height="6" fill="url(#density)"/>
<text y="19">{brief_number(low)} per sr</text><text y="19" x="{scale}" class="end">{brief_number(high)} per sr</text>
<rect x="{scale + GAP}" width="{PIXELS}" height="6" fill="url(#deviation)"/>
<text y="19" x="{scale + GAP}">−5σ</text><text y="19" x="{right}" class="end">5σ</text>
</g></svg>"""


def _overlay(trial: Trial, view: View) -> str:
    """Return the lines over a picture, in degrees, and the ticks below it."""
    wi = trial.incident.wi
    theta, r = float(np.degrees(np.arctan2(np.hypot(wi[0], wi[1]), abs(wi[2])))), view.half / 25
    marks = f"M{theta - r:.9g} 0h{2 * r:g}M{theta:.9g} {-r:g}v{2 * r:g}"
    if wi[2] * view.side > 0:
        marks += f"M{-theta - r:.9g} 0a{r:g} {r:g} 0 1 0 {2 * r:g} 0a{r:g} {r:g} 0 1 0 {-2 * r:g} 0"
    left, size = view.x - view.half, 2 * view.half
    marked, rings = ticks(max(left + 0.05 * size, -90), min(left + 0.95 * size, 90)), ""
    if view.half == HEMISPHERE:
        marked = [-60, 0, 60]
        rings = '<circle class="ring" r="30"/><circle class="ring" r="60"/><circle class="horizon" r="90"/>'
    labels = "".join(
        f'<text class="middle" x="{(tick - left) / size * PIXELS:.1f}" y="{PIXELS + 11}">{tick:g}°</text>'
        for tick in marked
    )
    return (
        f'<svg width="{PIXELS}" height="{PIXELS}" viewBox="{left:.9g} {view.y - view.half:.9g} {size:g} {size:g}">'
        f'{rings}<path class="ring" d="M{left:.9g} 0h{size:g}"/><path class="halo" d="{marks}"/>'
        f'<path class="mark" d="{marks}"/></svg>{labels}'
    )
