from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe
from ..lobes.diffuse import ZonalLobe
from ..math import Spectrum, safe_sqrt
from ..model import Model, Values
from ..parameters import Choice, Number, Reflectance


class Minnaert(Model):
    """Minnaert's reflection (1941), known from the Moon.

    M. Minnaert, The reciprocity principle in lunar photometry, Astrophysical Journal 93, 1941, doi:10.1086/144279.

        f = ρ (k+1)/(2π) (cosθ_i cosθ_o)^(k-1)

    k = 1 is Lambert's model; for larger k surfaces darken towards their limb, for smaller k they brighten.
    ``normalization`` chooses the form:

    * energy: as above for k >= 1. For k < 1 it would diverge at grazing angles, and is held below a cosine of 0.1:
      f = ρ (k+1)/(2π) (m_i m_o/0.1)^(k-1), where m = max(cosθ, 0.1). The albedo rises from about 10^(k-1) ρ at normal
      incidence to at most ρ: 0.31 ρ and 0.99 ρ for k = 0.5.
    * published: as above for all k. The albedo is ρ cosθ_i^(k-1): for k = 0.5 it is 1.41 ρ at 60° and 7.6 ρ at 89°.
    * none: f cosθ_o = ρ/π (cosθ_i cosθ_o)^k, the shading formula; not reciprocal. The albedo is
      2ρ/(k+1) cosθ_i^k, up to 2ρ.

    Reciprocal, except for ``none``. Energy-conserving for k >= 1, and for ``energy`` at any k. The paper is about the
    exponents; the factor (k+1)/2π is common usage, and could not be compared with it. One-sided. Depolarises.

    Sampling: the inverse cumulative distribution of the cosine, so that every weight is the albedo.

    Example
    -------
    {"type": "minnaert", "reflectance": {"type": "rgb", "value": [0.3, 0.28, 0.25]}, "exponent": 0.7}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "scale ρ; for k >= 1 the albedo at normal incidence")
    exponent = Number(1.5, (0, 100), "exponent k: above 1 the limb darkens, below it brightens")
    normalization = Choice(("energy", "published", "none"), "the form at grazing angles")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        return (MinnaertLobe(p.reflectance, p.exponent, self.normalization),)


class MinnaertLobe(ZonalLobe):
    """p ∝ μ max(μ, c)^(k-1), where c is 0.1 for ``energy`` and k < 1, and 0 otherwise."""

    HELD = 0.1

    def __init__(self, reflectance: Spectrum, exponent: mi.Float, normalization: str) -> None:
        self.reflectance, self.exponent, self.normalization = reflectance, exponent, normalization
        self.reciprocal = normalization != "none"
        self.held = exponent < 1 if normalization == "energy" else False
        # The integral over [0, c] of p for c = 0, and of what holding it removes.
        self.mass = dr.select(self.held, dr.exp(math.log(self.HELD) * (exponent + 1)), 0)
        self.lost = 0.5 * (1 - exponent) * self.mass

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        mu, k = wi.z, self.exponent
        if self.normalization == "none":
            return self.reflectance * (2 / (k + 1) * dr.power(mu, k))
        mu = dr.select(self.held, dr.maximum(mu / self.HELD, 1), mu)
        return self.reflectance * ((1 - self.lost) * dr.power(mu, k - 1))

    def density(self, cos: mi.Float) -> mi.Float:
        k = self.exponent
        base = dr.maximum(cos, dr.select(self.held, self.HELD, 0))
        return (k + 1) / (1 - self.lost) * cos * dr.power(base, k - 1)

    def cosine(self, u: mi.Float) -> mi.Float:
        k, u = self.exponent, u * (1 - self.lost)
        below = u < 0.5 * (k + 1) * self.mass
        inside = self.HELD * safe_sqrt(2 * u / ((k + 1) * dr.select(below, self.mass, 1)))
        return dr.select(below, inside, dr.power(u + self.lost, 1 / (k + 1)))
