"""The Plotly figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from ..measure.directions import direction
from . import lobes
from .figures import COLOURS, FAINT, INK
from .given import check_angles, named, quantity, scales_of, with_smooth_part

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


def sphere(
    *bsdfs: str | dict | mi.BSDF,
    angle: float = 45,
    azimuth: float = 0,
    scale: str = "both",
    labels: Sequence[str] | None = None,
    resolution: int = 60,
    samples: int = 400,
) -> Figure:
    """Draw the lobe as a body to turn with the mouse: the radius is the luminance of f cosθ_o, or its logarithm.

    Points are directions drawn by the BSDF's sampler; the line with a ball at its end is wi, the dotted line the mirror
    direction, the circle the surface. With the scale "both", buttons switch between the two.

    Args:
        angle: of incidence, in degrees, in [0, 90).
        resolution: the number of parallels from the normal to the horizon; more where the lobe is narrow.
        samples: the number of directions drawn.

    Everything else is as in :func:`polar`. ``figure.write_html(path)`` writes a self-contained page.

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
    values = [mesh.value for body in bodies for mesh in body]
    peak = lobes.largest(values)

    traces: list[dict[str, Any]] = []
    for name in scales:
        low, high = lobes.decades(values, peak) if name == "log" else (None, peak)
        visible = {"visible": name == scales[0], "hoverinfo": "skip", "meta": name}
        for k, it in enumerate(found):
            group = {"legendgroup": it.label, **visible}
            colour = COLOURS[k % len(COLOURS)]
            for mesh in bodies[k]:
                look = {"colorscale": [[0, colour], [1, colour]], "opacity": 1 if len(found) == 1 else 0.7}
                traces.append({"type": "surface", "name": it.label, "showlegend": mesh is bodies[k][0],
                               "showscale": False, "lighting": {"specular": 0.1}, **look, **group,
                               **_at(mesh, low)})  # fmt: skip
            traces.append({"type": "scatter3d", "mode": "markers", "name": f"{it.label}, sampled",
                           "marker": {"size": 1.8, "color": INK}, **group, **_at(points[k], low)})  # fmt: skip
        traces += [line | visible for line in _lines(wi, 1.05 * (high - (low or 0)))]

    hidden = {"visible": False}
    figure = Figure(traces)
    figure.update_layout(
        title={"text": f"{quantity('f cosθ<sub>o</sub>')}, θ<sub>i</sub> = {angle:g}°", "font": {"size": 15}},
        font={"color": INK},
        scene={"xaxis": hidden, "yaxis": hidden, "zaxis": hidden, "aspectmode": "data",
               "camera": {"eye": _eye(azimuth), "center": {"x": 0, "y": 0, "z": -0.1}}},
        legend={"itemsizing": "constant"},
        margin={"l": 0, "r": 0, "t": 50, "b": 0},
    )  # fmt: skip
    if len(scales) > 1:
        buttons = [{"label": name, "method": "restyle", "args": ["visible", [each["meta"] == name for each in traces]]}
                   for name in scales]  # fmt: skip
        figure.update_layout(updatemenus=[{"type": "buttons", "direction": "right", "buttons": buttons, "x": 0.02,
                                           "y": 1, "xanchor": "left", "yanchor": "top"}])  # fmt: skip
    return figure


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
    for name, points, look, ball in (
        ("ω<sub>i</sub>", np.outer([0, 1], wi), {"color": INK, "width": 4}, [0, 4]),
        ("mirror direction", np.outer([0, 1], wi * [-1, -1, 1]), {"color": INK, "width": 3, "dash": "dot"}, 0),
        ("surface", circle, {"color": FAINT, "width": 2}, 0),
    ):
        x, y, z = (reach * points).T
        lines.append({"type": "scatter3d", "mode": "lines+markers", "name": name, "x": x, "y": y, "z": z, "line": look,
                      "marker": {"size": ball, "color": INK}})  # fmt: skip
    return lines


def _eye(azimuth: float) -> dict[str, float]:
    """Return the position of a camera that sees wi on the left."""
    x, y = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
    return {"x": -1.5 * y, "y": 1.5 * x, "z": 0.7}
