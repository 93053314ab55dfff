"""Thin films, whose reflections interfere."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..math import EPSILON, SMALL, Spectrum, clamp, leaving, luminance, safe_sqrt
from ..observer import observer
from ..parameters import Number, ParameterError
from ..parameters.parameter import Quantity
from .forward import ForwardDirections
from .fresnel import Dielectric, Interface, Unit
from .terms import Distribution, Fresnel


class Thickness(Number):
    """A thickness in nanometres. Evaluated in spectral variants, that in parts of the wavelengths of the ray."""

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        # Each order of interference is a valley of its own, on either side of the index below.
        return [(Quantity(self.names[0], self.limits, None, self.text, usual=(0, 1000), sought=False, starts=256),)]

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        thickness = super().evaluate(si, active)
        if thickness is None or not mi.is_spectral:
            return thickness
        return thickness / dr.maximum(si.wavelengths, 1)  # which inactive lanes lack


INDEX = 1.4
"""That of OpenPBR's films."""
FILM_THICKNESS = Thickness(
    None, (0, 2000), "thickness in nm of a film on the conductor or dielectric; omitted by default", sought=False
)
FILM_IOR = Number(
    None, (1, 4), f"index of refraction of that film; {INDEX} if omitted", sought=False, beside="film_thickness"
)


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
    r"""The exact unpolarized reflectance of a film of index n and thickness d on a dielectric or conductor, after
    L. Belcour and P. Barla, A practical extension to microfacet theory for the modeling of varying iridescence, ACM
    Transactions on Graphics 36(4), 2017, doi:10.1145/3072959.3073620. For s and p each, where the upper face of the
    film reflects the amplitude a and the lower one b, the sum over all paths in the film (G. B. Airy 1833) is

        r = (a + b e)/(1 + a b e),    e = exp(-4πi n d cosθ_t/λ)

    In spectral variants λ are the wavelengths of the ray. In rgb variants each channel is the mean of |r|² over them,
    as seen by the CIE 1931 observer under D65, with the conductor's η and k of that channel, and limited to [0, 1]; in
    mono variants, that for the luminance. Of all that depends on e, |r|² has only h in it, and linearly:

        r = a + (1 - a²) b h,    h = e/(1 + a b e)
        |r|² = 1 - (1 - a²)(1 - |b|²)/(1 - a²|b|²) (1 - 2 a Re(b h))

    So its mean takes that of h, which :func:`waves` make a short sum. A film's index below the exterior's, from which
    light would be totally reflected, is taken for that.
    """

    def __init__(self, base: Interface, index: Any, thickness: Any) -> None:
        exterior = dr.detach(base.exterior)
        # Below the exterior's index only that of the film has a derivative, which leads back.
        relative = dr.select(index < exterior, 1, exterior / base.exterior)
        self.base, self.index = base, clamp(index / exterior, 1, dr.inf) * relative
        self.thickness = thickness * base.exterior

    def __call__(self, cos: mi.Float) -> Spectrum:
        # Over what absorbs nothing derivatives vanish at 0: take those at 30 nm, or of light of 600 nm.
        limit, inside = dr.select(dr.max(self.base.k) > 0, -1, 0), 0.05 if mi.is_spectral else 30
        return leaving(limit, inside, lambda it: self._unpolarized(*self._polarized(cos, it)), self.thickness)

    def estimate(self, cos: mi.Float) -> Spectrum:
        # Interference may leave nothing at one angle.
        return dr.maximum(self(cos), 0.1 * self.brightness(cos))

    def critical(self) -> Any:
        return self.base.critical()

    def brightness(self, cos: mi.Float) -> mi.Float:
        """The mean over all phases, or at least the rounding error of the reflectance."""
        return dr.maximum(luminance(self._unpolarized(*self._polarized(cos, None))), 1e-7)

    def forward(self, distribution: Distribution, wi: mi.Vector3f) -> ForwardDirections | None:
        """Those of the dielectric that reflects as much at normal incidence: thin films between like media reflect most
        at grazing, too."""
        if not isinstance(self.base, Dielectric):
            return None
        amplitude = safe_sqrt(luminance(self(mi.Float(1))))
        return Dielectric((1 + amplitude) / dr.maximum(1 - amplitude, SMALL)).forward(distribution, wi)

    def mueller(self, cos: mi.Float) -> tuple[Spectrum, ...]:
        s, p = self._polarized(cos, self.thickness)
        f, b, product = self._unpolarized(s, p), 0.5 * (s.reflectance() - p.reflectance()), p.times_conjugate(s)
        # Colours outside sRGB are limited, and so is their polarization.
        scale = dr.minimum(f * dr.rsqrt(dr.maximum(b * b + product.square(), EPSILON)), 1)
        return f, b * scale, product.real * scale, product.imag * scale

    @staticmethod
    def _unpolarized(s: Airy, p: Airy) -> Spectrum:
        return dr.clip(0.5 * (s.reflectance() + p.reflectance()), 0, 1)

    def _polarized(self, cos: mi.Float, thickness: Any) -> tuple[Airy, Airy]:
        """Return how s and p are reflected, without a thickness in the mean over all phases: the amplitude at a face is
        (u - v)/(u + v), where u and v are n cosθ above and below for s, and for p the same over n²."""
        n2, (a, b) = self.index * self.index, self.base.refracted(cos)
        film, below = dr.sqrt(dr.maximum(n2 - 1 + cos * cos, EPSILON)), Complex(a, -b)
        eta, k = self.base.eta, self.base.k
        ratio = Complex(eta * eta - k * k, -2 * eta * k) * (film / n2)
        waves = None if thickness is None else Waves(2 * film * thickness)
        return Airy((cos, film), (Complex(film), below), waves), Airy((cos * n2, film), (ratio, below), waves)


