from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe, MicrofacetLobe, over_diffuse
from ..math import EPSILON, SMALL, Spectrum, choose, clamp, luminance, safe_sqrt, unit
from ..microfacet.distributions import ABC
from ..microfacet.facet import Facet
from ..microfacet.forward import ForwardDirections
from ..microfacet.fresnel import Dielectric
from ..microfacet.laws import PowerLaw
from ..microfacet.shadowing import VCavity
from ..model import Model, Values
from ..parameters import Choice, Colour, Number, OneOf, Preset, Reflectance


class Low(Model):
    """Löw, Kronander, Ynnerman and Unger's models for glossy surfaces (2012), with the ABC distribution.

    J. Löw, J. Kronander, A. Ynnerman and J. Unger, BRDF models for accurate and efficient rendering of glossy
    surfaces, ACM Transactions on Graphics 31(1), 2012, doi:10.1145/2077341.2077350.

        microfacet:  f = ρd/π + F(wi·h) G S(1 - cosθ_h) / (π cosθ_i cosθ_o)
        smooth:      f = ρd/π + F(cosθ_d) S(|wi_xy + wo_xy|²),     cosθ_d = √(1 - ¼|wi_xy - wo_xy|²)
        S(x) = A / (1 + B x)^C

    with h = (wi+wo)/|wi+wo|, the V-cavity G = min(1, 2 cosθ_h cosθ_i/(wi·h), 2 cosθ_h cosθ_o/(wi·h)) and the exact
    Fresnel reflectance F of a dielectric of index ``int_ior`` in vacuum. The smooth variant follows Rayleigh-Rice
    theory, and has no shadowing. ``normalization`` applies to the microfacet variant:

    * fit: as above, as required by the published fits of the MERL materials
    * paper: without 1/π, as in the printed equation 15
    * unit: f = ρd/π + A F D G/(4 cosθ_i cosθ_o), D ∝ (1 + B (1 - cosθ_h))^-C normalised by ∫ D cosθ_h = 1; so A <= 1
      conserves energy

    Reciprocal. Energy-conserving for ``unit`` with ρd + A <= 1; otherwise A comes from a fit, and the albedo may be
    above 1. The factor 1/π was inferred from the fits. One-sided.

    In polarized variants the facets polarise the light as a smooth surface does; the smooth variant and the diffuse
    lobe depolarise it.

    Sampling: for microfacet an antithetic pair of half vectors, one chosen by how much each reflects
    (mi_brdfs.microfacet.sampling.Pair); for smooth exactly S, clipped to the disc of projected directions.
    No sample falls below the horizon.

    Example
    -------
    {"type": "low", "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.3, 0.2]}, "a": 50.0, "b": 2000, "c": 1.2}
    """

    family = "fits to measurements"

    diffuse_reflectance = Reflectance(None, "albedo ρd of the diffuse lobe; omitted by default", role="diffuse")
    a = Colour(1, (0, float("inf")), "scale A")
    b = Number(100, (0, 1e8), "width B: the higher, the narrower the highlight")
    c = Number(1.5, (0, 10), "exponent C of the tail: the higher, the steeper")
    int_ior = Number(1.5, (1, 100), "index of refraction inside, over vacuum; 1 reflects nothing", role="fresnel")
    variant = OneOf(
        {"microfacet": {"normalization": Choice(("fit", "paper", "unit"), "scale of the lobe")}, "smooth": {}},
        "which of the paper's two models",
    )
    normalization: str
    """The choice that goes with microfacet."""
    preset = Preset()

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        fresnel = Denser(p.int_ior)
        if self.variant == "smooth":
            specular: Lobe = SmoothLobe(p.a, PowerLaw(p.b, p.c), fresnel)
        else:
            scale = {"fit": 4 * dr.inv_pi, "paper": 4.0, "unit": None}[self.normalization]
            specular = MicrofacetLobe(p.a, ABC(p.b, p.c, scale), VCavity(), fresnel)
        return over_diffuse(p.diffuse_reflectance, specular)


class Denser(Dielectric):
    """A dielectric of index 1, which reflects nothing, or higher."""

    LEAST, INSIDE = 1, 1.5


