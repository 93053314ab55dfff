"""Thin films, whose reflections interfere."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import EPSILON, Spectrum, clamp, luminance
from ..observer import observer
from ..parameters import Number, ParameterError
from ..parameters.parameter import Quantity
from .fresnel import Interface, Unit
from .terms import Fresnel

Complex = tuple[Any, Any]
"""Real and imaginary part."""


class Thickness(Number):
    """A thickness in nanometres. Evaluated in spectral variants, that in parts of the wavelengths of the ray."""

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        return [(Quantity(self.names[0], self.limits, None, self.text, usual=(0, 1000), sought=False),)]

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        thickness = super().evaluate(si, active)
        if thickness is None or not mi.is_spectral:
            return thickness
        return thickness / dr.maximum(si.wavelengths, 1)  # which inactive lanes lack


INDEX = 1.5
FILM_THICKNESS = Thickness(
    None, (0, 2000), "thickness in nm of a film on the conductor or dielectric; omitted by default", sought=False
)
FILM_IOR = Number(None, (1, 4), f"index of refraction of that film; {INDEX} if omitted", sought=False)


def filmed(model: Any, p: Any) -> Fresnel:
    """Return the Fresnel term of a model, under a film where ``p.film_thickness`` is given, of index ``p.film_ior``."""
    if p.film_thickness is None or isinstance(p.fresnel, Unit):  # which reflects all that any film lets through
        return p.fresnel
    if not isinstance(p.fresnel, Interface):
        raise ParameterError(
            f"{model.plugins[0]}: film_thickness needs a conductor or a dielectric beside it; give eta and k, "
            "material, or int_ior."
        )
    return Film(p.fresnel, INDEX if p.film_ior is None else p.film_ior, p.film_thickness)


class Film(Fresnel):
    r"""The exact unpolarized reflectance of a film of index n and thickness d between the exterior and a dielectric or
    conductor, after L. Belcour and P. Barla, A practical extension to microfacet theory for the modeling of varying
    iridescence, ACM Transactions on Graphics 36(4), 2017, doi:10.1145/3072959.3073620: for s and p, with the amplitudes
    a and b that its upper and its lower face reflect, the sum over all paths in the film (G. B. Airy 1833),

        r = (a + b e)/(1 + a b e) = a + (1 - a²) b h,  h = e/(1 + a b e),  e = exp(-4πi n d cosθ_t/λ)

    It is a series in e. So is |r|² with its conjugate, and that depends on h alone,

        |r|² = 1 - (1 - a²)(1 - |b|²)/(1 - a²|b|²) (1 - 2 a Re(b h))

    In spectral variants λ are the wavelengths of the ray. In rgb variants each channel is the integral over them, under
    D65, with the conductor's η and k of that channel, within [0, 1]: that is ⟨h⟩ in the place of h, a sum over
    :func:`waves`. In mono variants it is that of the luminance. An index lower than the exterior's is taken for it.
    """

    def __init__(self, base: Interface, index: Any, thickness: Any) -> None:
        self.base, self.index = base, clamp(index / base.exterior, 1, dr.inf)
        self.thickness = thickness * base.exterior

    def __call__(self, cos: mi.Float) -> Spectrum:
        s, p = self._faces(cos)
        return dr.clip(0.5 * (s.reflectance() + p.reflectance()), 0, 1)

    def estimate(self, cos: mi.Float) -> Spectrum:
        # Interference may leave nothing at one angle.
        return dr.maximum(self(cos), 0.1 * self.brightness(cos))

    def brightness(self, cos: mi.Float) -> mi.Float:
        """The mean over all phases."""
        s, p = self._faces(cos, interfering=False)
        return luminance(0.5 * (s.reflectance() + p.reflectance()))

    def mueller(self, cos: mi.Float) -> tuple[Spectrum, ...]:
        s, p = self._faces(cos)
        b, product = 0.5 * (s.reflectance() - p.reflectance()), p.times_conjugate(s)
        f = self(cos)
        # Colours outside sRGB are limited, and so is their polarization.
        scale = dr.minimum(f * dr.rsqrt(dr.maximum(b * b + _square(product), EPSILON)), 1)
        return f, b * scale, product[0] * scale, product[1] * scale

    def _faces(self, cos: mi.Float, interfering: bool = True) -> tuple[Faces, Faces]:
        """Return the film's faces as s and p meet them."""
        n2, (a, b) = self.index * self.index, self.base.refracted(cos)
        normal = dr.sqrt(dr.maximum(n2 - 1 + cos * cos, EPSILON))  # n cosθ_t
        waves = list(self._waves(normal)) if interfering else []
        eta2, k2 = self.base.eta * self.base.eta, self.base.k * self.base.k
        steep = normal / n2
        s = Faces((cos, 0), (normal, 0), (normal, 0), (a, -b), waves)
        lower = (eta2 - k2) * steep, -2 * self.base.eta * self.base.k * steep
        return s, Faces((cos * n2, 0), (normal, 0), lower, (a, -b), waves)

    def _waves(self, normal: mi.Float) -> Iterator[tuple[Complex, Complex]]:
        """Yield weights and e, whose weighted mean is that of a function of e."""
        path = 2 * normal * self.thickness
        if mi.is_spectral:
            sin, cos = dr.sincos(dr.two_pi * path)
            yield (1, 0), (cos, -sin)
            return
        for rate, colour in waves():
            sin, cos = dr.sincos(rate.imag * path)
            decay = dr.exp(rate.real * path)
            weights = (mi.Color3f(*part.tolist()) for part in (colour.real, colour.imag))
            real, imaginary = (it if mi.is_rgb else mi.luminance(it) for it in weights)
            yield (real, imaginary), (decay * cos, decay * sin)


