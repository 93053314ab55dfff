"""A BSDF under test: called with NumPy arrays, part by part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

AZIMUTH_STEP = 137.5
"""In degrees: each incident direction has an azimuth of its own, so that what is turned wrongly shows."""
SCATTERED = 1 << 15
STEEPEST = 88.5
"""The angles of scattered directions end here, in degrees: nearer to grazing, float32 knows little of a cosine."""
CENTRE = 0.4, 0.3
"""The texture coordinates of what is looked at, except by the check of textures."""


class Part(NamedTuple):
    """The whole BSDF (of which delta functions are not evaluated) or one of its components."""

    name: str
    context: Any
    component: int | None
    flags: int
    sides: tuple[int, ...]
    """The sides that it is seen from: 1 for the front, -1 for the back."""

    def has(self, flag) -> bool:
        return bool(self.flags & int(flag))


class Incident(NamedTuple):
    """A direction of incidence, float32 and of length one to its precision; or many, of shape (N, 3)."""

    name: str
    wi: np.ndarray

    def at(self, lanes) -> np.ndarray:
        """The directions of some lanes, shape (3,) if they have all the same."""
        return self.wi if self.wi.ndim == 1 else np.ascontiguousarray(self.wi[lanes])

    def of(self, lane: int) -> str:
        """The direction of a lane in words."""
        return self.name if self.wi.ndim == 1 else angles_of(self.wi[lane])


class Samples(NamedTuple):
    """What ``sample`` returned, and ``eval`` and ``pdf`` of the same directions."""

    wo: np.ndarray
    weight: np.ndarray
    density: np.ndarray
    """The density that ``sample`` says."""
    component: np.ndarray
    kind: np.ndarray
    eta: np.ndarray
    value: np.ndarray
    pdf: np.ndarray
    smooth: np.ndarray
    """Which of them are none of a delta function."""

    @property
    def lit(self) -> np.ndarray:
        """Which of them carry light, and not that of a delta function."""
        return self.weight.any(axis=1) & self.smooth

    @property
    def drawn(self) -> np.ndarray:
        """Which of them carry light or may be black ones, drawn where f = 0. A sampler may also reject a direction by a
        weight of zero, and leave anything in the other fields: so a black sample must have f = 0 and the density that
        ``pdf`` says."""
        black = ~self.value.any(axis=1) & (self.pdf > 0) & self.smooth
        return self.lit | (black & (abs(self.density - self.pdf) < 0.01 * self.pdf))


@dataclass
class Subject:
    """A BSDF with its parts and the directions it is looked at from."""

    bsdf: Any
    angles: tuple[float, ...]

    @cached_property
    def components(self) -> list[Part]:
        """The components that are no delta functions."""
        bsdf = self.bsdf
        parts = []
        for k in range(bsdf.component_count()):
            flags = int(bsdf.flags(k))
            if flags & int(mi.BSDFFlags.Smooth):
                name = f"component {k}" if bsdf.component_count() > 1 else "whole"
                parts.append(Part(name, context(component=k), k, flags, _sides(flags)))
        return parts

    @cached_property
    def deltas(self) -> list[int]:
        """The components that are delta functions."""
        smooth = [part.component for part in self.components]
        return [k for k in range(self.bsdf.component_count()) if k not in smooth]

    @cached_property
    def whole(self) -> Part:
        """Seen from wherever one of its components is, also if that is a delta function."""
        flags = 0
        for part in self.components:
            flags |= part.flags
        return Part("whole", context(), None, flags, _sides(int(self.bsdf.flags())))

    @cached_property
    def parts(self) -> list[Part]:
        """The whole, and each component if there are several."""
        if not self.components:
            return []
        return [self.whole, *(self.components if self.bsdf.component_count() > 1 else [])]

    def incidents(self, part: Part) -> list[Incident]:
        """The directions that a part is looked at from."""
        return [
            Incident(_named(theta, side), on_side(direction(theta, AZIMUTH_STEP * k), side))
            for side in part.sides
            for k, theta in enumerate(self.angles)
        ]

    def views(self, part: Part) -> list[Incident]:
        """The same, and directions all over the sides that it is seen from, which find what is wrong at some angles
        or azimuths only."""
        return [*self.incidents(part), Incident("all directions", scattered(SCATTERED, 41, part.sides))]

    # --- Calls ------------------------------------------------------------------------------------------------------

    def eval(self, part: Part, wi, wo, uv=CENTRE) -> np.ndarray:
        """f |cosθ_o|, shape (N, channels)."""
        return numbers(self.bsdf.eval(part.context, interaction(wi, uv), vectors(wo), True), len(wo))

    def pdf(self, part: Part, wi, wo, uv=CENTRE) -> np.ndarray:
        """The density of ``wo``, shape (N,)."""
        return numbers(self.bsdf.pdf(part.context, interaction(wi, uv), vectors(wo), True), len(wo))[:, 0]

    def reflectance(self, wi, uv=CENTRE) -> np.ndarray:
        """``eval_diffuse_reflectance``, shape (N, channels); black if it is not implemented."""
        try:
            return numbers(self.bsdf.eval_diffuse_reflectance(interaction(wi, uv), True), len(wi))
        except RuntimeError:
            return np.zeros((len(wi), 1))

    def eval_pdf(self, part: Part, wi, wo) -> tuple[np.ndarray, np.ndarray]:
        value, pdf = self.bsdf.eval_pdf(part.context, interaction(wi), vectors(wo), True)
        return numbers(value, len(wo)), numbers(pdf, len(wo))[:, 0]

    def eval_pdf_sample(self, part: Part, wi, wo, variates) -> tuple[np.ndarray, ...]:
        """``(value, pdf, wo, density, weight)``."""
        u, v = variates_of(variates)
        value, pdf, bs, weight = self.bsdf.eval_pdf_sample(part.context, interaction(wi), vectors(wo), u, v, True)
        count = len(variates)
        value, pdf, sampled, density, weight = (numbers(x, count) for x in (value, pdf, bs.wo, bs.pdf, weight))
        return value, pdf[:, 0], sampled, density[:, 0], weight

    def sample(self, part: Part, wi, variates, uv=CENTRE) -> Samples:
        si, (u, v), count = interaction(wi, uv), variates_of(variates), len(variates)
        bs, weight = self.bsdf.sample(part.context, si, u, v, True)
        drawn = bs.pdf > 0
        wo = dr.select(drawn, bs.wo, mi.Vector3f(0, 0, 1))
        value, pdf = self.bsdf.eval(part.context, si, wo, True), self.bsdf.pdf(part.context, si, wo, True)
        kind, density = bs.sampled_type, dr.select(drawn, pdf, 0)
        fields = (wo, weight, bs.pdf, bs.sampled_component, kind, bs.eta, value, density, self.is_smooth(bs))
        dr.eval(fields)
        wo, weight, density, component, kind, eta, value, pdf, smooth = (numbers(field, count) for field in fields)
        single = (x[:, 0] for x in (density, component, kind, eta))
        return Samples(wo.astype(np.float32), weight, *single, value, pdf[:, 0], smooth[:, 0] > 0)

    def is_smooth(self, bs):
        """Whether a sample is none of a delta function."""
        return (bs.sampled_type & int(mi.BSDFFlags.Smooth)) != 0 if self.deltas else mi.Bool(True)

    # --- The width of a part ----------------------------------------------------------------------------------------

    def spread(self, part: Part) -> float:
        """How narrow a part is, in radians: half of the samples for light from 30° lie within this angle of another
        sample's direction, the one that has most of them around it. Half, that is, of a lobe without long tails: it is
        four times the angle for a twentieth of them. Of the whole, that of its narrowest component counts."""
        if part.component is None and len(self.components) > 1:
            return min(self.spread(each) for each in self.components)
        if part.name not in self._spreads:
            samples = self.sample(part, on_side(direction(30), part.sides[0]), random(1 << 12, 1))
            wo = samples.wo[samples.drawn].astype(np.float64)
            if len(wo) < 64:
                return np.pi
            apart = np.linalg.norm(wo[:64, None] - wo[None], axis=-1)
            near = np.quantile(apart, 0.05, axis=1).min()
            self._spreads[part.name] = float(4 * 2 * np.arcsin(min(near / 2, 1)))
        return self._spreads[part.name]

    @cached_property
    def _spreads(self) -> dict[str, float]:
        return {}

    def rounding(self, part: Part) -> float:
        """The relative error that float32 may make in f and in the density. A direction is known to 6e-8, a half
        vector to about 1e-7, and a lobe of the width σ changes by some of them over σ: in its tails by ten."""
        return 1e-4 + 3e-6 / max(self.spread(part), 1e-6)


# --- Helpers --------------------------------------------------------------------------------------------------------


def direction(theta: float, phi: float = 0) -> np.ndarray:
    """The float32 unit vector at these angles, in degrees."""
    theta, phi = np.radians([theta, phi])
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], np.float32)


def on_side(w, side: int) -> np.ndarray:
    """Directions above the horizon, or for a side of -1 their mirror images below."""
    return w * np.float32([1, 1, side])


def random(count: int, seed: int) -> np.ndarray:
    """Uniform variates of shape (count, 3)."""
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32)


def hemisphere(count: int, seed: int) -> np.ndarray:
    """Uniform directions above the horizon, by at least a hundredth of a radian."""
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(0.01, 1, count), rng.uniform(0, 2 * np.pi, count)
    sin = np.sqrt(1 - z * z)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), z], axis=-1).astype(np.float32)


def scattered(count: int, seed: int, sides: tuple[int, ...]) -> np.ndarray:
    """Directions of which angles and azimuths, in degrees, fill their ranges evenly, on some sides in turn."""
    jitter = np.random.default_rng(seed).random((2, count))
    lane = np.arange(count)
    theta = STEEPEST * (lane + jitter[0]) / count
    # The golden ratio spreads the azimuths of any interval of angles.
    phi = 2 * np.pi * ((lane * 0.6180339887498949 + 0.3 * jitter[1]) % 1)
    sin = np.sin(np.radians(theta))
    w = np.stack([sin * np.cos(phi), sin * np.sin(phi), np.cos(np.radians(theta))], axis=-1).astype(np.float32)
    w[:, 2] *= np.resize(sides, count)
    return w


def angles_of(w) -> str:
    """A direction in words."""
    theta = np.degrees(np.arctan2(np.hypot(w[0], w[1]), w[2]))
    return f"θ = {theta:.4g}°, φ = {np.degrees(np.arctan2(w[1], w[0])):.4g}°"


def interaction(wi, uv=CENTRE):
    """A surface interaction for one direction of the local frame, or for an array of shape (N, 3); ``uv`` is a pair or
    an array of shape (N, 2)."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = vectors(wi)
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    si.uv = mi.Point2f(uv) if np.ndim(uv) == 1 else mi.Point2f(np.ascontiguousarray(np.float32(uv).T))
    if mi.is_spectral:
        si.wavelengths = mi.UnpolarizedSpectrum(450, 520, 580, 640)
    return si


