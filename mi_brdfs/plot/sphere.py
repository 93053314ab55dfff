"""The Plotly figure."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from ..probe import curves as lobes
from ..probe.directions import direction
from .given import check_angles, constants, named, quantity, scales_of, with_smooth_part
from .style import COLOURS, FAINT, INK

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

COLUMNS, LETTERS = 3, 36
"""The most bodies beside each other, and letters in a line above one."""
UNLIKE = 10
"""The ratio of two peaks from which the lower body is too small to see on a linear scale."""


def sphere(
    *bsdfs: str | dict | mi.BSDF,
    angle: float = 45,
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
    normalize: bool = False,
    resolution: int = 32,
    samples: int = 300,
) -> Figure:
    """Draw each lobe as a body to turn with the mouse: the radius is the luminance of f cosθ_o, or its logarithm.

    Several are beside each other, on one scale. Points are directions drawn by the BSDF's sampler; the thick line is
    wi, the dotted one the mirror direction, the circle the surface. With the scale "both", buttons switch between the
    two; the logarithm is shown first if one peak is ten times another.

    Args:
        angle: of incidence, in degrees, in [0, 90).
        resolution: the number of parallels from the normal to the horizon; more where the lobe is narrow.
        samples: the number of directions drawn.

    Everything else is as in :func:`polar`. ``figure.write_html(path)`` writes a self-contained page, of 5 MB;
    ``mi_brdfs.plot.page.write(figure, path)`` a small one for any width, with Plotly's library in a file beside it.

    Raises:
        ImportError: without Plotly.
    """
    try:
        from plotly.graph_objects import Figure
    except ImportError:
        raise ImportError("this plot needs Plotly: pip install 'mi_brdfs[plot]'") from None

    check_angles([angle])
    scales = scales_of(scale)
    found = with_smooth_part(named(bsdfs, labels))
    wi = direction(angle, azimuth)
    bodies = [lobes.meshes(it.probe, angle, azimuth, resolution) for it in found]
    drawn = [lobes.drawn(it.probe, wi, samples) for it in found]
    # A little outside the body, which would hide half of each.
    points = [lobes.Mesh(1.005 * wo, lobes.value(it.probe, wi, wo)) for it, wo in zip(found, drawn, strict=True)]
    peaks = [lobes.largest(mesh.value for mesh in body) for body in bodies]
    first = "log" if "log" in scales and not normalize and max(peaks) > UNLIKE * min(peaks) else scales[0]
    if normalize:
        bodies = [[_over(mesh, peak) for mesh in body] for body, peak in zip(bodies, peaks, strict=True)]
        points = [_over(mesh, peak) for mesh, peak in zip(points, peaks, strict=True)]
    values = [mesh.value for body in bodies for mesh in body]
    peak = lobes.largest(values)
    whole = any(len(body) > 1 for body in bodies)

    traces: list[dict[str, Any]] = []
    ranges: dict[str, dict[str, list[float]]] = {}
    headings: dict[str, str] = {}
    for name in scales:
        low, high = lobes.decades(values, peak) if name == "log" else (None, peak)
        reach = 1.05 * (high - (low or 0))
        headings[name] = f"θ<sub>i</sub> = {angle:g}°, radius {quantity('f cosθ<sub>o</sub>', normalize=normalize)}"
        if low is not None:
            headings[name] += f"<br>logarithmic, from 10<sup>{low}</sup> in the middle"
        ranges[name] = {"xaxis": [-reach, reach], "yaxis": [-reach, reach],
                        "zaxis": [-reach if whole else -0.15 * reach, reach]}  # fmt: skip
        for k, it in enumerate(found):
            place = {"scene": _scene(k), "visible": name == first, "hoverinfo": "skip", "meta": name}
            colour = COLOURS[k % len(COLOURS)]
            for mesh in bodies[k]:
                traces.append({"type": "surface", "name": it.label, "showscale": False, "showlegend": False,
                               "colorscale": [[0, colour], [1, colour]], "lighting": {"specular": 0.1}, **place,
                               **_at(mesh, low)})  # fmt: skip
            own = {"legendgroup": "drawn", "showlegend": k == 0}
            traces.append({"type": "scatter3d", "mode": "markers", "name": "sampled",
                           "marker": {"size": 1.8, "color": INK}, **own, **place, **_at(points[k], low)})  # fmt: skip
            traces += [line | place | {"legendgroup": line["name"], "showlegend": k == 0} for line in _lines(wi, reach)]

    layout: dict[str, Any] = {}
    for k in range(len(found)):
        axes = {axis: {"visible": False, "range": limits} for axis, limits in ranges[first].items()}
        ratio = {"x": 1, "y": 1, "z": 1 if whole else 0.575}
        camera = {"eye": _eye(azimuth, 1.5 if whole else 1.1), "center": {"x": 0, "y": 0, "z": -0.05}}
        layout[_scene(k)] = {**axes, "aspectmode": "manual", "aspectratio": ratio, "camera": camera}
    names = ["<br>".join(wrap(it.label, LETTERS)) for it in found]
    figure = Figure(traces)
    figure.update_layout(
        title={"text": headings[first],
               "font": {"size": 15}, "x": 0.02, "xanchor": "left", "y": 1, "yanchor": "top", "pad": {"t": 24}},
        font={"color": INK},
        legend={"itemsizing": "constant", "orientation": "h", "x": 0.5, "xanchor": "center", "y": 0, "yanchor": "top",
                "title": {"text": "<br>".join(constants(bsdfs)), "side": "top center"}},
        margin={"l": 0, "r": 0, "t": 96, "b": 70},
        annotations=[{"text": text, "showarrow": False, "xref": "paper", "yref": "paper", "xanchor": "center",
                      "yanchor": "top", "font": {"size": 13}} for text in names],
        **layout,
    )  # fmt: skip
    for k, (x, y) in enumerate(_grid(len(found))):
        figure.layout[_scene(k)].domain = {"x": x, "y": y}
        figure.layout.annotations[k].update(x=sum(x) / 2, y=y[1])
    if len(scales) > 1:
        buttons = [{"label": name, "method": "update",
                    "args": [{"visible": [each["meta"] == name for each in traces]},
                             {"title.text": headings[name]} |
                             {f"{_scene(k)}.{axis}.range": limits for k in range(len(found))
                              for axis, limits in ranges[name].items()}]} for name in scales]  # fmt: skip
        menu = {"type": "buttons", "direction": "right", "buttons": buttons, "active": scales.index(first),
                "pad": {"b": 4},
                "x": 0.02, "y": 1, "xanchor": "left", "yanchor": "bottom"}  # fmt: skip
        figure.update_layout(updatemenus=[menu])
    return figure


def _scene(k: int) -> str:
    return f"scene{k + 1}" if k else "scene"


def _grid(count: int) -> list[tuple[list[float], list[float]]]:
    """Return where each body is, in rows from the top: its extent in x and in y."""
    columns = min(count, COLUMNS)
    rows = -(-count // columns)
    return [([k % columns / columns, (k % columns + 1) / columns],
             [1 - (k // columns + 1) / rows, 1 - k // columns / rows]) for k in range(count)]  # fmt: skip


def _over(mesh: lobes.Mesh, peak: float) -> lobes.Mesh:
    return mesh._replace(value=mesh.value / peak)


def _at(mesh: lobes.Mesh, low: int | None) -> dict[str, np.ndarray]:
    """Return the coordinates of values; ``low`` is the decade in the middle of a logarithmic radius."""
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = mesh.value if low is None else np.maximum(np.log10(mesh.value) - low, 0)
    x, y, z = np.moveaxis((mesh.wo * radius[..., None]).astype(np.float32), -1, 0)
    return {"x": x, "y": y, "z": z}


def _lines(wi: np.ndarray, reach: float) -> list[dict[str, Any]]:
    """Return the traces of wi, its mirror image and the surface."""
    turn = np.linspace(0, 2 * np.pi, 181)
    circle = 0.7 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    lines = []
    for name, points, look in (
        ("ω<sub>i</sub>", np.outer([0, 1], wi), {"color": INK, "width": 4}),
        ("mirror", np.outer([0, 1], wi * [-1, -1, 1]), {"color": INK, "width": 4, "dash": "dot"}),
        ("surface", circle, {"color": FAINT, "width": 3}),
    ):
        x, y, z = (reach * points).T.astype(np.float32)
        lines.append({"type": "scatter3d", "mode": "lines", "name": name, "x": x, "y": y, "z": z, "line": look})
    return lines


def _eye(azimuth: float, distance: float) -> dict[str, float]:
    """Return the position of a camera that sees wi on the left."""
    x, y = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    return {"x": -distance * y, "y": distance * x, "z": 0.48 * distance}