class Faces:
    """The two faces of a film: their amplitudes a and b, of the form (u - v)/(u + v), and b ⟨h⟩ over some waves."""

    def __init__(self, u: Complex, v: Complex, u_below: Complex, v_below: Complex, waves: list[Any]) -> None:
        (self.a, _), self.through = _amplitude(u, v)
        self.b, below = _amplitude(u_below, v_below)
        self.kept = self.through * below / dr.maximum(self.through + below - self.through * below, EPSILON)
        around, imaginary = self.a * self.b[0], self.a * self.b[1]
        square = around * around + imaginary * imaginary
        total: Complex = (0, 0)
        for weight, e in waves:
            # h = (e + |e|² (a b)*)/|1 + a b e|²
            e2 = _square(e)
            real = 1 + 2 * (around * e[0] - imaginary * e[1]) + square * e2
            scale = dr.rcp(dr.maximum(real, EPSILON))
            term = _times(weight, ((e[0] + e2 * around) * scale, (e[1] - e2 * imaginary) * scale))
            total = total[0] + term[0], total[1] + term[1]
        self.bh = _times(self.b, total)

    def reflectance(self) -> Spectrum:
        return 1 - self.kept * (1 - 2 * self.a * self.bh[0])

    def times_conjugate(self, s: Faces) -> Complex:
        """Return ⟨r_p r_s*⟩, for p these: the product of both series."""
        g, conjugate = self.bh, (s.bh[0], -s.bh[1])
        both = _times(self.b, (s.b[0], -s.b[1]))
        rest = 1 - self.a * g[0] - s.a * conjugate[0], -self.a * g[1] - s.a * conjugate[1]
        divisor = 1 - self.a * s.a * both[0], self.a * s.a * both[1]  # of which this is the conjugate
        product = _times(_times(both, rest), divisor)
        through = self.through * s.through / dr.maximum(_square(divisor), EPSILON)
        once = self.a * s.through, s.a * self.through
        return (
            self.a * s.a + once[0] * conjugate[0] + once[1] * g[0] + through * product[0],
            once[0] * conjugate[1] + once[1] * g[1] + through * product[1],
        )


def _amplitude(u: Complex, v: Complex) -> tuple[Complex, Any]:
    """Return r = (u - v)/(u + v), and 1 - |r|²."""
    sum2 = dr.maximum(_square((u[0] + v[0], u[1] + v[1])), EPSILON)
    across = u[1] * v[0] - u[0] * v[1]  # Im(u v*)
    return ((_square(u) - _square(v)) / sum2, 2 * across / sum2), 4 * (u[0] * v[0] + u[1] * v[1]) / sum2


def _square(z: Complex) -> Any:
    return z[0] * z[0] + z[1] * z[1]


def _times(z: Complex, w: Complex) -> Complex:
    return z[0] * w[0] - z[1] * w[1], z[0] * w[1] + z[1] * w[0]


COUNT, STEP, FARTHEST = 7, 100, 9000
"""How many waves there are, and at which path differences in nm they are fitted: beyond, channels have no contrast."""


@functools.cache
def waves() -> list[tuple[complex, np.ndarray]]:
    """Return rates p and colours A whose sum Σ A exp(p L) is the colour that the path difference L, in nm, makes of
    white light: the mean of exp(-2πi L/λ) over the sRGB channels under D65, to .01, and 1 for L = 0.

    By the rotations between neighbours among the leading singular vectors of the Hankel matrix (R. Roy and T. Kailath,
    ESPRIT, 1989, doi:10.1109/29.32276). A mean over e that ends with such waves needs no more of them for a high
    finesse, as one over wavelengths does.
    """
    wavelengths, weights = observer()
    paths = np.arange(0, FARTHEST + 1, STEP)
    colours = np.exp(-2j * np.pi * paths[:, None] / wavelengths) @ weights
    windows = np.lib.stride_tricks.sliding_window_view(colours, len(paths) // 2, axis=0)
    leading = np.linalg.svd(windows.reshape(-1, len(paths) // 2))[2][:COUNT].T
    rates = np.log(np.linalg.eigvals(np.linalg.pinv(leading[:-1]) @ leading[1:])) / STEP
    found = np.linalg.lstsq(np.exp(np.outer(paths, rates)), colours, rcond=None)[0]
    return [(complex(rate), colour) for rate, colour in zip(rates, found / found.sum(axis=0), strict=True)]