class SmoothLobe(Lobe):
    """f = A F(cosθ_d) (1 + B d²)^-C, where d is the distance of wo_xy from the projected mirror direction -wi_xy.

    On the unit disc of projected directions x, f cosθ_o dω = f dx: the cosine cancels, and S depends on d² only. Draw
    the azimuth of a chord through -wi_xy, d² from the power law up to the disc's edge, at the same fraction of the mass
    on both sides, and one of the two points with probability ∝ mass times F. A dielectric of nearly the same index on
    both sides has a share of forward directions besides (:mod:`mi_brdfs.microfacet.forward`).
    """

    def __init__(self, reflectance: Spectrum, law: PowerLaw, fresnel: Dielectric) -> None:
        self.reflectance, self.law, self.fresnel = reflectance, law, fresnel

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.reflectance * ((self.fresnel(wi.z) + self._forward(wi).reflectance) * self.law.norm * dr.pi)

    def _forward(self, wi: mi.Vector3f) -> ForwardDirections:
        """Return the directions about the horizon opposite to ``wi``."""
        d, z = dr.sqrt(self.law.inverse(0.75 * self.law.norm)), dr.maximum(wi.z, 1e-3)
        z2 = z * z + 0.3 * abs(dr.square(self.fresnel.eta) - 1)
        cos2 = z2 + d * (1 - 0.25 * d)
        low = dr.minimum(z2 / cos2, 1)  # a GPU's quotients are rounded up, too
        return ForwardDirections(self.fresnel, wi, low * dr.sqrt(low) * (1 - low), cos2)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return self.reflectance * self.fresnel(wi.z)

    def _mass(self, wi: mi.Vector3f, x: mi.Float, y: mi.Float) -> mi.Float:
        """Return the power law's mass between -wi_xy and the edge of the disc in the direction (x, y)."""
        along = x * wi.x + y * wi.y
        reach = along + dr.sqrt(along * along + wi.z * wi.z)
        return dr.maximum(self.law.mass(reach * reach), EPSILON)  # at grazing angles, rounding may leave no distance

    def _reflectance(self, wi: mi.Vector3f, x: mi.Float, y: mi.Float) -> Spectrum:
        """Return F for the projected direction (x, y)."""
        return self.fresnel(safe_sqrt(1 - 0.25 * (dr.square(x - wi.x) + dr.square(y - wi.y))))

    def _brightness(self, wi: mi.Vector3f, x: mi.Float, y: mi.Float) -> mi.Float:
        """Return the reflectance that decides the choice of a side, which must not vanish."""
        return dr.maximum(luminance(self._reflectance(wi, x, y)), SMALL)

    def _end(self, wi: mi.Vector3f, x: mi.Float, y: mi.Float, u: mi.Float) -> tuple[Any, mi.Float]:
        """Return the point at the fraction ``u`` of the mass on one side of a chord, and that mass times F."""
        mass = self._mass(wi, x, y)
        d = safe_sqrt(self.law.inverse(u * mass))
        point = (d * x - wi.x, d * y - wi.y)
        return point, mass * self._brightness(wi, *point)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        dx, dy = wi.x + wo.x, wi.y + wo.y
        d2 = dx * dx + dy * dy
        x, y = unit(dx, dy)
        shape = self.law.eval(d2) * wo.z
        value = self._reflectance(wi, wo.x, wo.y) * shape
        mass = self._mass(wi, x, y)
        _, other = self._end(wi, -x, -y, clamp(self.law.mass(d2) / mass, 0, 1))
        own = self._brightness(wi, wo.x, wo.y)
        pdf = 2 * dr.inv_pi * own * shape / (mass * own + other)
        forward = self._forward(wi)
        return self.reflectance * value, dr.lerp(pdf, forward.pdf(Facet.between(wi, wo)), forward.share)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        forward = self._forward(wi)
        is_forward, u = choose(u, forward.share)
        y, x = dr.sincos(dr.two_pi * v.x)
        (first, weight), (second, other) = self._end(wi, x, y, v.y), self._end(wi, -x, -y, v.y)
        take_first = u * (weight + other) < weight
        px, py = (dr.select(take_first, a, b) for a, b in zip(first, second, strict=True))
        wo = mi.Vector3f(px, py, safe_sqrt(1 - px * px - py * py))
        return dr.select(is_forward, forward.draw(u, v), wo)
