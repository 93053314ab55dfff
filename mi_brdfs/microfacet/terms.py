"""What the terms of a microfacet model are: distributions (D), shadowing terms (G), Fresnel reflectances (F), and the
proposals that samplers are made of."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import Spectrum, gauss_legendre, luminance
from ..parameters import Number, Parameter
from .facet import Facet

T = TypeVar("T", bound="Term")

ROUGHNESS = Number(0.1, (1e-4, 2), "roughness α of the facets")


class Term:
    """A term of a microfacet model. :func:`mi_brdfs.register` adds it to ``microfacet`` under its ``word``."""

    word: ClassVar[str | None] = None
    """Its word in the kit."""
    parameters: ClassVar[Mapping[str, Parameter]] = {}
    """The declarations that go with the word, by name. The class is called with their values by name; an anisotropic
    one comes as NAME_u and NAME_v."""
    needed: ClassVar[tuple[str, ...]] = ()
    """The names of those without which the others mean nothing."""

    @classmethod
    def of_values(cls: type[T], values: Mapping[str, Any]) -> T:
        """Return the term for given values of its parameters."""
        spread: dict[str, Any] = {}
        for name, value in values.items():
            spread |= {f"{name}_u": value[0], f"{name}_v": value[1]} if isinstance(value, tuple) else {name: value}
        return cls(**spread)


class Distribution(Term):
    """A distribution of two roughnesses, αu along dp_du and αv across: anisotropic, unless both are the same object."""

    LOSS = 1.7
    """How much light is lost to multiple reflections, which tests/calibration/estimated_albedo.py fits."""
    long_tailed = False
    """Whether there are many more steep facets than a Gaussian distribution of slopes has."""

    def __init__(self, alpha_u: mi.Float, alpha_v: mi.Float) -> None:
        self.alpha_u, self.alpha_v = alpha_u, alpha_v
        self.anisotropic = alpha_u is not alpha_v

    def unstretched(self, facet: Facet) -> mi.Vector3f:
        """(h_x/αu, h_y/αv, h_z), with reciprocals that Dr.Jit computes once for all facets."""
        return mi.Vector3f(facet.h.x * dr.rcp(self.alpha_u), facet.h.y * dr.rcp(self.alpha_v), facet.h.z)

    def steepness(self, facet: Facet) -> mi.Float:
        """(h_x/αu)² + (h_y/αv)²."""
        h = self.unstretched(facet)
        return h.x * h.x + h.y * h.y

    def mean_square_slope(self) -> mi.Float:
        """About the mean square slope, over both axes."""
        return 0.5 * (dr.square(self.alpha_u) + dr.square(self.alpha_v))

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        """The same along a direction, times sin²θ of that."""
        return dr.square(self.alpha_u * v.x) + dr.square(self.alpha_v * v.y)

    def estimated_albedo(self, cos: mi.Float) -> mi.Float:
        """An estimate, to some 20 %, of the albedo that facets with F = 1 and a shadowing term that conserves energy
        have in the direction of that cosine."""
        r2 = self.mean_square_slope()
        return 1 / (1 + self.LOSS * r2 * dr.sqrt(dr.sqrt(dr.sqrt(r2))) * (0.5 + 0.5 * cos))

    def roughness(self) -> Any:
        """The α that Schlick's stand-in for Smith's shadowing goes by, or None if there is no such."""
        return None

    def widened(self, spread: mi.Float) -> Distribution:
        """Return the same facets with the roughness √α' = √α + ``spread`` (1 - √α); a rougher one than 1 stays."""
        raise NotImplementedError(f"{type(self).__name__} does not define widened.")

    def smith(self, correlated: bool) -> Any:
        """Smith's shadowing term that belongs to this distribution, or None if that is not known."""
        return None

    def visible_normals(self, wi: mi.Vector3f) -> HalfVectors | None:
        """Return the half vectors that ``wi`` sees under Smith's masking, or None if there is no sampler of them."""
        return None

    def eval(self, facet: Facet) -> mi.Float:
        """D(h)."""
        raise NotImplementedError(f"{type(self).__name__} does not define eval.")

    def density(self, facet: Facet, g: mi.Float) -> mi.Float:
        """q(h); by default D cosθ_h."""
        return self.eval(facet) * facet.cos_h

    def cdf(self, tan2: mi.Float, g: mi.Float) -> tuple[mi.Float, mi.Float]:
        """``(C, 1 - C)``: the cumulative distribution in t on the line, to 1e-7, and its complement with digits of its
        own."""
        raise NotImplementedError(f"{type(self).__name__} does not define cdf.")

    def inverse_cdf(self, c: mi.Float, complement: mi.Float, g: mi.Float) -> mi.Float:
        """The t of a ``cdf`` value."""
        raise NotImplementedError(f"{type(self).__name__} does not define inverse_cdf.")


