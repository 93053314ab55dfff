"""Fresnel reflectances F(cosθ_d); each class holds its parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi

from ..math import Spectrum, leaving, luminance, safe_sqrt, square
from .forward import ForwardDirections
from .term import Term

if TYPE_CHECKING:
    from .distributions import Distribution


class Fresnel(Term):
    """A Fresnel reflectance, called with the cosine."""

    def __call__(self, cos: mi.Float) -> Spectrum:
        raise NotImplementedError(f"{type(self).__name__} does not define __call__.")

    def brightness(self, cos: mi.Float) -> mi.Float:
        """Return the approximate luminance of the reflectance, as one number for samplers."""
        return luminance(self(cos))

    def forward(self, distribution: Distribution, wi: mi.Vector3f) -> ForwardDirections | None:
        """Return the forward directions to draw besides half vectors, if there are such."""
        return None


class Unit(Fresnel):
    """F = 1."""

    def __call__(self, cos: mi.Float) -> mi.Float:
        return 1.0

    brightness = __call__


class Schlick(Fresnel):
    """F = f0 + (1 - f0)(1 - cosθ)⁵ (Schlick 1994, doi:10.1111/1467-8659.1330233)."""

    def __init__(self, f0: Spectrum) -> None:
        self.f0 = f0

    def __call__(self, cos: mi.Float) -> Any:
        m = dr.maximum(1 - cos, 0)
        m2 = m * m
        return self.f0 + (1 - self.f0) * (m2 * m2 * m)

    def brightness(self, cos: mi.Float) -> mi.Float:
        return Schlick(luminance(self.f0))(cos)


class Dielectric(Fresnel):
    """The exact unpolarized reflectance of a dielectric of relative index ``eta`` = interior / exterior, as Cook and
    Torrance write it (1982, doi:10.1145/357290.357293). Beyond the critical angle (eta < 1) it is 1."""

    LEAST, INSIDE = 0.01, 0.9
    """The least index, which reflects all light, and one that has a derivative."""

    def __init__(self, eta: mi.Float) -> None:
        self.eta = eta

    def __call__(self, cos: mi.Float) -> mi.Float:
        return leaving(self.LEAST, self.INSIDE, lambda eta: self._reflectance(eta, cos), self.eta)

    @staticmethod
    def _reflectance(eta: mi.Float, cos: mi.Float) -> mi.Float:
        step = eta * eta - 1
        g2 = step + cos * cos
        total = g2 <= 0
        g = dr.sqrt(dr.select(total, 1, g2))
        # (g - c) as (η² - 1)/(g + c), which keeps its digits near η = 1.
        difference = step / (g + cos)
        s = dr.square(difference / (g + cos))
        p = dr.square((cos * (g + cos) - 1) / (cos * difference + 1))
        return dr.select(total, 1, 0.5 * s * (1 + p))

    brightness = __call__

    def forward(self, distribution: Distribution, wi: mi.Vector3f) -> ForwardDirections:
        return ForwardDirections.of_facets(self, distribution, wi)


class Conductor(Fresnel):
    """The exact unpolarized reflectance of a conductor of relative complex index ``eta`` - i ``k``."""

    def __init__(self, eta: Spectrum, k: Spectrum) -> None:
        self.eta, self.k = eta, k

    def __call__(self, cos: mi.Float) -> Spectrum:
        cos2 = cos * cos
        sin2 = 1 - cos2
        # a + ib = sqrt((η - ik)² - sin²θ)
        eta2, k2 = self.eta * self.eta, square(self.k)
        real = eta2 - k2 - sin2
        modulus = safe_sqrt(real * real + 4 * eta2 * k2)
        a = safe_sqrt(0.5 * (modulus + real))
        even_s, odd_s = modulus + cos2, 2 * cos * a
        s = (even_s - odd_s) / (even_s + odd_s)
        even_p, odd_p = modulus * cos2 + sin2 * sin2, odd_s * sin2
        p = (even_p - odd_p) / (even_p + odd_p)
        return 0.5 * s * (1 + p)

    def brightness(self, cos: mi.Float) -> mi.Float:
        # Of channels that differ much the mean index may reflect next to nothing where they do.
        k2 = dr.square(self.k)
        normal = (dr.square(self.eta - 1) + k2) / (dr.square(self.eta + 1) + k2)
        return dr.maximum(Conductor(luminance(self.eta), luminance(self.k))(cos), 0.5 * luminance(normal))
