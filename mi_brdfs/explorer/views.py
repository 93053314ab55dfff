"""The views of one subject, as the frames that a page draws. The plugin itself is asked, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from ..measured import Grid, Samples
from ..measured.coordinates import HalfDifference
from ..probe import curves as lobes
from ..probe.arrays import CENTRE, Array, luminance
from ..probe.bsdf import BSDFProbe, Part
from ..probe.directions import direction
from ..probe.variates import lattice, sampling_efficiency
from .state import State

Frame = str | bytes
"""A text or a binary frame of the websocket."""

PARALLELS = 40
COARSE = 16
"""The parallels of a lobe, and of one that changes under the hand."""
PIXELS = 96
"""The side of a hemisphere and of a slice, in pixels."""
LOG2_COUNT = 7
"""Samples for each angle of an albedo, 2^11 in all."""
FLATTEST = 1e-6
"""The least cosine that values are divided by."""
STEPS = 181
"""The points of a curve over θh, θd or φ, besides those where it bends."""
DOTS = 400
BINS = 48
HEAVIEST = 4.0
"""The last bin of the histogram of weights, in their mean, holds all that are heavier."""
ANGLES = (0, 10, 20, 30, 40, 50, 60, 70, 75, 80, 85, 88)
"""The angles of incidence at which the efficiency of the sampler is measured, in degrees."""


def text(**message: Any) -> str:
    """Return a message as a text frame; numbers that are none become null."""
    return json.dumps(message, allow_nan=False, default=_plain)


def packed(payload: bytes, **header: Any) -> bytes:
    """Return a binary frame: the length of the header, the header, and the payload, which begins at a multiple of 4."""
    words = json.dumps(header, default=_plain).encode()
    words += b" " * (-len(words) % 4)
    return len(words).to_bytes(4, "little") + words + payload


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [float(f"{it:.6g}") if np.isfinite(it) else None for it in value.ravel().tolist()]
    return value.item()


@dataclass
class ComponentProbe(BSDFProbe):
    """A probe whose whole is one component, where the BSDF has it, and whose values may lack the cosine."""

    component: int | None = None
    cosine: bool = True

    def eval(self, part: Part, wi: Array, wo: Array, uv: ArrayLike = CENTRE) -> Array:
        value = super().eval(part, wi, wo, uv)
        return value if self.cosine else value / np.maximum(abs(wo[:, 2:]), FLATTEST)

    @cached_property
    def whole(self) -> Part:
        found = [part for part in self.components if part.component == self.component]
        return found[0] if found else BSDFProbe(self.bsdf).whole


@dataclass
class View:
    """One kind of view: what it depends on, besides the BSDF and the component, and how it is drawn."""

    depends: Callable[[State], Any]
    content: Callable[[ComponentProbe, State], dict[str, Any]]
    """Return what goes into a frame; of a binary one, ``parts`` with their ``values``."""


def _lobe(probe: ComponentProbe, state: State) -> dict[str, Any]:
    parallels = COARSE if state.dragged else PARALLELS
    meshes = lobes.meshes(probe, state.theta, state.phi, parallels, state.channels[0][1])
    parts = [{"theta": theta, "phi": phi, "values": np.nan_to_num(value)} for theta, phi, value in meshes]
    return {"parts": parts}


def _curves(state: State, of_channel: Callable[[int | None], lobes.Curve]) -> dict[str, Any]:
    drawn = [(name, of_channel(channel)) for name, channel in state.channels]
    if state.dragged:
        drawn = [(name, _thinned(curve)) for name, curve in drawn]
    return {"curves": [{"channel": name, "x": curve.theta, "y": curve.value} for name, curve in drawn]}


def _thinned(curve: lobes.Curve) -> lobes.Curve:
    """Return every other point of a curve, and its ends and peak."""
    last, peak = len(curve.theta) - 1, int(np.argmax(np.nan_to_num(curve.value)))
    kept = np.unique([0, *range(peak % 2, last, 2), last])
    return lobes.Curve(curve.theta[kept], curve.value[kept])


def _cut(probe: ComponentProbe, state: State) -> dict[str, Any]:
    return _curves(state, lambda channel: lobes.in_plane_of_incidence(probe, state.theta, state.phi, channel))


def _albedo(probe: ComponentProbe, state: State) -> dict[str, Any]:
    return _curves(replace(state, dragged=False), lambda channel: lobes.albedo(probe, state.phi, channel, LOG2_COUNT))


def _graph(probe: ComponentProbe, state: State) -> dict[str, Any]:
    if state.axis == "theta_o":
        return _cut(probe, state)
    even = np.linspace(0, 1, STEPS)
    # Highlights, about θh = 0 and φ = 180°, may be as narrow as they like.
    near = even**3
    at = {
        "theta_h": lobes.GRAZING * near,
        "theta_d": lobes.GRAZING * even,
        "phi": 180 + 180 * np.concatenate([-near[:0:-1], near]),
    }[state.axis]

    def along(channel: int | None) -> lobes.Curve:
        return lobes.refined(lambda angles: lobes.value(probe, *_pair(state, angles), channel), at)

    return _curves(state, along)


def _pair(state: State, angles: Array) -> tuple[Array, Array]:
    """Return wi and wo at angles along the axis of a state, each of shape (N, 3)."""
    if state.axis == "phi":
        same = np.full(len(angles), state.theta)
        return direction(same, state.phi + 0 * angles).T, direction(same, state.phi + angles).T
    zero, tilt = 0 * angles, np.radians(state.phi - 90)  # of h, so that at θh = 0 wi has the azimuth φi
    theta_h, theta_d = (angles, zero + state.theta) if state.axis == "theta_h" else (zero, angles)
    return _half_difference(np.radians(theta_h), np.radians(theta_d), tilt)


def _half_difference(theta_h: Array, theta_d: Array, phi_h: float) -> tuple[Array, Array]:
    """Return wi and wo at half and difference angles in radians, for φd = 90°, each of shape (N, 3)."""
    places = np.sqrt(theta_h * 2 / np.pi), theta_d, np.full(theta_h.shape, np.pi / 2), np.full(theta_h.shape, phi_h)
    wi, wo = (np.stack([w.x, w.y, w.z], axis=-1) for w in HalfDifference(anisotropic=True).directions(*places))
    return wi.astype(np.float32), wo.astype(np.float32)


def _slice(probe: ComponentProbe, state: State) -> dict[str, Any]:
    at = (np.arange(PIXELS) + 0.5) * (np.pi / 2) / PIXELS
    theta_h, theta_d = (it.ravel() for it in np.meshgrid(at, at))
    pair = _half_difference(theta_h, theta_d, 0)
    seen = np.minimum(pair[0][:, 2], pair[1][:, 2]) > 1e-3
    wi_seen, wo_seen = (np.where(seen[:, None], w, np.array([0, 0, 1], np.float32)) for w in pair)
    f = lobes.value(replace(probe, cosine=False), wi_seen, wo_seen, state.channels[0][1])
    return {"parts": [{"width": PIXELS, "height": PIXELS, "values": np.where(seen, f, np.nan)}]}


def _hemisphere(probe: ComponentProbe, state: State) -> dict[str, Any]:
    sides = (1, -1) if lobes.transmits(probe) else (1,)
    discs = [lobes.disc(probe, state.theta, state.phi, side, PIXELS, state.channels[0][1]) for side in sides]
    return {"parts": [{"width": PIXELS, "height": PIXELS, "values": it} for it in discs]}


def _sampler(probe: ComponentProbe, state: State) -> dict[str, Any]:
    wi, points = direction(state.theta, state.phi), lattice(8, 3)
    samples = probe.sample(probe.whole, wi, points)
    weight = luminance(samples.weight)
    mean, efficiency = weight.mean(), sampling_efficiency(weight)
    counts, edges = np.histogram(np.minimum(weight / (mean or 1), HEAVIEST), BINS, (0, HEAVIEST))
    angles = np.array([direction(theta, state.phi) for theta in ANGLES])
    eta = sampling_efficiency(luminance(probe.weights(probe.whole, angles, lattice(7, 5))))
    return {
        "curves": [{"channel": "luminance", "x": np.array(ANGLES, float), "y": eta}],
        "histogram": {"edges": edges, "count": counts.tolist()},
        "dots": [[round(float(it), 4) for it in w] for w in samples.wo[samples.lit][:DOTS]],
        "efficiency": float(efficiency) if np.isfinite(efficiency) else None,
    }


def _at_wi(state: State) -> Any:
    return state.theta, state.phi, state.channel, state.cosine, state.dragged


VIEWS = {
    "lobe": View(_at_wi, _lobe),
    "polar": View(_at_wi, _cut),
    "cartesian": View(lambda state: (*_at_wi(state), state.axis), _graph),
    "albedo": View(lambda state: (state.phi, state.channel), _albedo),
    "slice": View(lambda state: state.channel, _slice),
    "hemisphere": View(lambda state: _at_wi(replace(state, dragged=False)), _hemisphere),
    "sampler": View(lambda state: (state.theta, state.phi), _sampler),
}
"""By name, in the order in which they are drawn."""


def frame(name: str, bsdf: mi.BSDF, data: Grid | Samples | None, state: State, serial: int, subject: int) -> Frame:
    """Return a view of a subject, which says nothing where measured data do not. Of its parts, the first is above the
    surface and the second below."""
    probe = ComponentProbe(bsdf, state.component, state.cosine, data=data)
    content = VIEWS[name].content(probe, state)
    values = [part.pop("values").astype("<f4") for part in content.get("parts", [])]
    for part, it in zip(content.get("parts", []), values, strict=True):
        part["size"] = it.size
    header = {"type": "view", "view": name, "serial": serial, "subject": subject, **content}
    return packed(b"".join(it.tobytes() for it in values), **header) if values else text(**header)