def widened_roughness(alpha: mi.Float, spread: mi.Float) -> mi.Float:
    """Return the α' of :meth:`Distribution.widened`."""
    root = dr.sqrt(alpha)
    return dr.square(root + spread * dr.maximum(1 - root, 0))


class Isotropic(Distribution):
    """A distribution whose own parameters replace the roughness."""

    def __init__(self) -> None:
        one = mi.Float(1)
        super().__init__(one, one)

    def mean_square_slope_along(self, v: mi.Vector3f) -> mi.Float:
        return self.mean_square_slope() * (v.x * v.x + v.y * v.y)


class Fresnel(Term):
    """A Fresnel reflectance, called with the cosine."""

    def __call__(self, cos: mi.Float) -> Spectrum:
        raise NotImplementedError(f"{type(self).__name__} does not define __call__.")

    def estimate(self, cos: mi.Float) -> Spectrum:
        """Return about the reflectance; it must not vanish at one angle alone."""
        return self(cos)

    def brightness(self, cos: mi.Float) -> mi.Float:
        """Return the approximate luminance of the reflectance, as one number for samplers."""
        return luminance(self(cos))

    def critical(self) -> Any:
        """Return the cosine up to which all light is reflected."""
        return 0.0

    def combination(self) -> tuple[Spectrum, ...]:
        """Return a, b and c of a + b (1 - cosθ)⁵ - c cosθ (1 - cosθ)⁶, or a and b where c is 0, as for Schlick's
        reflectance. That of conductors (Lazányi and Szirmay-Kalos 2005) and others is replaced by the one nearest to it
        over a hemisphere, which has its mean."""
        critical, coefficients = self.critical(), [0.0, 0.0, 0.0]
        # Total reflection begins with a kink: the angles before and beyond it have nodes of their own.
        for node, weight in gauss_legendre(4):
            steep, grazing = critical + (1 - critical) * node, critical * node
            for cos, f in (steep, (1 - critical) * self(mi.Float(steep))), (grazing, critical):
                functions = basis(cos)
                weights = (
                    cos * weight * sum(c * it for c, it in zip(row, functions, strict=True)) for row in _inverse()
                )
                coefficients = [it + f * w for it, w in zip(coefficients, weights, strict=True)]
        normal, rise, raised = coefficients
        return normal, rise, -raised

    @staticmethod
    def mean(combination: Sequence[Spectrum], schlick: Any, dip: Any, most: float = 1) -> Spectrum:
        """Return the mean reflectance, up to ``most``, of facets over which (1 - cosθ)⁵ has the mean ``schlick``, and
        cosθ (1 - cosθ)⁶ the mean ``dip``."""
        normal, rise, *below = combination
        mean = normal + rise * schlick
        return dr.clip(mean - below[0] * dip if below else mean, 0, most)

    def mueller(self, cos: mi.Float) -> tuple[Spectrum, ...] | None:
        """Return ``(F, B, C, S)``, of which a facet's Mueller matrix consists if Stokes vectors have their first axis
        along s, perpendicular to the plane of incidence; or None, the default, if the facet depolarises.

            ⎛ F  B  0  0 ⎞
            ⎜ B  F  0  0 ⎟
            ⎜ 0  0  C -S ⎟
            ⎝ 0  0  S  C ⎠
        """
        return None

    def forward(self, distribution: Distribution, wi: mi.Vector3f) -> Any:
        """Return the forward directions to draw besides half vectors, if there are such."""
        return None


def basis(cos: Any) -> tuple[Any, Any, Any]:
    """Return 1, (1 - cosθ)⁵ and cosθ (1 - cosθ)⁶."""
    m = 1 - cos
    m5 = m * m * m * m * m
    return 1.0, m5, cos * m * m5


@functools.cache
def _inverse() -> list[list[float]]:
    """Return the inverse of the products of these over a hemisphere, by which least squares go."""
    cos, weight = np.array(gauss_legendre(4)).T
    functions = np.stack(np.broadcast_arrays(*basis(cos)))
    return np.linalg.inv(functions * (cos * weight) @ functions.T).tolist()


class Directions(Protocol):
    """A proposal of directions for one ``wi``."""

    def draw(self, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        """Draw a ``wo`` from three uniform variates."""
        ...

    def pdf(self, facet: Facet) -> mi.Float:
        """Return the density per solid angle with which ``facet.wo``, above the horizon, is drawn."""


class HalfVectors(Protocol):
    """A proposal of half vectors for one ``wi``, in which each has an image: in a measure of its own both are equally
    dense."""

    def draw(self, v: mi.Point2f) -> tuple[Facet, Facet]:
        """Draw a facet from two uniform variates, and return it with its image."""

    def pdf(self, facet: Facet) -> mi.Float:
        """Return the density per solid angle with which ``facet.wo`` is drawn."""

    def image(self, facet: Facet) -> Facet:
        """Return the image, whose own image is the facet."""

    def weight(self, facet: Facet) -> mi.Float:
        """Return D over the density, up to a factor that a facet and its image share."""
