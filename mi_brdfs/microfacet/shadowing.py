"""Masking-shadowing terms G."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from ..math import TINY
from ..parameters import Choice, Number
from .facet import Cosines, Facet
from .sampling import MixedProposals, Pair, UniformDirections, clipped_normals
from .terms import Directions, Distribution, Fresnel, Term

MULTISCATTER = Choice(("none", "walk", "kulla-conty", "turquin"), "what becomes of light that facets reflect again")


class Shadowing(Term):
    """A masking-shadowing term, which returns G when called with a facet. Its attributes determine the lobe's sampler
    and estimated albedo (:class:`mi_brdfs.lobes.MicrofacetLobe`)."""

    UNIFORM = 0.05
    """The share of uniform directions at grazing, which tests/calibration/half_vectors.py fits."""
    lean: ClassVar[float] = 0
    """How far the facets visible at grazing angles lean towards the viewer: 0 as for V-cavities, 1 as for Smith's term,
    4 for one without end."""
    smithian: ClassVar[bool] = False
    """Whether facets are seen about as under Smith's masking, so that a distribution's visible normals suit."""
    favours_steep: ClassVar[bool] = False
    """Whether G cosθ_d/(cosθ_i cosθ_h) has no bound, so that at grazing few steep facets may reflect most of all,
    whatever the distribution."""
    reciprocal: ClassVar[bool] = True
    """Whether G is symmetric in wi and wo."""
    conserving: ClassVar[bool] = False
    """Whether all light that G removes is lost to further reflections, about as much as
    :meth:`.distributions.Distribution.estimated_albedo` says. Only then may G depend on more than the cosines of a
    facet."""

    @classmethod
    def suits(cls, distribution: type[Distribution]) -> bool:
        """Return whether it is known for a distribution."""
        return True

    @classmethod
    def of_values(cls, values: Mapping[str, Any], distribution: Distribution | None = None) -> Shadowing:
        """Return the term for given values of its parameters, and the distribution that it is to go with."""
        return super().of_values(values)

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        raise NotImplementedError(f"{type(self).__name__} does not define __call__.")

    def sampler(
        self, distribution: Distribution, fresnel: Fresnel, wi: mi.Vector3f, reflect: Callable[[Facet], mi.Float]
    ) -> Directions:
        """Return what to draw directions from, for facets that ``reflect`` F G, as one number. Override it to bring
        another sampler."""
        visible = distribution.visible_normals(wi) if self.smithian else None
        pair = Pair(visible or clipped_normals(distribution, fresnel, wi, self.lean), reflect)
        # Few steep facets may reflect more than all others: uniform directions bound their weights.
        if visible is None and (self.favours_steep or (self.lean and distribution.long_tailed)):
            return MixedProposals(pair, UniformDirections(), self.UNIFORM * dr.square(dr.square(1 - wi.z)))
        return pair


class Smith(Shadowing):
    """Smith's term, with Λ defined by the ``stretched`` cosines,

    * separable, 1/((1 + Λ(wi))(1 + Λ(wo))) (Smith 1967, doi:10.1109/TAP.1967.1138991; Walter et al. 2007,
      doi:10.2312/EGWR/EGSR07/195-206);
    * height-correlated, 1/(1 + Λ(wi) + Λ(wo)) (Heitz 2014, https://jcgt.org/published/0003/02/03/).
    """

    lean = 1
    smithian = True
    conserving = True

    facets: ClassVar[str]
    """Whose walks are tabulated (:mod:`.escape`)."""

    def __init__(self, alpha_u: mi.Float, alpha_v: mi.Float, correlated: bool) -> None:
        self.alpha_u, self.alpha_v, self.correlated = alpha_u, alpha_v, correlated

    def slope2(self, v: mi.Vector3f) -> mi.Float:
        """Return (αu v_x)² + (αv v_y)²."""
        return dr.square(self.alpha_u * v.x) + dr.square(self.alpha_v * v.y)

    def length(self, v: mi.Vector3f) -> mi.Float:
        """Return √((αu v_x)² + (αv v_y)² + v_z²), the length of v in the space stretched by α."""
        return dr.sqrt(self.slope2(v) + v.z * v.z)

    def stretched(self, v: mi.Vector3f) -> mi.Float:
        """Return v_z (1 + 2Λ(v)), which stays finite at the horizon."""
        raise NotImplementedError

    def __call__(self, facet: Any) -> mi.Float:
        cos_i, cos_o = facet.cos_i, facet.cos_o
        length_i, length_o = self.stretched(facet.wi), self.stretched(facet.wo)
        if self.correlated:
            return 2 * cos_i * cos_o / (cos_i * length_o + cos_o * length_i)
        return (2 * cos_i / (cos_i + length_i)) * (2 * cos_o / (cos_o + length_o))


class SmithGGX(Smith):
    """Λ = ½(√(1 + 1/a²) - 1) with 1/a² = ((αu v_x)² + (αv v_y)²)/v_z²: exact for GGX."""

    facets = "ggx"

    stretched = Smith.length


class SmithBeckmann(Smith):
    """Λ = ½(exp(-a²)/(a √π) - erfc(a)), a as for GGX: exact for Beckmann's distribution.

    That is ½ i(a)/a, where i(a) = exp(-a²)/√π - a erfc(a), the integral of erfc from a on, is fitted by an eighth power
    to 3e-8 (tests/calibration/smith_beckmann.py), in a tenth of the time of the error function and the exponential.
    """

    facets = "beckmann"

    FIT = (1, 0.221556308, 0.0959011886, 0.0280231588, 5.94910138e-3, 9.66725376e-4, 6.13396596e-4, -1.03606616e-4,
           4.20437499e-5)  # fmt: skip

    def stretched(self, v: mi.Vector3f) -> mi.Float:
        slope = dr.sqrt(dr.maximum(self.slope2(v), TINY))
        a = dr.minimum(v.z / slope, 10)
        root = dr.rcp(functools.reduce(lambda sum, factor: sum * a + factor, reversed(self.FIT)))
        return v.z + slope * dr.inv_sqrt_pi * dr.square(dr.square(dr.square(root)))


class SmithRational(Smith):
    """Walter et al.'s rational approximation of Beckmann's Λ, which they use for Blinn's distribution, too, with
    a = √(n/2 + 1) cosθ/sinθ: 1 + Λ = (1 + 2.276 a + 2.577 a²)/(3.535 a + 2.181 a²) for a < 1.6, and 1 otherwise."""

    facets = "blinn"

    def stretched(self, v: mi.Vector3f) -> mi.Float:
        slope = dr.sqrt(dr.maximum(self.slope2(v), TINY))
        a = dr.minimum(v.z / slope, 1.6)
        rational = 2 * slope * (1 - 1.259 * a + 0.396 * a * a) / (3.535 + 2.181 * a)
        return v.z + dr.select(a < 1.6, rational, 0)


class SmithOfDistribution(Shadowing):
    """The separable Smith term that belongs to a distribution."""

    word = "smith"
    parameters = {"multiscatter": MULTISCATTER}
    correlated: ClassVar[bool] = False

    @classmethod
    def suits(cls, distribution: type[Distribution]) -> bool:
        return distribution.smith is not Distribution.smith

    @classmethod
    def of_values(cls, values: Mapping[str, Any], distribution: Any = None) -> Any:
        return distribution.smith(cls.correlated)


class CorrelatedSmithOfDistribution(SmithOfDistribution):
    """The height-correlated one."""

    word = "smith-correlated"
    correlated = True


class RationalSmithOfBeckmann(SmithRational):
    """The separable one of Beckmann's facets by that approximation, as Mitsuba's ``roughconductor`` has it."""

    word = "smith-rational"

    @classmethod
    def suits(cls, distribution: type[Distribution]) -> bool:
        return distribution.word == "beckmann"

    @classmethod
    def of_values(cls, values: Mapping[str, Any], distribution: Any = None) -> Any:
        return cls(distribution.alpha_u, distribution.alpha_v, False)


class SchlickSmith(Shadowing):
    """Schlick's rational approximation of Smith's term, Π cosθ/(cosθ (1-k) + k) over both directions (Schlick 1994,
    doi:10.1111/1467-8659.1330233), with k = α √(2/π) for Beckmann facets and k = α/2 for GGX (Karis 2013)."""

    word = "schlick"
    lean = 2
    smithian = True

    def __init__(self, k: mi.Float) -> None:
        self.k = k

    @classmethod
    def suits(cls, distribution: type[Distribution]) -> bool:
        return distribution.roughness is not Distribution.roughness

    @classmethod
    def of_values(cls, values: Mapping[str, Any], distribution: Any = None) -> Any:
        return cls(math.sqrt(2 / math.pi) * distribution.roughness())

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        i, o = (cos / (cos + self.k * (1 - cos)) for cos in (facet.cos_i, facet.cos_o))
        return i * o


class Kelemen(Shadowing):
    """cosθ_i cosθ_o / cos²θ_d (Kelemen and Szirmay-Kalos, A microfacet based coupled specular-matte BRDF model with
    importance sampling, Eurographics short presentations, 2001)."""

    word = "kelemen"
    conserving = True

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return facet.cos_i * facet.cos_o / dr.square(facet.cos_d)


class VCavity(Shadowing):
    """min(1, 2 cosθ_h cosθ_i / cosθ_d, 2 cosθ_h cosθ_o / cosθ_d) (Torrance and Sparrow 1967; Cook and Torrance 1982,
    doi:10.1145/357290.357293)."""

    word = "vcavity"
    conserving = True

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return dr.minimum(1, 2 * facet.cos_h * dr.minimum(facet.cos_i, facet.cos_o) / facet.cos_d)


class Implicit(Shadowing):
    """cosθ_i cosθ_o, which cancels the denominator."""

    word = "implicit"
    lean = 4

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return facet.cos_i * facet.cos_o


class Neumann(Shadowing):
    """cosθ_i cosθ_o / max(cosθ_i, cosθ_o) (Neumann, Neumann and Szirmay-Kalos, Compact metallic reflectance models,
    Computer Graphics Forum 18(3), 1999)."""

    word = "neumann"
    lean = 1
    favours_steep = True
    UNIFORM = 0.2  # of all terms it shadows steep facets least

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return dr.minimum(facet.cos_i, facet.cos_o)


class AshikhminPremoze(Shadowing):
    """cosθ_i cosθ_o / (cosθ_i + cosθ_o - cosθ_i cosθ_o) (Ashikhmin and Premoze, Distribution-based BRDFs, 2007)."""

    word = "ashikhmin-premoze"
    lean = 1
    favours_steep = True

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        i, o = facet.cos_i, facet.cos_o
        return i * o / (i + o - i * o)


class AshikhminShirleyShadowing(Shadowing):
    """cosθ_i cosθ_o / (cosθ_d max(cosθ_i, cosθ_o)) (Ashikhmin and Shirley 2000,
    doi:10.1080/10867651.2000.10487522)."""

    word = "ashikhmin-shirley"
    favours_steep = True

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return dr.minimum(facet.cos_i, facet.cos_o) / facet.cos_d


class KurtShadowing(Shadowing):
    """(cosθ_i cosθ_o)^(1-κ) / cosθ_d (Kurt, Szirmay-Kalos and Křivánek 2010, doi:10.1145/1722991.1722996)."""

    word = "kurt"
    parameters = {"kurt_exponent": Number(0.25, (0, 0.5), "exponent κ: the higher, the brighter at grazing")}
    lean = 1

    def __init__(self, kurt_exponent: mi.Float) -> None:
        self.exponent = kurt_exponent

    def __call__(self, facet: Facet | Cosines) -> mi.Float:
        return dr.power(facet.cos_i * facet.cos_o, 1 - self.exponent) / facet.cos_d
