"""Fresnel reflectances F(cosθ_d); each class holds its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, TINY, Spectrum, leaving, luminance, safe_sqrt
from ..parameters import Colour, ConductorName, FresnelSet, Index, Number, Reflectance
from .forward import ForwardDirections
from .terms import Distribution, Fresnel


class Unit(Fresnel):
    """F = 1."""

    word = "none"

    def __call__(self, cos: mi.Float) -> mi.Float:
        return 1.0

    brightness = __call__

    def combination(self) -> tuple[Spectrum, ...]:
        return 1.0, 0.0


class Schlick(Fresnel):
    """F = f0 + (f90 - f0)(1 - cosθ)ᵖ, p = 5 and f90 = 1 (Schlick 1994, doi:10.1111/1467-8659.1330233), less a multiple
    of cosθ (1 - cosθ)⁶ such that f82 is the ratio to that at cosθ = 1/7, about 82° (P. Kutz, M. Hašan and D. Edmondson,
    Novel aspects of the Adobe Standard Material, 2021; OpenPBR 1.1)."""

    word = "schlick"
    needed = ("f0",)
    parameters = {
        "f0": Reflectance(None, "Schlick's approximation with this reflectance at normal incidence", role="fresnel"),
        "f82": Reflectance(None, "tint of this at 82°, as metals have; omitted by default", sought=False),
        "f90": Reflectance(None, "the reflectance at grazing; 1 if omitted", sought=False),
        "schlick_exponent": Number(None, (1, 20), "the exponent of Schlick's approximation; 5 if omitted",
                                   sought=False),
    }  # fmt: skip

    def __init__(
        self, f0: Spectrum, f82: Spectrum | None = None, f90: Spectrum | None = None, schlick_exponent: Any = None
    ) -> None:
        self.f0, self.f82, self.f90, self.exponent = f0, f82, f90, schlick_exponent

    def __call__(self, cos: mi.Float) -> Any:
        if self.f82 is None:
            return self.estimate(cos)
        m2 = dr.square(dr.maximum(1 - cos, 0))
        found = self.estimate(cos) - self._dip(self.f82) * (cos * m2 * m2 * m2)
        return dr.select(found < 0, 0, found)  # at 0 with its derivative, which leads out of black

    def _dip(self, f82: Spectrum) -> Spectrum:
        """Return the multiple."""
        cos = 1 / 7
        return (1 - f82) * self.estimate(mi.Float(cos)) / (cos * (1 - cos) ** 6)

    def estimate(self, cos: mi.Float) -> Any:
        m = dr.maximum(1 - cos, 0)
        if self.exponent is None:
            m2 = m * m
            power = m2 * m2 * m
        else:
            power = dr.power(dr.maximum(m, EPSILON), self.exponent)
        return self.f0 + ((1 if self.f90 is None else self.f90) - self.f0) * power

    def combination(self) -> tuple[Spectrum, ...]:
        if self.exponent is not None:
            return super().combination()
        rise = (1 if self.f90 is None else self.f90) - self.f0
        return (self.f0, rise) if self.f82 is None else (self.f0, rise, self._dip(self.f82))

    def brightness(self, cos: mi.Float) -> mi.Float:
        if self.f82 is not None:
            return super().brightness(cos)
        f90 = None if self.f90 is None else luminance(self.f90)
        return Schlick(luminance(self.f0), None, f90, self.exponent)(cos)


class Interface(Fresnel):
    """The smooth surface of a medium of the index ``eta`` - i ``k`` relative to the ``exterior``, which has an index,
    too."""

    eta: Spectrum
    k: Spectrum = 0.0
    exterior: mi.Float = 1.0

    def refracted(self, cos: mi.Float) -> tuple[Spectrum, Spectrum]:
        """Return a and b of a - ib = √(n² - sin²θ), where n is the index η - ik."""
        raise NotImplementedError(f"{type(self).__name__} does not define refracted.")

    def mueller(self, cos: mi.Float) -> tuple[Spectrum, ...]:
        """By Fresnel's equations, for fields ∝ exp(iωt) and p on the side of the facet's normal, r_p/r_s = (sin²θ -
        (a - ib) cosθ)/(sin²θ + (a - ib) cosθ) (D. Clarke, Stellar polarimetry, 2010, appendix A), so that B = (|r_s|² -
        |r_p|²)/2 and C + iS = r_p r_s* are to F as 2 a sin²θ cosθ, sin⁴θ - (a² + b²) cos²θ and 2 b sin²θ cosθ to
        sin⁴θ + (a² + b²) cos²θ."""
        f, (a, b) = self(cos), self.refracted(cos)
        sin2, a, b = 1 - cos * cos, a * cos, b * cos
        sin4, q2 = sin2 * sin2, a * a + b * b
        scale = f / (sin4 + q2)
        return f, 2 * sin2 * a * scale, (sin4 - q2) * scale, 2 * sin2 * b * scale


class Dielectric(Interface):
    """The exact unpolarized reflectance of a dielectric of relative index ``eta`` = interior / exterior, as Cook and
    Torrance write it (1982, doi:10.1145/357290.357293). Beyond the critical angle (eta < 1) it is 1."""

    word = "dielectric"
    parameters = {
        "int_ior": Index("bk7", "index of refraction of a dielectric, inside"),
        "ext_ior": Index("air", "index of refraction of what is outside it", sought=False),
    }
    LEAST, INSIDE = 0.01, 0.9
    """The least index, which reflects all light, and a relative one that has a derivative."""

    def __init__(self, interior: mi.Float, exterior: mi.Float = 1) -> None:
        self.interior, self.exterior, self.eta = interior, exterior, interior / exterior

    @classmethod
    def of_values(cls, values: Mapping[str, Any]) -> Dielectric:
        return cls(values["int_ior"], values["ext_ior"])

    def __call__(self, cos: mi.Float) -> mi.Float:
        inside = self.INSIDE * dr.detach(self.exterior)
        return leaving(self.LEAST, inside, lambda index: self._reflectance(index / self.exterior, cos), self.interior)

    def refracted(self, cos: mi.Float) -> tuple[mi.Float, mi.Float]:
        g2 = self.eta * self.eta - 1 + cos * cos
        return safe_sqrt(g2), safe_sqrt(-g2)

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
        # An index of 1 reflects nothing at grazing either.
        return dr.select(total, dr.select(step < 0, 1, 0), 0.5 * s * (1 + p))

    def critical(self) -> mi.Float:
        return safe_sqrt(1 - self.eta * self.eta)

    brightness = __call__

    def forward(self, distribution: Distribution, wi: mi.Vector3f) -> ForwardDirections:
        return ForwardDirections.of_facets(self, distribution, wi)


class Conductor(Interface):
    """The exact unpolarized reflectance of a conductor of relative complex index ``eta`` - i ``k``."""

    RANGES = {"eta": (0.01, 100), "k": (0, 100)}
    word = "conductor"
    needed: ClassVar[tuple[str, ...]] = ("eta", "k")
    parameters = {
        "eta": Colour(None, RANGES["eta"], "index of refraction η of a conductor, relative to the exterior",
                      role="fresnel"),
        "k": Colour(None, RANGES["k"], "its extinction coefficient k, relative to the exterior"),
    }  # fmt: skip

    INSIDE = 0.3
    """A coefficient k with a derivative at all angles."""

    def __init__(self, eta: Spectrum, k: Spectrum) -> None:
        self.eta, self.k = eta, k

    def __call__(self, cos: mi.Float) -> Spectrum:
        # Beyond the critical angle a k of 0 has a derivative.
        limit = dr.select(1 - cos * cos - self.eta * self.eta > 0, -1.0, 0.0)
        return leaving(limit, self.INSIDE, lambda k: self._reflectance(k, cos), self.k)

    def _reflectance(self, k: Spectrum, cos: mi.Float) -> Spectrum:
        a, _, modulus = self._refracted(k, cos)
        cos2 = cos * cos
        sin2 = 1 - cos2
        even_s, odd_s = modulus + cos2, 2 * cos * a
        # Rounding may leave less than 0, and an index of 1 has nothing but 0 at grazing.
        s = dr.maximum(even_s - odd_s, 0) / dr.maximum(even_s + odd_s, EPSILON)
        even_p, odd_p = modulus * cos2 + sin2 * sin2, odd_s * sin2
        p = (even_p - odd_p) / dr.maximum(even_p + odd_p, EPSILON)
        return 0.5 * s * (1 + p)

    def refracted(self, cos: mi.Float) -> tuple[Spectrum, Spectrum]:
        a, b, _ = self._refracted(self.k, cos)
        return a, b

    def _refracted(self, k: Spectrum, cos: mi.Float) -> tuple[Spectrum, Spectrum, Spectrum]:
        """Return a, b and a² + b² for a coefficient k."""
        eta2, k2 = self.eta * self.eta, k * k
        real = eta2 - k2 - (1 - cos * cos)
        modulus = safe_sqrt(real * real + 4 * eta2 * k2)
        # The smaller one of a and b as their product over the larger one, which keeps its digits.
        larger = dr.sqrt(dr.maximum(0.5 * (modulus + dr.abs(real)), TINY))
        smaller, steep = self.eta * k / larger, real > 0
        return dr.select(steep, larger, smaller), dr.select(steep, smaller, larger), modulus

    def brightness(self, cos: mi.Float) -> mi.Float:
        # Of channels that differ much the mean index may reflect almost nothing where they do.
        k2 = dr.square(self.k)
        normal = (dr.square(self.eta - 1) + k2) / (dr.square(self.eta + 1) + k2)
        return dr.maximum(Conductor(luminance(self.eta), luminance(self.k))(cos), 0.5 * luminance(normal))

    estimate = brightness  # which chooses lobes as well as three channels do


class NamedConductor(Conductor):
    """One of Mitsuba's conductors."""

    word = "material"
    needed = ()
    parameters = {"material": ConductorName(Conductor.RANGES, "a conductor by name; none means F = 1")}

    @classmethod
    def of_values(cls, values: Mapping[str, Any]) -> Any:
        return Conductor(*values["material"]) if values["material"] else Unit()


for _term in (Conductor, NamedConductor, Schlick, Dielectric, Unit):
    FresnelSet().add_term(_term)
