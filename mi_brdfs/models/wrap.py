from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe
from ..lobes.diffuse import ZonalLobe
from ..math import TINY, Spectrum
from ..model import Model, Values
from ..parameters import Choice, Number, Reflectance


class Wrap(Model):
    """Wrapped diffuse reflection, best known as Valve's half-Lambert (1998).

    J. Mitchell, G. McTaggart and C. Green, Shading in Valve's Source Engine, SIGGRAPH 2006 course notes,
    doi:10.1145/1185657.1185832. P.-P. Sloan, D. Nowrouzezahrai and H. Yuan, Wrap shading, Journal of Graphics, GPU, and
    Game Tools, 2011. S. McAuley, Extension to energy-conserving wrapped diffuse, 2013,
    http://blog.stevemcauley.com/2013/01/30/extension-to-energy-conserving-wrapped-diffuse/.

        f |cosθ_o| = ρ/Z ((cosθ_o + w)/(1 + w))ⁿ,    cosθ_o > -w

    The shading reaches past the terminator, to cosθ_o = -w. The formula stands for the whole response to a light,
    cosine included. (w, n) = (0, 1) is Lambert's model, (1, 2) the half-Lambert. ``domain`` chooses the light that
    counts:

    * hemisphere: light from the front. It cannot light surfaces that face away, so only the flatter shading of the look
      in games remains, and the terminator does not move.
    * sphere: also light from behind, as if through a thin sheet, in a second, transmitting lobe. It is visible on open
      surfaces only: the rest of a closed body shadows the light.

    ``normalization`` chooses the scale:

    * energy: the integral of the power, 2π (1+w)/(n+1) on the sphere (McAuley), and on the hemisphere
      1 - (w/(1+w))ⁿ⁺¹ times that. The albedo, of both lobes together, is ρ.
    * none: Z = π, the shading formula. The albedo is 2ρ (1+w)/(n+1) on the sphere, and on the hemisphere
      1 - (w/(1+w))ⁿ⁺¹ times that: 4/3 ρ and 7/6 ρ for the half-Lambert, up to 4ρ and 2ρ for n = 0.

    Not reciprocal, except for (0, 1): f diverges like 1/cosθ_o at grazing angles. Energy-conserving for ``energy``.
    One-sided: visible from the front only, also on the sphere, which ``twosided`` refuses. Depolarises.

    Sampling: the inverse cumulative distribution of the cosine, so that every weight is the albedo.

    Example
    -------
    {"type": "wrap", "reflectance": {"type": "rgb", "value": [0.6, 0.35, 0.2]}, "wrap": 0.5, "domain": "sphere"}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "albedo ρ")
    wrap = Number(1, (0, 1), "w: how far behind the terminator the light reaches, as a cosine")
    exponent = Number(2, (0, 100), "exponent n: the higher, the darker the terminator")
    domain = Choice(("hemisphere", "sphere"), "the light that counts")
    normalization = Choice(("energy", "none"), "scale Z")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        w, n = p.wrap, p.exponent
        behind = _power(w / (1 + w), n + 1)
        whole = p.reflectance
        if self.normalization == "none":
            whole = whole * (2 * (1 + w) / (n + 1))
            front = whole * (1 - behind)
        else:
            front = whole if self.domain == "hemisphere" else whole * (1 - behind)
        if self.domain == "hemisphere":
            return (FrontLobe(front, w, n, behind),)
        return FrontLobe(front, w, n, behind), BackLobe(whole * behind, w, n)


def _power(x: mi.Float, exponent: mi.Float) -> mi.Float:
    """Return x^exponent for x >= 0, with a derivative at 0."""
    return dr.power(x + TINY, exponent)


class WrapLobe(ZonalLobe):
    reciprocal = False

    def __init__(self, reflected: Spectrum, wrap: mi.Float, exponent: mi.Float) -> None:
        self.reflected, self.wrap, self.exponent = reflected, wrap, exponent

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.reflected


class FrontLobe(WrapLobe):
    """p ∝ (μ + w)ⁿ for μ > 0; ``behind`` is the fraction of the integral over μ > -w that this leaves out."""

    def __init__(self, reflected: Spectrum, wrap: mi.Float, exponent: mi.Float, behind: mi.Float) -> None:
        super().__init__(reflected, wrap, exponent)
        self.behind = behind

    def density(self, cos: mi.Float) -> mi.Float:
        w, n = self.wrap, self.exponent
        return (n + 1) / ((1 + w) * (1 - self.behind)) * _power((cos + w) / (1 + w), n)

    def cosine(self, u: mi.Float) -> mi.Float:
        w, n = self.wrap, self.exponent
        return (1 + w) * dr.power(self.behind + u * (1 - self.behind), 1 / (n + 1)) - w


class BackLobe(WrapLobe):
    """p ∝ (μ + w)ⁿ for -w < μ < 0."""

    transmits = True

    def density(self, cos: mi.Float) -> mi.Float:
        w, n = dr.maximum(self.wrap, 1e-6), self.exponent  # without one there is no such light
        x = 1 + cos / w
        return dr.select(x > 0, (n + 1) / w * _power(dr.maximum(x, 0), n), 0)

    def cosine(self, u: mi.Float) -> mi.Float:
        return self.wrap * (dr.power(u, 1 / (self.exponent + 1)) - 1)
