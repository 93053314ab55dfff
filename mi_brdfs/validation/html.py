"""Reports as one page of HTML that needs nothing else: what is wrong in sentences, pictures of it, and all findings."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import mitsuba as mi
import numpy as np

from .. import __version__
from .report import Finding, Report, Verdict
from .sampling import Trial

STYLE = """
:root { color-scheme: light dark; --ink: #222; --faint: #666; --line: #ccc; --paper: #fff; --bad: #b3261e;
  --albedo: #0072b2; --efficiency: #b35900 }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --faint: #999; --line: #444; --paper: #16181c;
  --bad: #ff8a80; --albedo: #56b4e9; --efficiency: #e69f00 } }
body { margin: 0 auto; padding: 1rem; max-width: 82rem; font: 1rem/1.45 system-ui, sans-serif; color: var(--ink);
  background: var(--paper) }
h1, h2, li, th:first-child, td:last-child { overflow-wrap: anywhere }
h2 { margin-top: 3rem; border-top: 1px solid var(--line); padding-top: 1rem }
a { color: inherit }
.wide { overflow-x: auto }
table { border-collapse: collapse; font-size: 0.9rem }
th, td { padding: 0.15rem 0.6rem; text-align: left; vertical-align: top }
thead th { border-bottom: 1px solid var(--line) }
ul { margin: 0; padding-left: 1.2rem }
.fail { color: var(--bad) }
td.fail, span.fail { font-weight: 600 }
.skip, .info, .none, figcaption, footer { color: var(--faint) }
figure { margin: 1rem 0 }
figcaption { font-size: 0.9rem }
.rows { display: grid; gap: 0.5rem 2rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 32rem), 1fr)) }
.rows p { margin: 0.5rem 0 0 }
.energy { display: flex; flex-wrap: wrap; gap: 1rem 2rem; align-items: center }
.energy figcaption { flex: 1 20rem }
svg { display: block; fill: currentColor; font-size: 10px }
.panels { width: 100% }
@media (max-width: 36rem) { .panels { font-size: 14px } }
.chart { flex: 1 20rem; max-width: 24rem }
.middle { text-anchor: middle }
.end { text-anchor: end }
image { image-rendering: pixelated }
path, circle { fill: none; vector-effect: non-scaling-stroke }
.ring { stroke: #808080; stroke-dasharray: 3 4 }
.horizon { stroke: #808080 }
.halo { stroke: #fff; stroke-width: 3 }
.mark { stroke: #000; stroke-width: 1.2 }
.grid { stroke: var(--line) }
.albedo { stroke: var(--albedo); stroke-width: 2 }
.efficiency { stroke: var(--efficiency); stroke-width: 2; stroke-dasharray: 6 3 }
.behind { stroke-width: 1 }
"""


def page(reports: Sequence[Report]) -> str:
    """The page, as text."""
    failed = sum(not report.passed for report in reports)
    heading = f"{len(reports)} BSDF{'s' if len(reports) != 1 else ''} checked, {failed or 'none'} failed"
    sections = "\n".join(_section(report, f"bsdf-{k}") for k, report in enumerate(reports, 1))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{heading}</title>
<style>{STYLE}</style>
</head>
<body>
<header><h1>{heading}</h1></header>
<main>
{_summary(reports)}
<svg width="0" height="0" aria-hidden="true">{_gradient("density", DENSITY)}{_gradient("deviation", DEVIATION)}</svg>
{sections}
</main>
<footer><p>mi_brdfs {escape(__version__)}, Mitsuba {escape(mi.__version__)}</p></footer>
</body>
</html>
"""


def _summary(reports: Sequence[Report]) -> str:
    """A row for each report, a column for each check."""
    checks = list(dict.fromkeys(finding.check for report in reports for finding in report.findings))
    heads = "".join(f'<th scope="col">{escape(check)}</th>' for check in checks)
    rows = []
    for k, report in enumerate(reports, 1):
        cells = "".join(_cell(report.verdict(check)) for check in checks)
        rows.append(f'<tr><th scope="row"><a href="#bsdf-{k}">{escape(report.name)}</a></th>{cells}</tr>')
    return _table(rows, f'<thead><tr><th scope="col">BSDF</th>{heads}</tr></thead>')


def _cell(verdict: Verdict | None) -> str:
    return f'<td class="{verdict or "none"}">{"FAIL" if verdict == "fail" else verdict or "-"}</td>'


def _section(report: Report, anchor: str) -> str:
    """All about one BSDF."""
    energy = [finding for finding in report.findings if finding.check in ("albedo", "efficiency") and finding.data]
    figures = []
    for part in dict.fromkeys([trial.part for trial in report.trials] + [finding.subject for finding in energy]):
        alt, trials = f"{report.name}, {part}", [trial for trial in report.trials if trial.part == part]
        curves = {finding.check: finding.data for finding in energy if finding.subject == part}
        figures += [f"<h3>{escape(part)}</h3>"]
        figures += [_pictures(alt, trials)] if trials else []
        figures += [_chart(alt, curves)] if curves else []
    rows = [
        f"<tr>{_cell(finding.verdict)}<td>{escape(finding.check)}</td><td>{escape(finding.subject)}</td>"
        f"<td>{escape(finding.message)}{_list(_others(finding))}</td></tr>"
        for finding in report.findings
    ]
    return f"""<section id="{anchor}">
<h2>{escape(report.name)}</h2>
{_outcome(report)}
{"".join(figures)}
<details><summary>All findings</summary>
{_table(rows)}
</details>
</section>"""


def _outcome(report: Report) -> str:
    if not report.passed:
        return _list([f"{f.check}, {f.subject}: {f.message}" for f in report.failures], "fail")
    return f"<p>{escape(report.why_not_judged or 'Passed.')}</p>"


def _others(finding: Finding) -> list[str]:
    """The faults that its message only counts."""
    return [fault for fault in finding.data.get("faults", []) if not finding.message.startswith(fault)]


def _list(sentences: Sequence[str], kind: str = "") -> str:
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<ul class="{kind}">{items}</ul>' if items else ""


def _table(rows: Sequence[str], head: str = "") -> str:
    return f'<div class="wide"><table>{head}<tbody>\n{"".join(rows)}\n</tbody></table></div>'


# --- What is drawn --------------------------------------------------------------------------------------------------

SURE = 1e-6
"""A p-value below which no luck is to blame."""
PIXELS, GAP = 190, 10
"""The size of a picture, and the distance of the next."""
HEMISPHERE = 92.0
"""Half the size of a window, in degrees, that shows a side of the surface from horizon to horizon."""
LARGEST = 2.0**127
"""A density that float32 cannot tell from an infinite one."""


class View(NamedTuple):
    """A square window on one side of the surface: its middle in the plane of :func:`flattened`, and half its size."""

    side: int
    x: float
    y: float
    half: float


def flattened(w, axis) -> tuple[np.ndarray, np.ndarray]:
    """Directions as points of a plane: seen from above with the light to the left and y downwards, at the distance θ
    from the centre, in degrees. Unlike in an orthographic view, what is at grazing angles can be seen, and a scale
    along the plane of incidence is one of θ wherever the window is."""
    along, across = w @ [axis[0], axis[1], 0], w @ [-axis[1], axis[0], 0]
    sin = np.hypot(along, across)
    scale = np.degrees(np.arctan2(sin, abs(w[:, 2]))) / np.maximum(sin, 1e-30)
    return -along * scale, across * scale


def raised(x, y, side, axis) -> np.ndarray:
    """The directions of points of that plane."""
    theta = np.hypot(x, y)
    scale = np.sin(np.radians(theta)) / np.maximum(theta, 1e-30)
    along, across, up = -x * scale, y * scale, side * np.cos(np.radians(theta))
    return np.stack([axis[0] * along - axis[1] * across, axis[1] * along + axis[0] * across, up], axis=-1)


def views(trial: Trial) -> Iterator[View]:
    """A window for each side to which more than a ten-thousandth goes. It holds 99 % of what is drawn and expected
    there, and where the two deviate most if they do."""
    cells, worst = trial.partition, trial.test.worst
    x, y = flattened(cells.centres, trial.axis)
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
        half = float((high - low).max()) / 2
        yield View(side, *(low + high) / 2, half) if half < 45 else View(side, 0, 0, HEMISPHERE)


def _ends(values, weights, tail: float) -> tuple[int, int]:
    """Which values have all but this part of the weights between them at either end."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    return tuple(order[np.searchsorted(cumulative, [tail * cumulative[-1], (1 - tail) * cumulative[-1]])])


def rasters(trial: Trial, view: View) -> np.ndarray:
    """The density of the samples drawn, what ``pdf`` says of it, and their difference in standard deviations, in each
    pixel of a window; NaN outside the hemisphere. Cells smaller than a pixel are merged, so that none is missed."""
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
    ])[:, merged[cells.cells(raised(x[inside], y[inside], view.side, trial.axis))]]  # fmt: skip
    return pictures


def _pictures(alt: str, trials: Sequence[Trial]) -> str:
    """What the sampler of a part draws, for each direction of incidence."""
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
    """The three pictures of a window, side by side."""
    drawn, density, deviation = rasters(trial, view)
    samples = np.concatenate([drawn, density])
    samples = samples[(samples > 0) & (samples < LARGEST)]
    low, high = (samples[k] for k in _ends(samples, samples, 1e-3)) if samples.size else (0.1, 1)
    low = min(low, high / 10)
    side = f"{'above' if view.side > 0 else 'below'} the surface"
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn_levels, levels = (_levels(np.log(values / low) / np.log(high / low)) for values in (drawn, density))
    impossible = (density < 0) | (density >= LARGEST)
    levels[impossible] = IMPOSSIBLE
    panels = [
        (f"drawn, {side}", _png(drawn_levels, DENSITY)),
        ("pdf, red where negative or infinite" if impossible.any() else "pdf", _png(levels, DENSITY)),
        ("difference", _png(_levels(deviation / 10 + 0.5), DEVIATION)),
    ]
    overlay = _overlay(trial, view)
    drawing = "".join(
        f'<g transform="translate({k * (PIXELS + GAP)} 14)"><text y="-4">{title}</text>'
        f'<rect width="{PIXELS}" height="{PIXELS}" fill="#fff"/>'
        f'<image width="{PIXELS}" height="{PIXELS}" href="data:image/png;base64,{png}"/>{overlay}</g>'
        for k, (title, png) in enumerate(panels)
    )
    scale, right = 2 * PIXELS + GAP, 3 * PIXELS + 2 * GAP
    return f"""<svg class="panels" viewBox="0 0 {right} {PIXELS + 54}" role="img"
aria-label="{escape(alt)}, {side}: the samples drawn, their pdf, and the difference">
{drawing}
<g transform="translate(0 {PIXELS + 34})">
<rect width="{scale}" height="6" fill="url(#density)"/>
<text y="16">{_number(low)} per sr</text><text y="16" x="{scale}" class="end">{_number(high)} per sr</text>
<rect x="{scale + GAP}" width="{PIXELS}" height="6" fill="url(#deviation)"/>
<text y="16" x="{scale + GAP}">−5σ</text><text y="16" x="{right}" class="end">5σ</text>
</g></svg>"""


def _overlay(trial: Trial, view: View) -> str:
    """The lines over a picture, in degrees, and the ticks below it."""
    wi = trial.incident.wi
    theta, r = float(np.degrees(np.arctan2(np.hypot(wi[0], wi[1]), abs(wi[2])))), view.half / 25
    marks = f"M{theta - r:.9g} 0h{2 * r:g}M{theta:.9g} {-r:g}v{2 * r:g}"
    if wi[2] * view.side > 0:
        marks += f"M{-theta - r:.9g} 0a{r:g} {r:g} 0 1 0 {2 * r:g} 0a{r:g} {r:g} 0 1 0 {-2 * r:g} 0"
    left, size = view.x - view.half, 2 * view.half
    ticks, rings = _ticks(max(left + 0.05 * size, -90), min(left + 0.95 * size, 90)), ""
    if view.half == HEMISPHERE:
        ticks = -60, 0, 60
        rings = '<circle class="ring" r="30"/><circle class="ring" r="60"/><circle class="horizon" r="90"/>'
    labels = "".join(
        f'<text class="middle" x="{(tick - left) / size * PIXELS:.1f}" y="{PIXELS + 11}">{tick:g}°</text>'
        for tick in ticks
    )
    return (
        f'<svg width="{PIXELS}" height="{PIXELS}" viewBox="{left:.9g} {view.y - view.half:.9g} {size:g} {size:g}">'
        f'{rings}<path class="ring" d="M{left:.9g} 0h{size:g}"/><path class="halo" d="{marks}"/>'
        f'<path class="mark" d="{marks}"/></svg>{labels}'
    )


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers between two others, two to five of them."""
    least = (high - low) / 5
    step = next(step for step in 10 ** np.floor(np.log10(least)) * np.array([1, 2, 5, 10]) if step >= least)
    return [round(k * step, 12) for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _number(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


# --- Colours --------------------------------------------------------------------------------------------------------

# Viridis and ColorBrewer's RdBu, legible without telling red from green.
DENSITY = "440154 472d7b 3b528b 2c728e 21918c 28ae80 5ec962 addc30 fde725"
DEVIATION = "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f"
LEVELS = 63
IMPOSSIBLE = LEVELS + 1
"""The level of what no density may be, which is red."""


def _gradient(name: str, colours: str) -> str:
    stops = colours.split()
    marks = (f'<stop offset="{k / (len(stops) - 1):g}" stop-color="#{stop}"/>' for k, stop in enumerate(stops))
    return f'<linearGradient id="{name}">{"".join(marks)}</linearGradient>'


def _levels(values: np.ndarray) -> np.ndarray:
    """The levels, from 1, of values from 0 to 1; 0 where they are NaN or -∞."""
    levels = 1 + np.round(np.clip(np.nan_to_num(values), 0, 1) * (LEVELS - 1))
    return np.where(np.isnan(values) | (values == -np.inf), 0, levels).astype(np.uint8)


def _png(levels: np.ndarray, colours: str) -> str:
    """A picture in base64, transparent where the level is 0."""
    stops = np.array([[*bytes.fromhex(stop), 255] for stop in colours.split()])
    places = np.linspace(0, len(stops) - 1, LEVELS)
    shades = np.stack([np.interp(places, np.arange(len(stops)), channel) for channel in stops.T], axis=-1)
    palette = np.concatenate([[[0, 0, 0, 0]], np.round(shades), [[230, 0, 60, 255]]]).astype(np.uint8)
    stream = mi.MemoryStream()
    mi.Bitmap(palette[levels]).write(stream, mi.Bitmap.FileFormat.PNG, 9)
    return base64.b64encode(stream.raw_buffer()).decode()


# --- Energy ---------------------------------------------------------------------------------------------------------

WIDTH, HEIGHT = 300, 120


def _chart(alt: str, energy: dict[str, dict]) -> str:
    """Albedo and efficiency of a part over the angle of incidence."""
    curves = []
    for kind, data in energy.items():
        values = {name: value["albedo"] if kind == "albedo" else value for name, value in data.items() if "°" in name}
        for behind in (False, True):
            points = [
                (float(name.split("°")[0]), value)
                for name, value in values.items()
                if name.endswith("behind") == behind and np.isfinite(value)
            ]
            curves += [(f"{kind} {'behind' * behind}", points)] if points else []
    top = min(max([1.0, *(value for _, points in curves for _, value in points)]), 4)
    drawing = [
        f'<path class="grid" d="M0 {y:.1f}h{WIDTH}"/><text class="end" x="-6" y="{y + 3:.1f}">{value:g}</text>'
        for value in _ticks(0, top)
        for y in [HEIGHT * (1 - value / top)]
    ]
    drawing += [
        f'<text class="middle" x="{WIDTH * theta / 90:g}" y="{HEIGHT + 16}">{theta}°</text>'
        for theta in (0, 30, 60, 90)
    ]
    # A viewport of their own cuts off what exceeds the chart.
    drawing.append(f'<svg y="-2" width="{WIDTH}" height="{HEIGHT + 4}" viewBox="0 -2 {WIDTH} {HEIGHT + 4}">')
    for kind, points in curves:
        path = "L".join(
            f"{WIDTH * theta / 90:.1f} {HEIGHT * (1 - min(value / top, 100)):.1f}" for theta, value in points
        )
        drawing.append(f'<path class="{kind}" d="M{path}"/>')
    drawing.append("</svg>")
    thin = "; thin for light from behind" if any("behind" in kind for kind, _ in curves) else ""
    return f"""<figure class="energy">
<svg class="chart" viewBox="-30 -8 {WIDTH + 42} {HEIGHT + 28}" role="img"
aria-label="{escape(alt)}: albedo and efficiency over the angle of incidence">{"".join(drawing)}</svg>
<figcaption>What is reflected of light from each angle (solid), at most 1 where energy is conserved, and the efficiency
η of the sampler (dashed), of which 1 is perfect{thin}.</figcaption>
</figure>"""