def vectors(w):
    """Directions of shape (3,) or (N, 3) as a vector that Dr.Jit compiles no new kernel for."""
    result = mi.Vector3f(np.ascontiguousarray(np.asarray(w, np.float32).T))
    dr.make_opaque(result)
    return result


def numbers(value, count: int) -> np.ndarray:
    """A float, vector or spectrum as floats of shape (count, channels)."""
    array = np.array(value, np.float64)
    array = array.reshape(1, -1) if array.ndim < 2 else array
    return np.broadcast_to(array, (len(array), count)).T


def brightness(colours: np.ndarray) -> np.ndarray:
    """The luminance of rgb colours, and the mean of others."""
    return colours @ [0.212671, 0.715160, 0.072169] if colours.shape[1] == 3 else colours.mean(axis=1)


def context(component=None, mask=None):
    """A BSDF context, of one component or of some types if they are given."""
    result = mi.BSDFContext()
    if component is not None:
        result.component = component
    if mask is not None:
        result.type_mask = mask
    return result


def variates_of(variates):
    """Rows of three uniform variates as ``sample`` takes them."""
    u, v = mi.Float(variates[:, 0].copy()), mi.Point2f(np.ascontiguousarray(variates[:, 1:].T))
    return u, v


def _sides(flags: int) -> tuple[int, ...]:
    front, back = (bool(flags & int(flag)) for flag in (mi.BSDFFlags.FrontSide, mi.BSDFFlags.BackSide))
    return tuple(side for side, seen in ((1, front or not back), (-1, back)) if seen)


def _named(theta: float, side: int) -> str:
    return f"{theta:g}°" if side > 0 else f"{theta:g}° behind"
