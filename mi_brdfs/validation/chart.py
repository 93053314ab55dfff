"""The chart of a part's energy."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from .svg import ticks

WIDTH, HEIGHT = 300, 120


def chart(alt: str, energy: dict[str, dict[str, Any]]) -> str:
    """Return a chart of the albedo and the efficiency of a part over the angle of incidence."""
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
        for value in ticks(0, top)
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
