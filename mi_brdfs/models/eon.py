from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe
from ..lobes.diffuse import RoughDiffuseLobe
from ..math import Spectrum, sin_theta
from ..model import Model, Values
from ..parameters import Number, Reflectance


class EON(Model):
    """The energy-preserving Oren-Nayar model of Portsmouth, Kutz and Hill (2025).

    J. Portsmouth, P. Kutz and S. Hill, EON: A practical energy-preserving rough diffuse BRDF, Journal of Computer
    Graphics Techniques 14(1), 2025, https://jcgt.org/published/0014/01/06/.

        f = ρ/π A (1 + r s/t) + ρ_ms/π (1-E(θ_i)) (1-E(θ_o)) / (1-Ē)
        s = sinθ_i sinθ_o cosφ,    t = max(cosθ_i, cosθ_o) for s > 0, and else 1
        A = 1/(1 + r c),    Ē = A (1 + r (2/3 - 28/(15π))),    ρ_ms = ρ² Ē/(1 - ρ (1-Ē))
        1-E(θ) = A r (c μ²/(1+S) + S/π (π/2 - θ - μ³ (2+S)/(3 (1+S)²)))

    with φ the azimuth between wi and wo, r the roughness, c = 1/2 - 2/(3π), μ = cosθ and S = sinθ. E is the albedo of
    the first term for ρ = 1. That term is Fujii's variant of Oren and Nayar's qualitative model; the second returns the
    light that the first loses, after several reflections. r = 0 is Lambert's model.

    Reciprocal. Energy-conserving: the albedo is ρ E + ρ_ms (1-E), and 1 in all directions for ρ = 1. E is exact here;
    the paper also has a polynomial fit. One-sided. Depolarises.

    Sampling: a clipped linearly transformed cosine in a mixture with uniform directions, as in the paper
    (mi_brdfs.lobes.diffuse.RoughDiffuseLobe); no sample falls below the horizon.

    Example
    -------
    {"type": "eon", "reflectance": {"type": "rgb", "value": [0.6, 0.35, 0.2]}, "roughness": 0.8}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "albedo ρ of the facets")
    roughness = Number(0.5, (0, 1), "roughness r")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        return (EONLobe(p.reflectance, p.roughness),)


class EONLobe(RoughDiffuseLobe):
    # The loss (1 - E)/(A r) at normal incidence, and its mean.
    NORMAL = 1 / 2 - 2 / (3 * math.pi)
    MEAN = NORMAL - (2 / 3 - 28 / (15 * math.pi))

    def __init__(self, reflectance: Spectrum, roughness: mi.Float) -> None:
        super().__init__(reflectance, roughness)
        self.a = 1 / (1 + self.NORMAL * roughness)
        mean_loss = self.a * roughness * self.MEAN
        self.multiple = dr.square(reflectance) * (1 - mean_loss) / (1 - reflectance * mean_loss)

    def _loss(self, w: mi.Vector3f) -> mi.Float:
        """Return (1 - E)/(A r), arranged so that nothing cancels at grazing angles, where it vanishes."""
        cos, sin = w.z, sin_theta(w)
        cos2 = cos * cos
        rise = dr.atan2(cos, sin) - cos * cos2 * (2 + sin) / (3 * dr.square(1 + sin))
        return self.NORMAL * cos2 / (1 + sin) + dr.inv_pi * sin * rise

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        loss = self.a * self.retro * self._loss(wi)
        return self.reflectance * (1 - loss) + self.multiple * loss

    def eval(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Float:
        s = wi.x * wo.x + wi.y * wo.y
        s = dr.maximum(s / dr.select(s > 0, dr.maximum(wi.z, wo.z), 1), -1)
        single = self.reflectance * (self.a * (1 + self.retro * s))
        multiple = self.multiple * (self.a * self.retro * self._loss(wi) * self._loss(wo) / self.MEAN)
        return dr.inv_pi * (single + multiple)
