"""Forward reflection at grazing, for the dielectrics that hardly reflect elsewhere."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, choose, normalize_or, safe_sqrt, select, sin_theta
from .facet import Facet
from .fresnel import Dielectric
from .sampling import FacetLobe, Sampler, draw_linear, linear_density


class ForwardDirections:
    """Directions about the horizon opposite to ``wi``, where a dielectric of nearly the same index on both sides
    reflects by far the most.

    Where both directions are low, with the cosines z and z' and the azimuth δ from the plane of incidence, cosθ_d² is
    about ((z + z')² + δ²)/4. z' has the density ∝ (z' + c)/(s + z')³, i.e. r = z'/(s + z') has a linear one; s is z,
    but less where the reflectance falls sooner, near the critical angle. tan(δ/2) has a density ∝ (σ² + (tan(δ/2) -
    m)²)^(-3/2): m is where the half vector lies on the ridge of anisotropic facets, and σ is (z + z')/2, limited by how
    far the facets reach across. Where the indices differ more, up to total reflection at cosθ_d = √|η² - 1|, z is
    larger in σ.
    """

    BIAS = -0.85
    """τ of :func:`.sampling.linear_density`: at -1 there would be no samples in the horizon, where some shadowing terms
    let facets reflect."""
    FALL = 3
    """By which factor the reflectance falls from the horizon to z' = s."""
    BROADER = 2
    """How much |η² - 1| adds to z²."""
    STEEP = 0.1
    """The least sum of two sines that is divided by: far from the horizon nothing is drawn."""

    def __init__(
        self, fresnel: Dielectric, wi: mi.Vector3f, slope2: mi.Float = 1e6, slope2_v: mi.Float | None = None
    ) -> None:
        """For facets of some mean square slope, along u if another one along v is given."""
        self.z, self.sin = lowest_cosine(wi), sin_theta(wi)
        step = dr.square(fresnel.eta) - 1
        self.broader = dr.sqrt(self.z * self.z + self.BROADER * abs(step))
        self.scale = self._scale(step)
        self.x, self.y = x, y = normalize_or(wi.x, wi.y, (1, 0))
        self.across, self.ridge = dr.rcp(slope2), None
        if slope2_v is not None:
            u, v = self.across, dr.rcp(slope2_v)
            self.across = x * x * v + y * y * u
            self.ridge = x * y * (u - v) / (1 + self.across)

    def _scale(self, step: mi.Float) -> mi.Float:
        """s for η² - 1."""
        # Near η = 1, F is (η² - 1)²/(c + g)⁴ with g² = c² + η² - 1, beyond total reflection.
        lowest2 = lowest_cos_d2(self.z, self.sin)
        c = dr.maximum(dr.sqrt(lowest2), safe_sqrt(-step))
        total = dr.sqrt(dr.sqrt(self.FALL)) * (c + safe_sqrt(c * c + step))
        fallen = 0.5 * (total - step / total)
        # cosθ_d² = lowest2 + z z'/2 + sinθ_i z'²/4 in the plane of incidence, up to terms in z'³.
        rise = dr.square(fallen) - lowest2
        near = 4 * rise / (self.z + dr.sqrt(self.z * self.z + 4 * self.sin * rise))
        return dr.rsqrt(1 / dr.square(self.z) + 1 / dr.square(near))

    def _azimuth(self, z: mi.Float, sin: mi.Float) -> tuple[Any, mi.Float]:
        """Return ``(m, σ)`` of a z' = cosθ_o."""
        narrow, broad = 0.5 * (self.z + z), 0.5 * (self.broader + z)
        sigma = dr.rsqrt(self.across / dr.square(narrow) + 1 / dr.square(broad))
        if self.ridge is None:
            return 0, sigma
        difference = z * z - self.z * self.z
        root = safe_sqrt(sin * sin - dr.square(self.ridge) * difference)
        sines = dr.maximum(self.sin + sin, self.STEEP) * dr.maximum(sin + root, self.STEEP)
        return self.ridge * difference / sines, sigma

    def draw(self, v: mi.Point2f) -> mi.Vector3f:
        r = draw_linear(self.BIAS, v.x)  # over that of z' = 1, 1/(1 + s)
        z = dr.minimum(self.scale * r / (self.scale + (1 - r)), 1)
        sin = safe_sqrt(1 - z * z)
        m, sigma = self._azimuth(z, sin)
        uniform = 2 * v.y - 1
        tan = m + sigma * uniform / dr.maximum(safe_sqrt(1 - uniform * uniform), SMALL)
        cos2 = dr.rcp(1 + tan * tan)  # of δ/2
        sin_delta, cos_delta = 2 * tan * cos2, (1 - tan * tan) * cos2
        x, y = -cos_delta * self.x - sin_delta * self.y, sin_delta * self.x - cos_delta * self.y
        return mi.Vector3f(sin * x, sin * y, z)

    def pdf(self, wo: mi.Vector3f) -> mi.Float:
        """Return the density per solid angle."""
        z = dr.maximum(wo.z, 0)
        x, y = normalize_or(wo.x, wo.y, (1, 0))
        m, sigma = self._azimuth(z, safe_sqrt(1 - z * z))
        tan = (self.x * y - self.y * x) / dr.maximum(1 - (self.x * x + self.y * y), SMALL)
        inverse = dr.rsqrt(1 + dr.square((tan - m) / sigma))
        unit, nearer = 1 + self.scale, dr.rcp(self.scale + z)
        r = dr.minimum(z * nearer * unit, 1)
        density_z = linear_density(self.BIAS, r) * self.scale * unit * dr.square(nearer)
        return density_z * 0.25 * (1 + tan * tan) / sigma * inverse * dr.square(inverse)


class ForwardShare(NamedTuple):
    """How much of a lobe lies about the horizon opposite to ``wi``."""

    reflectance: Any
    """What that adds to the mean reflectance of other directions."""
    probability: mi.Float
    """Of samples drawn there."""

    @classmethod
    def of(cls, fresnel: Dielectric, wi: mi.Vector3f, fraction: mi.Float, typical: mi.Float) -> ForwardShare:
        """For what ``fraction`` the lobe would have there if it reflected everything, and the square of the cosθ_d that
        is typical of the rest."""
        step2 = dr.square((fresnel.eta - 1) / (fresnel.eta + 1))
        distinct = dr.square(dr.square(dr.square(step2 / INDISTINCT)))
        z = lowest_cosine(wi)
        # Of narrow lobes only the last directions before the horizon are like that.
        narrow = dr.square(dr.square(z * z / typical))
        last = fresnel(dr.sqrt(lowest_cos_d2(z, sin_theta(wi))))
        forward = fraction * dr.lerp(fresnel(LOWEST * z), last, narrow) / (1 + distinct)
        rest = dr.maximum(fresnel(dr.minimum(dr.sqrt(typical), 1)), EPSILON)
        return cls(forward, LARGEST * forward / (forward + rest))


INDISTINCT = 0.016
"""The reflectance at normal incidence below which dielectrics need a share of forward directions."""
LARGEST = 0.6
"""The share where they need it most."""
LOWEST = 0.8
"""The cosθ_d of these directions, relative to cosθ_i."""


def lowest_cosine(wi: mi.Vector3f) -> mi.Float:
    """Return the z of above, not too small for what divides by it."""
    return dr.maximum(wi.z, 1e-3)


def lowest_cos_d2(z: mi.Float, sin: mi.Float) -> mi.Float:
    """Return the cosθ_d² of the direction opposite in the horizon, (1 - sinθ_i)/2."""
    return 0.5 * z * z / (1 + sin)


class WithForwardShare(Sampler):
    """Another sampler for a dielectric, with a share of :class:`ForwardDirections`."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler = sampler

    def _forward(self, lobe: FacetLobe, wi: mi.Vector3f) -> tuple[ForwardShare, ForwardDirections]:
        distribution = lobe.distribution
        fresnel: Any = lobe.fresnel  # a Dielectric
        # Three of four facets are less steep than that along wi.
        if distribution.anisotropic:
            x, y = normalize_or(wi.x, wi.y, (1, 0))
            u2, v2 = dr.square(distribution.alpha_u), dr.square(distribution.alpha_v)
            along = u2 * x * x + v2 * y * y
            slope2 = distribution.inverse_cdf(0.75, 0.25, 1 / along)
            u2, v2 = u2 * (slope2 / along), v2 * (slope2 / along)
            directions, steepest2 = ForwardDirections(fresnel, wi, u2, v2), dr.maximum(u2, v2)
        else:
            slope2 = steepest2 = distribution.inverse_cdf(0.75, 0.25, 1 / dr.square(distribution.alpha_u))
            directions = ForwardDirections(fresnel, wi, slope2)
        z2 = dr.square(lowest_cosine(wi))
        cos2 = z2 + slope2 / (1 + steepest2)
        low = z2 / cos2
        share = ForwardShare.of(fresnel, wi, dr.sqrt(low) * (1 - low), cos2)
        return share, directions

    def forward_reflectance(self, lobe: FacetLobe, wi: mi.Vector3f) -> Any:
        return self._forward(lobe, wi)[0].reflectance

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.complete(lobe, wi, u, v, True, None)[0].wo

    def complete(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f, drawn: mi.Bool, given: Facet | None
    ) -> tuple[Facet, mi.Float]:
        share, directions = self._forward(lobe, wi)
        forward, u = choose(u, share.probability)
        wo = directions.draw(v)
        if given is not None:
            wo = select(drawn, wo, given.wo)
        facet, pdf = self.sampler.complete(lobe, wi, u, v, select(forward, False, drawn), Facet.between(wi, wo))
        return facet, dr.lerp(pdf, directions.pdf(facet.wo), share.probability)

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        share, directions = self._forward(lobe, facet.wi)
        return dr.lerp(self.sampler.pdf(lobe, facet), directions.pdf(facet.wo), share.probability)