@dataclass
class Complex:
    """A complex number of floats or colours."""

    real: Any
    imag: Any = 0

    def __add__(self, other: Complex) -> Complex:
        return Complex(self.real + other.real, self.imag + other.imag)

    def __sub__(self, other: Complex) -> Complex:
        return Complex(self.real - other.real, self.imag - other.imag)

    def __mul__(self, other: Any) -> Complex:
        if not isinstance(other, Complex):
            return Complex(self.real * other, self.imag * other)
        real = self.real * other.real - self.imag * other.imag
        return Complex(real, self.real * other.imag + self.imag * other.real)

    def __truediv__(self, other: Complex) -> Complex:
        return self * other.conjugate() * dr.rcp(dr.maximum(other.square(), EPSILON))

    def conjugate(self) -> Complex:
        return Complex(self.real, -self.imag)

    def square(self) -> Any:
        """|z|²."""
        return self.real * self.real + self.imag * self.imag


ONE = Complex(1)


class Waves:
    """The waves of a path difference L in a film: weights, rates p and e = exp(p L), whose weighted sum is the mean of
    what is a power series in e."""

    def __init__(self, path: Any) -> None:
        self.path = path
        with dr.suspend_grad():
            self.all = list(self._spectral(path) if mi.is_spectral else self._seen(path))

    @staticmethod
    def _spectral(path: Any) -> Iterator[tuple[Any, Complex, Complex]]:
        sin, cos = dr.sincos(dr.two_pi * path)
        yield 1, Complex(0, -dr.two_pi), Complex(cos, -sin)

    @staticmethod
    def _seen(path: Any) -> Iterator[tuple[Any, Complex, Complex]]:
        for rate, colour in waves():
            sin, cos = dr.sincos(rate.imag * path)
            parts = (mi.Color3f(*part.tolist()) for part in (colour.real, colour.imag))
            weight = Complex(*(part if mi.is_rgb else mi.luminance(part) for part in parts))
            yield weight, Complex(rate.real, rate.imag), Complex(cos, sin) * dr.exp(rate.real * path)

    def mean(self, c: Complex) -> Complex:
        """Return the mean of h = e/(1 + c e).

        Its derivatives are sums, too: ∂h/∂c = -h² and ∂h/∂L = p h (1 - c h). Traced through every wave, those of a few
        lobes made a kernel that took LLVM an hour to compile.
        """
        with dr.suspend_grad():
            every = [(weight, rate, e / (ONE + c * e)) for weight, rate, e in self.all]
            mean = sum((h * weight for weight, _, h in every), Complex(0))
        for x, slope in ((c, lambda rate, h: h * h * -1), (self.path, lambda rate, h: rate * h * (ONE - c * h))):
            if dr.grad_enabled(x):
                with dr.suspend_grad():
                    by_x = sum((slope(rate, h) * weight for weight, rate, h in every), Complex(0))
                mean += by_x * (x - dr.detach(x))
        return mean


