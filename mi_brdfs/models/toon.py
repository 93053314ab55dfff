from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe
from ..lobes.diffuse import ZonalLobe
from ..lobes.power import AxisFrame
from ..math import EPSILON, TINY, Spectrum, choose, leaving, safe_sqrt
from ..model import Model, Values
from ..parameters import Choice, Number, Reflectance


class Toon(Model):
    """Cartoon shading in two bands, with soft edges and a highlight.

    A. Lake, C. Marshall, M. Harris and M. Blackstein, Stylized rendering techniques for scalable real-time 3D
    animation, NPAR 2000, doi:10.1145/340916.340918.

        f cosθ_o = ρd/Zd (b + (1-b) S(cosθ_o; td, sd)) + ρs/Zs S(r·wo; ts, ss),    r = 2 (n·wi) n - wi
        S(c; t, s) = 3x² - 2x³,    x = min(max((c - t + s)/2s, 0), 1)

    with S a step in the cosine c, from 0 at t-s to 1 at t+s, and r the mirror direction. A point is fully lit where its
    normal is within acos td of the light, lit by the fraction b from there to 90°, and shows a highlight where the
    mirror direction is within acos ts of the light. Large lamps blur the edges: use points, or the sun. The bands are
    from the paper, which looks them up in a texture of cosθ_o; the formula is this plugin's. It stands for the whole
    response to a light, cosine included. ``normalization`` chooses the scale:

    * energy: Z is 2π times the integral of the band over the cosines from 0 to 1. The albedo of the diffuse lobe is ρd.
      That of the specular lobe is ρs unless the horizon clips the highlight, and falls to about half of that at grazing
      angles. A lobe whose band is empty (t = 1 and s = b = 0) is black.
    * none: Z = π, the shading formula: each band is as bright as Lambert's model under a light straight above. The
      albedo is 2ρd times the integral of the band, and for the specular lobe at most 2ρs times that of its own: ρd and
      0.2 ρs for the defaults, up to 2ρd and 2ρs for bands as wide as the hemisphere.

    Not reciprocal: f diverges like 1/cosθ_o at grazing angles. Energy-conserving for ``energy`` with ρd + ρs <= 1.
    One-sided. Depolarises.

    Sampling: the inverse cumulative distributions of the cosines, and the azimuths about r that lie above the horizon.
    The weight of the diffuse lobe is its albedo, that of the specular lobe between half its largest albedo and all of
    it; no sample falls below the horizon.

    Example
    -------
    {"type": "toon", "diffuse_reflectance": {"type": "rgb", "value": [0.6, 0.15, 0.1]}, "diffuse_shadow": 0.3}
    """

    family = "cartoon"

    diffuse_reflectance = Reflectance(0.5, "scale ρd of the diffuse lobe; its albedo for energy", role="diffuse")
    diffuse_threshold = Number(0.5, (0, 1), "cosine td at which the lit band ends")
    diffuse_smooth = Number(0.05, (0, 1), "half width sd of its edge, in the cosine; 0 is hard")
    diffuse_shadow = Number(0, (0, 1), "brightness b of the dark band, relative to the lit one")
    specular_reflectance = Reflectance(
        0.2, "scale ρs of the specular lobe; its largest albedo for energy", role="specular"
    )
    specular_threshold = Number(0.9, (0, 1), "cosine ts at which the highlight ends")
    specular_smooth = Number(0.02, (0, 1), "half width ss of its edge, in the cosine; 0 is hard")
    normalization = Choice(("energy", "none"), "scale Z")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        lit, highlight = Step(p.diffuse_threshold, p.diffuse_smooth), Step(p.specular_threshold, p.specular_smooth)
        dark = p.diffuse_shadow
        mass = dark + (1 - dark) * lit.mass
        return (
            BandsLobe(self._albedo(p.diffuse_reflectance, mass), lit, dark, mass),
            HighlightLobe(p.specular_reflectance, self._albedo(1, highlight.mass), highlight),
        )

    def _albedo(self, reflectance: Spectrum, mass: mi.Float) -> Spectrum:
        """Return the albedo of a band whose integral over the cosines is ``mass``."""
        return reflectance * (2 * mass if self.normalization == "none" else dr.select(mass > EMPTY, 1.0, 0.0))


EMPTY = 1e-12
"""The integral up to which a band counts as empty; the narrowest one that float32 resolves has more."""


