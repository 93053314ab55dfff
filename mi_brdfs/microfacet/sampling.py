"""Samplers of microfacet lobes, put together for one ``wi`` from proposals, each with its draw and its density side by
side. docs/sampling.md derives them.

* :class:`ClippedNormals` proposes half vectors by the distribution, in some :class:`Law`, and
  :class:`.visible.VisibleNormals` those that ``wi`` sees.
* :class:`Pair` takes a half vector or its image, in proportion to what they reflect.
* :class:`MixedProposals` draws from one proposal or another, by shares.

Which proposals suit a lobe is said by its terms: :meth:`.shadowing.Shadowing.sampler`,
:meth:`.distributions.Distribution.visible_normals` and :meth:`.fresnel.Fresnel.forward`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, SMALL, choose, clamp, safe_sqrt, select, unit
from .facet import Facet
from .terms import Distribution, Fresnel, HalfVectors

# Fitted by tests/calibration/half_vectors.py.
SHADOWED = 0.85
"""How much facets at the ends of a line are shadowed, of a mean square slope of one."""
RISING = 0.35
"""How much less the reflectance rises than it seems."""
MOST = 0.9
"""The largest τ, and share of the lines that lean: the rest bounds weights."""
OUTWARD = -0.75
"""τ of lines that lean."""
LEANING = 1.25
"""How far those facets lean that count, in typical slopes."""


class Pair:
    """A half vector of a proposal, or its image, with probability ∝ the weights W of the two as single draws: what they
    ``reflect``, F G, times D over their density. The one taken has the density 2 p W/(W + W'), and the weight
    (W + W')/2."""

    def __init__(self, half_vectors: HalfVectors, reflect: Callable[[Facet], mi.Float]) -> None:
        self.half_vectors, self.reflect = half_vectors, reflect

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        facet, image = self.half_vectors.draw(v)
        weight, other = self._weight(facet), self._weight(image)
        return select(u * (weight + other) < weight, facet.wo, image.wo)

    def pdf(self, facet: Facet) -> mi.Float:
        # The facet is known to reflect above the horizon. Its F and G are those of the lobe's value: Dr.Jit computes
        # them once.
        weight = self._positive(self.reflect(facet) * self.half_vectors.weight(facet))
        other = self._weight(self.half_vectors.image(facet))
        return 2 * self.half_vectors.pdf(facet) * (weight / (weight + other))

    def _weight(self, facet: Facet) -> mi.Float:
        """Return W, of facets that need not reflect above the horizon."""
        valid = (facet.cos_d > SMALL) & (facet.cos_o > 0)
        # Elsewhere the formulas need not make sense, but must be finite.
        wo = mi.Vector3f(facet.wo.x, facet.wo.y, dr.maximum(facet.wo.z, SMALL))
        safe = Facet(facet.wi, wo, facet.h, dr.maximum(facet.cos_d, SMALL))
        return self._positive(select(valid, self.reflect(safe) * self.half_vectors.weight(safe), 0))

    @staticmethod
    def _positive(weight: mi.Float) -> mi.Float:
        # The derivative of W/(W + W') divides by the square of the sum.
        return dr.maximum(weight, EPSILON)


class MixedProposals:
    """One proposal, or with probability ``share`` another."""

    def __init__(self, proposal: Any, other: Any, share: mi.Float) -> None:
        self.proposal, self.other, self.share = proposal, other, share

    def draw(self, u: mi.Float, v: mi.Point2f) -> Any:
        # Choose by v.x: a pair needs all of u.
        other, x = choose(v.x, self.share)
        v = mi.Point2f(x, v.y)
        return select(other, self.other.draw(u, v), self.proposal.draw(u, v))

    def pdf(self, *of: Any) -> mi.Float:
        return dr.lerp(self.proposal.pdf(*of), self.other.pdf(*of), self.share)


class UniformDirections:
    """All directions alike: they bound the weights of any lobe."""

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return mi.warp.square_to_uniform_hemisphere(v)

    def pdf(self, facet: Facet) -> mi.Float:
        return dr.inv_two_pi


class ClippedNormals:
    r"""The half vectors of a distribution, clipped to what can reflect above the horizon.

    Those of one azimuth, and of the opposite one, are a line. Its azimuth ψ is meant in the space in which the slopes
    (h_x/h_z, h_y/h_z) are stretched to about equal roughness. On it the distribution's density q has the mass C(R)
    within |tanθ_h| <= R(ψ), beyond which neither end of the line reflects ``wi`` above the horizon; m is the part of
    that mass nearer to the normal. If (ψ, m) were uniform, half vectors would have the density q, scaled up to what
    counts; a ``law`` says what else it is.

    If no half vector were clipped, the stretch would be by α. As those beyond R are, rough axes are stretched less, by
    1/√(1/α² + 1/R²): exactly so for GGX seen from above, where R is 1. Elsewhere R is 1 across the plane of incidence
    and larger along it; 1/R² = cosθ_i stands for all lines.
    """

    def __init__(self, distribution: Distribution, wi: mi.Vector3f, law: Law) -> None:
        self.distribution, self.wi, self.law = distribution, wi, law
        self.u, self.v = stretch(distribution, wi)

    def draw(self, v: mi.Point2f) -> tuple[Facet, Facet]:
        at = self.law.draw(0, v)
        x, y = unit(self.u * at.x, self.v * at.y)
        g, mass, rest = self._line(x, y)
        tan = safe_sqrt(self.distribution.inverse_cdf(at.z * mass, rest + (1 - at.z) * mass, g))
        facet = Facet.at(self.wi, tan * x, tan * y)
        return facet, facet.image()

    def pdf(self, facet: Facet) -> mi.Float:
        x, y = facet.azimuth
        g, mass, _ = self._line(x, y)
        cos, sin = unit(x / self.u, y / self.v)
        m = clamp(self.distribution.cdf(facet.tan2_h, g)[0] / mass, 0, 1)
        density = self.law.pdf(mi.Vector3f(cos, sin, m)) * self.distribution.density(facet, g) / mass
        if self.distribution.anisotropic:
            alpha_u, alpha_v = self.distribution.alpha_u, self.distribution.alpha_v
            unclipped = dr.square(cos * self.u / alpha_u) + dr.square(sin * self.v / alpha_v)
            density *= unclipped * (alpha_u * alpha_v) / (self.u * self.v)
        return density / (4 * facet.cos_d)

    def image(self, facet: Facet) -> Facet:
        return facet.image()

    def weight(self, facet: Facet) -> mi.Float:
        return facet.cos_d

    def _line(self, x: mi.Float, y: mi.Float) -> tuple[mi.Float, mi.Float, mi.Float]:
        """Return ``(g, C(R), 1 - C(R))`` of the line with that azimuth."""
        along, z = abs(x * self.wi.x + y * self.wi.y), dr.maximum(self.wi.z, EPSILON)  # of which the square is not 0
        limit2 = dr.square((along + dr.sqrt(along * along + z * z)) / z)
        g = dr.square(x / self.distribution.alpha_u) + dr.square(y / self.distribution.alpha_v)
        return (g, *self.distribution.cdf(limit2, g))


class Law(Protocol):
    """A law of (cosψ, sinψ, m), given as a vector."""

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f: ...

    def pdf(self, at: mi.Vector3f) -> mi.Float:
        """Return the density over that of uniform ψ and m."""


class Evenly:
    """Lines of any azimuth alike; m has the density 1 + τ - 2 τ m."""

    def __init__(self, bias: mi.Float) -> None:
        self.bias = bias

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        sin, cos = dr.sincos(dr.two_pi * v.x)
        return mi.Vector3f(cos, sin, draw_linear(self.bias, v.y))

    def pdf(self, at: mi.Vector3f) -> mi.Float:
        return linear_density(self.bias, at.z)


class Leaning:
    """Lines ∝ |cosφ|, with φ from the azimuth (x, y), and half vectors on them as far out as OUTWARD says."""

    def __init__(self, x: mi.Float, y: mi.Float) -> None:
        self.x, self.y = x, y

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        sin = 2 * v.x - 1
        cos = safe_sqrt(1 - sin * sin)
        return mi.Vector3f(cos * self.x - sin * self.y, cos * self.y + sin * self.x, draw_linear(OUTWARD, v.y))

    def pdf(self, at: mi.Vector3f) -> mi.Float:
        return 0.5 * dr.pi * abs(at.x * self.x + at.y * self.y) * linear_density(OUTWARD, at.z)


def linear_density(bias: mi.Float, m: mi.Float) -> mi.Float:
    """The density 1 + τ - 2 τ m on [0, 1]."""
    return 1 + bias - 2 * bias * m


def draw_linear(bias: mi.Float, u: mi.Float) -> mi.Float:
    """A draw of that density, in the form in which a small bias does not cancel."""
    return 2 * u / (1 + bias + dr.sqrt(dr.square(1 + bias) - 4 * bias * u))


def stretch(distribution: Distribution, wi: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Return how much the axes of :class:`ClippedNormals` are stretched."""
    alphas = distribution.alpha_u, distribution.alpha_v
    if not distribution.anisotropic:
        return alphas
    u, v = (alpha * dr.rsqrt(1 + wi.z * alpha * alpha) for alpha in alphas)
    return u, v


def clipped_normals(distribution: Distribution, fresnel: Fresnel, wi: mi.Vector3f, lean: float) -> ClippedNormals:
    """Return clipped normals under a shadowing term that makes them ``lean``.

    Rough lobes are shadowed at the ends of the line, and the reflectance rises less than it seems at grazing: so τ > 0.
    Facets are seen by n·wi and by the typical slope along ``wi``. They lean towards the viewer as far as the second one
    counts, and less where the reflectance is lower there.
    """
    slope2 = distribution.mean_square_slope_along(wi)

    def brighter(cos: mi.Float) -> mi.Float:
        return dr.minimum(fresnel.brightness(cos) / dr.maximum(fresnel.brightness(wi.z), SMALL), 1)

    shadowed = SHADOWED * wi.z * dr.minimum(distribution.mean_square_slope(), 1)
    law: Law = Evenly(dr.minimum(shadowed + RISING * (1 - brighter(mi.Float(1))), MOST))
    if lean:
        bright = brighter(dr.minimum(wi.z + LEANING * safe_sqrt(slope2), 1))
        seen = lean * dr.inv_pi * slope2 * dr.square(bright)
        share = dr.minimum(seen / (seen + dr.square(dr.maximum(wi.z, EPSILON))), MOST)
        u, v = stretch(distribution, wi)
        law = MixedProposals(law, Leaning(*unit(u * wi.x, v * wi.y)), share)
    return ClippedNormals(distribution, wi, law)
