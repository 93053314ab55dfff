from __future__ import annotations

import math

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe
from ..lobes.diffuse import RoughDiffuseLobe
from ..math import EPSILON, Spectrum, sin_theta, square
from ..model import Model, Values
from ..parameters import Choice, Flag, Number, Reflectance, Spelling


class OrenNayar(Model):
    """Oren and Nayar's rough diffuse reflection (1994).

    M. Oren and S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, doi:10.1145/192161.192213.

    The surface consists of V-cavities of Lambertian facets, whose slope angles are normally distributed with standard
    deviation σ. It looks flatter than Lambert's: brighter at the limb and towards the light, darker where light and
    viewer are above it. With α = max(θ_i, θ_o), β = min(θ_i, θ_o), φ the azimuth between wi and wo, and C1 = 1 - σ²/(2
    (σ² + 0.33)), B = 0.45 σ²/(σ² + 0.09), ``model`` chooses between the two fits of the paper:

    * qualitative: f = ρ/π (C1 + B max(0, cosφ) sinα tanβ), which leaves out interreflection.
    * full: f = ρ/π (C1 + C2 cosφ tanβ + C3 (1-|cosφ|) tan((α+β)/2)) + 0.17 ρ²/π σ²/(σ² + 0.13) (1 - cosφ (2β/π)²),
      C2 = B sinα for cosφ >= 0 and B (sinα - (2β/π)³) otherwise, C3 = 0.125 σ²/(σ² + 0.09) (4αβ/π²)². For σ > 0.66 and
      dark ρ this turns negative at grazing angles opposite the light, and is set to zero there.

    ``alpha`` = √2 σ, the roughness of a Beckmann distribution, may be given instead of σ. σ = 0 is Lambert's model.

    Reciprocal. Not quite energy-conserving: for ρ = 1 the albedo at grazing angles reaches 1.015 (qualitative, σ = 0.2)
    and 1.050 (full, σ = 0.3). Rough surfaces lose energy: the albedo at normal incidence is 0.56 and 0.72 for σ = π/2.
    ``eon`` neither gains nor loses.

    Other implementations agree on the constants, which could not be compared with the paper. One-sided. Depolarises.

    Sampling: a clipped linearly transformed cosine in a mixture with uniform directions
    (mi_brdfs.lobes.diffuse.RoughDiffuseLobe); no sample falls below the horizon.

    Example
    -------
    {"type": "orennayar", "reflectance": {"type": "rgb", "value": [0.6, 0.35, 0.2]}, "sigma": 0.5, "model": "full"}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "albedo ρ of the facets")
    sigma = Number(0.35, (0, 1.5708), "standard deviation σ of the facets' slope angle, in radians",
                   spelling=Spelling("alpha", (0, 2.2), math.sqrt(0.5), "√2 σ, as a Beckmann roughness"))  # fmt: skip
    model = Choice(("qualitative", "full"), "one of the paper's fits")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        lobe = FullLobe if self.model == "full" else QualitativeLobe
        return (lobe(p.reflectance, p.sigma),)


class RoughDiffuse(Model):
    """Oren and Nayar's rough diffuse reflection (1994) with the parameters of ``roughdiffuse`` of Mitsuba 0.6.

    M. Oren and S. K. Nayar, Generalization of Lambert's reflectance model, SIGGRAPH 1994, doi:10.1145/192161.192213.

    The same as ``orennayar``, whose page has the formulas, for σ = α/√2: the full fit or, with ``use_fast_approx``, the
    qualitative one.

    Reciprocal. Not quite energy-conserving: for ρ = 1 the albedo at grazing angles reaches 1.050 (α = 0.42), or 1.015
    (α = 0.28) with ``use_fast_approx``. One-sided. Depolarises.

    Sampling: a clipped linearly transformed cosine in a mixture with uniform directions
    (mi_brdfs.lobes.diffuse.RoughDiffuseLobe); no sample falls below the horizon.

    Example
    -------
    {"type": "roughdiffuse", "alpha": 0.4, "use_fast_approx": True}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "albedo ρ of the facets")
    alpha = Number(0.2, (0, 2.2), "roughness α of the surface, as of a Beckmann distribution")
    use_fast_approx = Flag(False, "leave out interreflection, and simplify the rest")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        lobe = QualitativeLobe if self.use_fast_approx else FullLobe
        return (lobe(p.reflectance, p.alpha * dr.inv_sqrt_two),)


class QualitativeLobe(RoughDiffuseLobe):
    """f = ρ/π (C1 + B max(0, cosφ) sinα tanβ)."""

    RETRO = 0.7  # of B/C1; fitted by tests/calibration/orennayar.py, as is that of the full form

    def __init__(self, reflectance: Spectrum, sigma: mi.Float) -> None:
        self.sigma2 = square(sigma)
        self.c1 = 1 - 0.5 * self.sigma2 / (self.sigma2 + 0.33)
        self.b = 0.45 * self.sigma2 / (self.sigma2 + 0.09)
        super().__init__(reflectance, self.RETRO * self.b / self.c1)

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        # Exact at normal and at grazing incidence.
        return self.reflectance * (self.c1 + 0.5 * self.b * (1 - wi.z * wi.z))

    def eval(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Float:
        toward = dr.maximum(wi.x * wo.x + wi.y * wo.y, 0) / dr.maximum(wi.z, wo.z)
        return self.reflectance * dr.inv_pi * (self.c1 + self.b * toward)


class FullLobe(QualitativeLobe):
    """The form with C2, C3 and interreflection, where it is positive."""

    RETRO = 1

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return super().estimated_albedo(wi) + dr.square(self.reflectance) * self._twice()

    def _twice(self) -> mi.Float:
        return 0.17 * self.sigma2 / (self.sigma2 + 0.13)

    def eval(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Float:
        sin_i, sin_o = sin_theta(wi), sin_theta(wo)
        flatter = wi.z < wo.z
        cos_a, cos_b = dr.select(flatter, wi.z, wo.z), dr.select(flatter, wo.z, wi.z)
        sin_a, sin_b = dr.select(flatter, sin_i, sin_o), dr.select(flatter, sin_o, sin_i)
        # Complements of the angles, in right angles: at grazing angles they keep digits that the angles lose.
        a, b = (dr.atan2(cos, sin) * (2 * dr.inv_pi) for cos, sin in ((cos_a, sin_a), (cos_b, sin_b)))
        tan_mean = (sin_a + sin_b) / dr.maximum(cos_a + cos_b, EPSILON)
        # cosφ sinβ and 2β/(π sinβ): unlike φ, these have derivatives at the normal. Up to sinβ = 1e-3 the second equals
        # its limit in float32.
        along = (wi.x * wo.x + wi.y * wo.y) / sin_a
        ratio = dr.select(sin_b > 1e-3, (1 - b) / dr.maximum(sin_b, 1e-3), 2 * dr.inv_pi)
        ratio2 = dr.square(ratio)

        forward = b * (3 - b * (3 - b)) - cos_a * cos_a / (1 + sin_a)  # sinα - (2β/π)³
        c2 = self.b * dr.select(along >= 0, sin_a, forward)
        c3 = 0.125 * self.sigma2 / (self.sigma2 + 0.09) * dr.square(1 - a) * ratio2 * sin_b
        once = self.c1 + c2 * along / dr.maximum(cos_b, EPSILON) + c3 * (sin_b - abs(along)) * tan_mean
        twice = self._twice() * (1 - along * sin_b * ratio2)
        # Not of the product: a black surface could not be optimised.
        return self.reflectance * dr.inv_pi * dr.maximum(once + self.reflectance * twice, 0)
