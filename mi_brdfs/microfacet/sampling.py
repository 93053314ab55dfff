"""Samplers of microfacet lobes by half vectors. Each draws a direction for ``wi``, and returns the density that it
draws it with."""

from __future__ import annotations

from copy import copy
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, clamp, normalize_or, safe_sqrt, select
from .distributions import Distribution
from .facet import Facet
from .fresnel import Fresnel
from .laws import tan2_of_versine
from .shadowing import Shadowing


class FacetLobe(Protocol):
    """What samplers know of a microfacet lobe."""

    distribution: Distribution
    shadowing: Shadowing
    fresnel: Fresnel

    def shadowed(self, facet: Facet) -> mi.Float:
        """F G as one number."""


class Sampler:
    """How directions of a microfacet lobe are drawn; the lobe is handed to each method."""

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        """A direction for three uniform variates, as of :meth:`mi_brdfs.lobes.Lobe.sample`."""
        raise NotImplementedError(f"{type(self).__name__} does not define sample.")

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        """The density per solid angle with which it draws ``facet.wo``."""
        raise NotImplementedError(f"{type(self).__name__} does not define pdf.")

    def forward_reflectance(self, lobe: FacetLobe, wi: mi.Vector3f) -> Any:
        """What a share of forward directions adds to the mean reflectance of the lobe's other ones."""
        return 0

    def complete(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f, drawn: mi.Bool, given: Facet | None
    ) -> tuple[Facet, mi.Float]:
        """``(facet, pdf)``: a facet whose ``wo`` is drawn as by :meth:`sample` in the lanes of ``drawn``, and the
        ``given`` one elsewhere, and its density: both together, where that is cheaper."""
        wo = self.sample(lobe, wi, u, v)
        facet = Facet.between(wi, wo if given is None else select(drawn, wo, given.wo))
        return facet, self.pdf(lobe, facet)