class Step:
    """S, also as a density of the cosine on [0, 1], where its integral is ``mass``. To keep the digits of narrow bands,
    it uses the *excess* of a cosine over the threshold.
    """

    START = 0.1, 0.28
    """Of the search for a quantile; tests/calibration/toon.py fits it."""

    def __init__(self, threshold: mi.Float, smooth: mi.Float) -> None:
        self.threshold, self.smooth = threshold, smooth
        self.start = self._integral(-threshold)
        # An empty band has the derivative of a narrow one, so that an optimisation leaves it.
        self.mass = self._integral(1 - threshold + EPSILON) - self.start

    @staticmethod
    def _x(smooth: mi.Float, excess: mi.Float) -> mi.Float:
        # The floor turns an edge of width 0 into a jump, which is dark itself.
        return dr.clip((excess + smooth) / (2 * dr.maximum(smooth, EPSILON)), 0, 1)

    def _integral(self, excess: mi.Float) -> mi.Float:
        """Return the integral of S up to ``excess``; where S is 1 this is ``excess`` itself."""

        def integral(smooth: mi.Float) -> mi.Float:
            x = self._x(smooth, excess)
            return 2 * smooth * x * x * x * (1 - 0.5 * x) + dr.maximum(excess - smooth, 0)

        return leaving(0, 0.1, integral, self.smooth)

    def eval(self, excess: mi.Float) -> mi.Float:
        def height(smooth: mi.Float) -> mi.Float:
            x = self._x(smooth, excess)
            return x * x * (3 - 2 * x)

        return leaving(0, 0.1, height, self.smooth)

    def sample(self, u: mi.Float) -> mi.Float:
        """Return the excess of the cosine below which the fraction ``u`` of the density lies."""
        integral = self.start + u * self.mass
        ramp = integral < self.smooth
        # x³ (1 - x/2) = y: a fit accurate to 1 %, and to 1e-9 after two Newton steps.
        y = dr.select(ramp, integral / (2 * dr.maximum(self.smooth, TINY)), 0.5)
        root = dr.cbrt(y)
        x = root * (1 + root * (self.START[0] + self.START[1] * root))
        for _ in range(2):
            x2 = dr.maximum(x * x, TINY)
            x = x - (x * x2 * (1 - 0.5 * x) - y) / (x2 * (3 - 2 * x))
        return dr.select(ramp, self.smooth * (2 * x - 1), integral)


class BandsLobe(ZonalLobe):
    """p ∝ b + (1-b) S, the lit band and the dark one; ``mass`` is their integral."""

    reciprocal = False

    def __init__(self, reflected: Spectrum, lit: Step, dark: mi.Float, mass: mi.Float) -> None:
        self.reflected, self.lit, self.dark, self.mass = reflected, lit, dark, dr.maximum(mass, EMPTY)

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.reflected

    def density(self, cos: mi.Float) -> mi.Float:
        return (self.dark + (1 - self.dark) * self.lit.eval(cos - self.lit.threshold)) / self.mass

    def cosine(self, u: mi.Float) -> mi.Float:
        everywhere, u = choose(u, self.dark / self.mass)
        return dr.select(everywhere, u, dr.clip(self.lit.threshold + self.lit.sample(u), 0, 1))


class HighlightLobe(Lobe):
    """f cosθ_o ∝ S(A) above the horizon, with A the cosine to the mirror direction.

    Draw A > 0 ∝ S, and then an azimuth above the horizon. Where S extends beyond A = 0, the ring of -A takes its share
    of the samples: it is above the horizon where the ring of A, its antipodes, is below.
    """

    reciprocal = False

    def __init__(self, colour: Spectrum, scale: Spectrum, step: Step) -> None:
        self.colour, self.reflected, self.step = colour, colour * scale, step
        self.mass = dr.maximum(step.mass, EMPTY)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return self.colour

    def _frame(self, wi: mi.Vector3f) -> AxisFrame:
        return AxisFrame(mi.Vector3f(-wi.x, -wi.y, wi.z))

    def _ring(self, frame: AxisFrame, versine: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return ``(sinθ_ring, visible)``, with the fraction of the ring at A = 1 - versine >= 0 above the horizon."""
        sin = safe_sqrt(versine * (2 - versine))
        rise, height = frame.sin * sin, frame.axis.z * (1 - versine)
        below = dr.atan2(safe_sqrt((rise - height) * (rise + height)), height) * dr.inv_pi
        return sin, 1 - below

    def _pair(self, excess: mi.Float, visible: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return what the visible parts of the rings of A and -A reflect, from the excess of A."""
        behind = -2 * self.step.threshold - excess
        return self.step.eval(excess) * visible, self.step.eval(behind) * (1 - visible)

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        # The ring that halves the highlight's solid angle represents all rings.
        return self.reflected * self._ring(self._frame(wi), 0.5 * dr.minimum(self.mass, 1))[1]

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        frame, t = self._frame(wi), self.step.threshold
        # The versine keeps the digits of a small highlight, the cosine those of a wide one. Subtract the squares one by
        # one, as rounding errors shrink with the remainder.
        away = wo - frame.axis
        cos, versine, excess = dr.dot(wo, frame.axis), 0.5 * dr.squared_norm(away), 1 - t
        for d in (away.x, away.y, away.z):
            excess = dr.fma(-0.5 * d, d, excess)
        excess = dr.select(versine < 0.25, excess, cos - t)
        nearer = dr.maximum(excess, -2 * t - excess)
        _, visible = self._ring(frame, dr.minimum(versine, 2 - versine))
        front, back = self._pair(nearer, visible)
        value = self.step.eval(excess) / (dr.two_pi * self.mass)
        return self.reflected * value, value * self.step.eval(nearer) / dr.maximum(front + back, EPSILON)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        frame, excess = self._frame(wi), self.step.sample(v.x)
        versine = dr.clip(1 - self.step.threshold - excess, 0, 1)
        sin, visible = self._ring(frame, versine)
        front, back = self._pair(excess, visible)
        behind = u * (front + back) < back
        cos = dr.select(behind, versine - 1, 1 - versine)
        sin_phi, cos_phi = dr.sincos(dr.pi * dr.select(behind, 1 - visible, visible) * (2 * v.y - 1))
        return frame.axis * cos + frame.up * (sin * cos_phi) + frame.side * (sin * sin_phi)
