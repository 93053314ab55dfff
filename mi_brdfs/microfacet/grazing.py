"""Pairs of half vectors for shadowing terms under which other facets count at grazing than near the normal."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, choose, safe_sqrt, select
from .distributions import Distribution
from .facet import Facet
from .laws import versine
from .sampling import AntitheticNormals, FacetLobe, Line, Stretch, draw_linear, linear_density


class AntitheticSteepNormals(AntitheticNormals):
    """The pair for shadowing terms under which, at grazing, a facet reflects the more the steeper it is, wherever it
    faces: on a part of the lines the half vectors are uniform."""

    STEEP = 2.2
    """How many of the facets whose slope is at least one the part counts; tests/calibration/half_vectors.py fits
    it."""
    LARGEST = 0.5
    """The largest part: facets that nearly all lie near the horizon are no more uniform than flat ones."""

    def _steep(self, lobe: FacetLobe, wi: mi.Vector3f) -> mi.Float:
        steep = self.STEEP * dr.square(dr.square(1 - wi.z)) * steep_facets(lobe.distribution, wi)
        return dr.minimum(steep, self.LARGEST)

    def _azimuth(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Float
    ) -> tuple[mi.Float, mi.Float, mi.Float, Any]:
        is_steep, u = choose(u, self._steep(lobe, wi))
        u, cos, sin, _ = super()._azimuth(lobe, wi, u, v)
        return u, cos, sin, is_steep

    def _tan2(self, lobe: FacetLobe, wi: mi.Vector3f, line: Line, which: Any, v: mi.Float) -> mi.Float:
        return dr.select(which, line.uniform(v), super()._tan2(lobe, wi, line, None, v))

    def _density(
        self, lobe: FacetLobe, line: Line, facet: Facet, cos: mi.Float, sin: mi.Float, q: mi.Float
    ) -> mi.Float:
        density = super()._density(lobe, line, facet, cos, sin, q)
        return dr.lerp(density, line.uniform_density(), self._steep(lobe, facet.wi))


class AntitheticNormalsTowardViewer(AntitheticNormals):
    """The pair for shadowing terms under which, at grazing, those facets count that lean towards ``wi``, along the
    plane of incidence: a part λ of the samples has lines ∝ |cosφ|, with φ from that plane, and τ = -0.75.

    Smith's term leans by 1, the implicit one by 4; V-cavities do not. Dielectrics lean less, as they reflect less where
    they would lean to.

    Of a distribution with a long tail, or under some shadowing terms, the few steep facets may reflect more at grazing
    than all others together. For a part δ of the samples the lines lean, too, and the half vectors on them are uniform,
    whatever the distribution: that bounds their weights. λ is a part of the others.
    """

    # tests/calibration/half_vectors.py fits these, and how far shadowing terms lean.
    OUTWARD = -0.75
    LEANING = 1.5
    """How far those facets lean that count, in typical slopes."""
    STEEP = 1.2
    """How many of the steep facets δ counts: those whose slope is at least one."""
    LARGEST = 0.5
    """The largest δ, for the reason of :attr:`AntitheticSteepNormals.LARGEST`."""

    def __init__(self, steep: bool) -> None:
        self.steep = steep

    def _along(self, lobe: FacetLobe, wi: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Float, Any]:
        """``(x, y, λ, δ)``, where (x, y) is the azimuth of ``wi`` in the stretched space."""
        distribution = lobe.distribution
        x, y = Stretch(distribution, wi).azimuth(wi.x, wi.y)
        # Facets are seen by n·wi and by the typical slope along wi: they lean as far as the second one counts.
        slope2 = distribution.mean_square_slope_along(wi)
        brighter = self._brighter(lobe, wi, dr.minimum(wi.z + self.LEANING * safe_sqrt(slope2), 1))
        cos2 = dr.square(dr.maximum(wi.z, EPSILON))  # which is not 0
        seen = lobe.shadowing.lean * dr.inv_pi * slope2 * dr.square(brighter)
        leaning = dr.minimum(seen / (seen + cos2), lobe.shadowing.most_leaning)
        if not self.steep:
            return x, y, leaning, 0
        steep = dr.square(dr.square(1 - wi.z)) * self._brighter(lobe, wi, 0.5) * steep_facets(distribution, wi)
        return x, y, leaning, self._steep(self.STEEP * steep, seen + cos2)

    def _azimuth(
        self, lobe: FacetLobe, wi: mi.Vector3f, u: mi.Float, v: mi.Float
    ) -> tuple[mi.Float, mi.Float, mi.Float, Any]:
        x, y, leaning, steep = self._along(lobe, wi)
        is_steep, u = choose(u, steep) if self.steep else (False, u)
        leans, u = choose(u, select(is_steep, lobe.shadowing.most_leaning, leaning))
        sin, cos = dr.sincos(dr.two_pi * v)
        sin = dr.select(leans, 2 * v - 1, sin)
        cos = dr.select(leans, safe_sqrt(1 - sin * sin), cos)
        return u, cos * x - sin * y, cos * y + sin * x, (leans, is_steep)

    def _tan2(self, lobe: FacetLobe, wi: mi.Vector3f, line: Line, which: Any, v: mi.Float) -> mi.Float:
        leans, is_steep = which
        tan2 = line.inverse_cdf(self._part(lobe, wi, line, leans, v))
        return dr.select(is_steep, self._steep_tan2(line, v), tan2) if self.steep else tan2

    def _density(
        self, lobe: FacetLobe, line: Line, facet: Facet, cos: mi.Float, sin: mi.Float, q: mi.Float
    ) -> mi.Float:
        x, y, leaning, steep = self._along(lobe, facet.wi)
        lines = 0.5 * dr.pi * abs(cos * x + sin * y)
        outward = self._outward_density(line, facet) * q / line.mass
        density = dr.lerp(super()._density(lobe, line, facet, cos, sin, q), lines * outward, leaning)
        if self.steep:
            lines = dr.lerp(1, lines, lobe.shadowing.most_leaning)
            density = dr.lerp(density, lines * self._steep_density(line, facet), steep)
        return density

    def _steep(self, steep: mi.Float, others: mi.Float) -> mi.Float:
        """δ for what the steep facets reflect, and about the square of what others do."""
        return dr.minimum(steep / (steep + dr.sqrt(others)), self.LARGEST)

    def _steep_tan2(self, line: Line, v: mi.Float) -> mi.Float:
        return line.uniform(v)

    def _steep_density(self, line: Line, facet: Facet) -> mi.Float:
        return line.uniform_density()

    def _part(self, lobe: FacetLobe, wi: mi.Vector3f, line: Line, leans: mi.Bool, v: mi.Float) -> mi.Float:
        """An m."""
        return draw_linear(dr.select(leans, self.OUTWARD, self._bias(lobe, wi)), v)

    def _outward_density(self, line: Line, facet: Facet) -> mi.Float:
        """Of the m on lines that lean."""
        return linear_density(self.OUTWARD, line.part(facet))


class AntitheticImplicitNormals(AntitheticNormalsTowardViewer):
    """That pair for the implicit term, which is ∝ both cosines: the more a facet leans, the brighter it is, without
    end. The steep half vectors have a density ∝ 1/√(1 - cosθ_h); and as of a distribution with a peak and a skirt a few
    facets are many times as steep as the typical ones, for a part of the samples √(1 - C) is uniform."""

    STEEPEST = 0.7
    """The largest δ."""
    FAR = 0.1
    """The part of the lines that lean."""
    LEAST_ROOT = 1e-3
    """The least √(1 - C) of it."""

    def _steep(self, steep: mi.Float, others: mi.Float) -> mi.Float:
        return self.STEEPEST * dr.sqrt(dr.maximum(steep / (steep + others), EPSILON))

    def _steep_tan2(self, line: Line, v: mi.Float) -> mi.Float:
        return line.uniform(dr.square(v))

    def _steep_density(self, line: Line, facet: Facet) -> mi.Float:
        height = dr.maximum(versine(facet.cos_h, facet.sin2_h), 1e-12)  # at the normal there is no end
        return line.uniform_density() * 0.5 * dr.sqrt((1 - line.lowest) / height)

    def _part(self, lobe: FacetLobe, wi: mi.Vector3f, line: Line, leans: mi.Bool, v: mi.Float) -> mi.Float:
        is_far, rest = choose(v, self.FAR)
        m = super()._part(lobe, wi, line, leans, dr.select(leans, rest, v))
        root = dr.lerp(self._lowest_root(line), 1, rest)
        return dr.select(leans & is_far, (1 - root * root) / line.mass, m)

    def _outward_density(self, line: Line, facet: Facet) -> mi.Float:
        complement, least = line.complement(facet), self.LEAST_ROOT**2
        far = 0.5 * (1 + self._lowest_root(line)) * dr.rsqrt(dr.maximum(complement, least))
        far = dr.select(complement >= least, far, 0)
        return dr.lerp(super()._outward_density(line, facet), far, self.FAR)

    def _lowest_root(self, line: Line) -> mi.Float:
        return dr.sqrt(dr.maximum(line.rest, self.LEAST_ROOT**2))


def steep_facets(distribution: Distribution, wi: mi.Vector3f) -> mi.Float:
    """How many facets of the plane of incidence have a slope of at least one."""
    slope2 = dr.maximum(distribution.mean_square_slope_along(wi), EPSILON)
    return distribution.cdf(1, (wi.x * wi.x + wi.y * wi.y) / slope2)[1]