class AntitheticNormals(Sampler):
    r"""Draws a half vector, clipped to what can reflect above the horizon, and then it or its mirror image on the other
    side of the normal, with probability ∝ what they reflect. Exact for any shadowing and Fresnel term.

    The line through both has the azimuth ψ, which is uniform in the space stretched by about the roughness
    (:class:`Stretch`). On it the distribution's own density q has the mass C(R) within |tanθ_h| <= R(ψ), beyond which
    neither end of the line reflects ``wi`` above the horizon; m is the part of that mass nearer to the normal. With W =
    f cosθ_o · 4 cosθ_d · C(R)/q of a half vector, and W' of its image, choosing ∝ W gives the density 2 f cosθ_o /
    (W + W') and the weight (W + W')/2. (Unclipped, and with the visibility in place of W, it would be the V-cavity
    sampler of Heitz and d'Eon 2014, doi:10.1111/cgf.12417.)

    Rough lobes are shadowed at the ends of the line, and the reflectance of dielectrics rises less than it seems at
    grazing: m has the density 1 + τ - 2 τ m.
    """

    # Of τ; tests/calibration/half_vectors.py fits them.
    SHADOWED, BROAD = 0.85, 1.4
    """How much rough lobes are shadowed at most, and how soon."""
    RISING = 0.35
    """How much less the reflectance rises than it seems."""

    def _bias(self, lobe: FacetLobe, wi: mi.Vector3f) -> mi.Float:
        """τ."""
        shadowed = wi.z * dr.minimum(self.BROAD * lobe.distribution.mean_square_slope(), 1)
        bias = self.SHADOWED * shadowed + self.RISING * (1 - self._brighter(lobe, wi))
        return dr.minimum(bias, 0.9)  # at 1 the ends of the line would have no samples

    @staticmethod
    def _brighter(lobe: FacetLobe, wi: mi.Vector3f, cos: mi.Float = 1) -> mi.Float:
        """How much brighter the reflectance is at a cosine, by default that of normal incidence."""
        return dr.minimum(lobe.fresnel.brightness(cos) / dr.maximum(lobe.fresnel.brightness(wi.z), SMALL), 1)

    def _azimuth(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Float
    ) -> tuple[mi.Float, mi.Float, mi.Float, Any]:
        """``(u, cosψ, sinψ, which)``, with what is left of ``u``, and the choices made, for :meth:`_tan2`."""
        sin, cos = dr.sincos(dr.two_pi * v)
        return u, cos, sin, None

    def _tan2(self, lobe: FacetLobe, wi: mi.Vector3f, line: Line, which: Any, v: mi.Float) -> mi.Float:
        """A tan²θ_h on the line."""
        return line.inverse_cdf(draw_linear(self._bias(lobe, wi), v))

    def _density(
        self, lobe: FacetLobe, line: Line, facet: Facet, cos: mi.Float, sin: mi.Float, q: mi.Float
    ) -> mi.Float:
        """Of the half vectors drawn so, where ``q`` is that of the distribution, and lines are drawn as often as it
        does."""
        return q * linear_density(self._bias(lobe, facet.wi), line.part(facet)) / line.mass

    def complete(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f, drawn: mi.Bool, given: Facet | None
    ) -> tuple[Facet, mi.Float]:
        distribution = lobe.distribution
        u, cos, sin, which = self._azimuth(lobe, wi, u, v.x)
        stretch = Stretch(distribution, wi)
        x, y = stretch.azimuth(cos, sin)
        if given is not None:
            x, y = (select(drawn, *it) for it in zip((x, y), given.azimuth, strict=True))
        line = Line(distribution, wi, x, y)
        tan = safe_sqrt(self._tan2(lobe, wi, line, which, v.y))
        facet = Facet.at(wi, tan * x, tan * y)
        if given is not None:
            facet = facet.where(drawn, given)
        image = facet.image()
        weight, other = self._weight(facet, reflected(lobe, facet)), self._weight(image, reflected(lobe, image))
        is_image = select(drawn, u * (weight + other) >= weight, False)
        # Anew, as narrow distributions, and the weights of grazing images, see the rounding of the direction.
        facet = Facet.between(wi, select(is_image, image.wo, facet.wo))
        return facet, self._pdf(lobe, stretch, line.along(*facet.azimuth), facet)

    def sample(self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.complete(lobe, wi, u, v, True, None)[0].wo

    def pdf(self, lobe: FacetLobe, facet: Facet) -> mi.Float:
        stretch = Stretch(lobe.distribution, facet.wi)
        return self._pdf(lobe, stretch, Line(lobe.distribution, facet.wi, *facet.azimuth), facet)

    def _pdf(self, lobe: FacetLobe, stretch: Stretch, line: Line, facet: Facet) -> mi.Float:
        """The density, where the facet is on the line."""
        cos, sin, lines = stretch.inverse(*facet.azimuth)
        density = lines * self._density(lobe, line, facet, cos, sin, lobe.distribution.density(facet, line.g))
        image = facet.image()
        # The facet is known to reflect above the horizon. Its F and G are those of the lobe's value: Dr.Jit computes
        # them once.
        weight, other = self._weight(facet, lobe.shadowed(facet)), self._weight(image, reflected(lobe, image))
        return density / (2 * facet.cos_d) * (weight / (weight + other))

    @staticmethod
    def _weight(facet: Facet, reflected: mi.Float) -> mi.Float:
        """W of a facet that reflects F G, except for factors common to both of a pair. It is never zero: the derivative
        of W/(W + W') divides by the square of the sum."""
        return dr.maximum(reflected * facet.cos_d, EPSILON)


class Stretch:
    """The space in which the azimuth of lines is uniform. If all half vectors on them counted, it would be stretched by
    α. As those beyond tanθ_h = R do not, rough axes are stretched less, by 1/√(1/α² + 1/R²). That is exact for GGX
    where R is the same for all lines, 1, seen from above. Elsewhere R is 1 across the plane of incidence and larger
    along it; for all lines,

        1/R² = ρ + (1 - ρ) cosθ_i.
    """

    LOWEST = 0.2
    """ρ, fitted by tests/calibration/half_vectors.py."""

    def __init__(self, distribution: Distribution, wi: mi.Vector3f) -> None:
        self.u = self.v = self.alpha_u = self.alpha_v = distribution.alpha_u
        self.anisotropic = distribution.anisotropic
        if self.anisotropic:
            self.alpha_v = distribution.alpha_v
            clip = dr.lerp(self.LOWEST, 1, wi.z)
            self.u, self.v = (it * dr.rsqrt(1 + clip * it * it) for it in (self.alpha_u, self.alpha_v))

    def azimuth(self, cos: mi.Float, sin: mi.Float) -> tuple[mi.Float, mi.Float]:
        """The azimuth of a line, from that in this space."""
        return normalize_or(self.u * cos, self.v * sin, (1, 0))

    def inverse(self, x: mi.Float, y: mi.Float) -> tuple[mi.Float, mi.Float, Any]:
        """The azimuth here of a line, and how often it is drawn relative to a stretch by α."""
        cos, sin = normalize_or(x / self.u, y / self.v, (1, 0))
        if not self.anisotropic:
            return cos, sin, 1
        unclipped = dr.square(cos * self.u / self.alpha_u) + dr.square(sin * self.v / self.alpha_v)
        return cos, sin, unclipped * (self.alpha_u * self.alpha_v) / (self.u * self.v)


class Line:
    """The half vectors whose slopes lie along (x, y), which is of length one."""

    def __init__(self, distribution: Distribution, wi: mi.Vector3f, x: mi.Float, y: mi.Float) -> None:
        self.distribution = distribution
        along, z = abs(x * wi.x + y * wi.y), dr.maximum(wi.z, EPSILON)  # of which the square is not 0
        limit2 = dr.square((along + dr.sqrt(along * along + z * z)) / z)
        self.lowest = dr.rsqrt(1 + limit2)
        """cosθ_h where tanθ_h is R."""
        self.g = self._g(x, y)
        self.mass, self.rest = distribution.cdf(limit2, self.g)
        """C(R), and what it lacks to one."""

    def _g(self, x: mi.Float, y: mi.Float) -> mi.Float:
        return dr.square(x / self.distribution.alpha_u) + dr.square(y / self.distribution.alpha_v)

    def along(self, x: mi.Float, y: mi.Float) -> Line:
        """The same line, where rounding has turned it."""
        line = copy(self)
        line.g = self._g(x, y)
        return line

    def part(self, facet: Facet) -> mi.Float:
        """The m of a facet on the line."""
        return clamp(self.distribution.cdf(facet.tan2_h, self.g)[0] / self.mass, 0, 1)

    def complement(self, facet: Facet) -> mi.Float:
        """1 - C of a facet on the line."""
        return self.distribution.cdf(facet.tan2_h, self.g)[1]

    def inverse_cdf(self, m: mi.Float) -> mi.Float:
        """The tan²θ_h of an m."""
        return self.distribution.inverse_cdf(m * self.mass, self.rest + (1 - m) * self.mass, self.g)

    def uniform(self, v: mi.Float) -> mi.Float:
        """A tan²θ_h, of which cosθ_h is uniform."""
        return tan2_of_versine(v * (1 - self.lowest))

    def uniform_density(self) -> mi.Float:
        """Of half vectors drawn so; the azimuth is uniform in ψ, not in that of the half vector."""
        stretch = self.distribution.alpha_u * self.distribution.alpha_v * self.g
        return dr.inv_two_pi / (stretch * (1 - self.lowest))


def linear_density(bias: mi.Float, m: mi.Float) -> mi.Float:
    """The density 1 + τ - 2 τ m on [0, 1]."""
    return 1 + bias - 2 * bias * m


def draw_linear(bias: mi.Float, u: mi.Float) -> mi.Float:
    """A draw of that density, in the form in which a small bias does not cancel."""
    return 2 * u / (1 + bias + dr.sqrt(dr.square(1 + bias) - 4 * bias * u))


def reflected(lobe: FacetLobe, facet: Facet) -> mi.Float:
    """What a facet reflects, F G, or nothing if that leads below the horizon."""
    valid = (facet.cos_d > SMALL) & (facet.cos_o > 0)
    # Elsewhere the formulas need not make sense, but must be finite.
    wo = mi.Vector3f(facet.wo.x, facet.wo.y, dr.maximum(facet.wo.z, SMALL))
    safe = Facet(facet.wi, wo, facet.h, dr.maximum(facet.cos_d, SMALL))
    return select(valid, lobe.shadowed(safe), 0)