class Airy:
    """The amplitude r = a + (1 - a²) b h that one polarization reflects, from the u and v of both faces, of which the
    upper one's are real, and a mean over waves."""

    def __init__(self, upper: tuple[Any, Any], lower: tuple[Complex, Complex], waves: Waves | None) -> None:
        upper_amplitude, self.through = _amplitude(*(Complex(it) for it in upper))
        self.a, (self.b, below) = upper_amplitude.real, _amplitude(*lower)
        self.ab = self.b * self.a
        self.bh = Complex(0) if waves is None else self.b * waves.mean(self.ab)
        self.kept = self.through * below / dr.maximum(self.through + below - self.through * below, EPSILON)

    def reflectance(self) -> Spectrum:
        """Return the mean of |r|²."""
        return 1 - self.kept * (1 - 2 * self.a * self.bh.real)

    def times_conjugate(self, s: Airy) -> Complex:
        """Return the mean of r_p r_s*, for p this. In it h_p h_s* = (1 - a_p b_p h_p - (a_s b_s h_s)*)/(1 - a_p b_p
        (a_s b_s)*), which is linear, too."""
        p, p_bh, s_bh = self, self.bh, s.bh.conjugate()
        both = (ONE - p_bh * p.a - s_bh * s.a) / (ONE - p.ab * s.ab.conjugate())
        once = p_bh * (p.through * s.a) + s_bh * (p.a * s.through)
        return Complex(p.a * s.a) + once + p.b * s.b.conjugate() * both * (p.through * s.through)


def _amplitude(u: Complex, v: Complex) -> tuple[Complex, Any]:
    """Return r = (u - v)/(u + v), and 1 - |r|² = 4 Re(u v*)/|u + v|²."""
    return (u - v) / (u + v), 4 * (u * v.conjugate()).real / dr.maximum((u + v).square(), EPSILON)


COUNT, STEP, FARTHEST = 11, 100, 6000
"""How many waves there are, and at which path differences in nm they are fitted: beyond, colours have no contrast."""


@functools.cache
def waves() -> list[tuple[complex, np.ndarray]]:
    """Return rates p and colours A whose sum Σ A exp(p L) is the colour that the path difference L, in nm, makes of
    white light: the mean of exp(-2πi L/λ) over the sRGB channels under D65, to .005, and 1 for L = 0.

    The rates are those of the rotations between neighbours among the leading singular vectors of the Hankel matrix (R.
    Roy and T. Kailath, ESPRIT, 1989, doi:10.1109/29.32276). They decay, and power series in exp(-2πi L/λ) have the same
    sum, so that films of a high finesse need no more of them, as they would need wavelengths.
    """
    wavelengths, weights = observer()
    paths = np.arange(0, FARTHEST + 1, STEP)
    colours = np.exp(-2j * np.pi * paths[:, None] / wavelengths) @ weights
    windows = np.lib.stride_tricks.sliding_window_view(colours, len(paths) // 2, axis=0)
    leading = np.linalg.svd(windows.reshape(-1, len(paths) // 2))[2][:COUNT].T
    rates = np.log(np.linalg.eigvals(np.linalg.pinv(leading[:-1]) @ leading[1:])) / STEP
    found = np.linalg.lstsq(np.exp(np.outer(paths, rates)), colours, rcond=None)[0]
    return [(complex(rate), colour) for rate, colour in zip(rates, found / found.sum(axis=0), strict=True)]
