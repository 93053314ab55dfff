"""The contract of a lobe, one additive part of a BRDF, and mixtures of them: choice among lobes, and density."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from ..math import EPSILON, ONE_MINUS_EPSILON, SMALL, TINY, Spectrum, clamp, luminance, select


class Lobe:
    """One additive part of a BRDF, holding its parameters evaluated at a surface point.

    Directions are unit vectors of the local frame (n = z) that point away from the surface: ``wi`` is the given one
    (towards the viewer, in Mitsuba's radiance transport), ``wo`` the sampled one. The caller guarantees wi.z > 0 and,
    in :meth:`eval_pdf`, wo.z > 0, or wo.z < 0 if the lobe transmits, so a lobe needs no masks. Densities are per
    solid angle of ``wo``.
    """

    glossy = True
    """Whether the lobe is glossy or diffuse, for Mitsuba's flags and type masks."""

    reciprocal = True
    """Whether f(wi, wo) = f(wo, wi)."""

    anisotropic = False
    """Whether f may change if both directions turn about the normal."""

    transmits = False
    """Whether the light comes from the other side of the surface."""

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        """Return an estimate of ∫ f |cosθ_o| dω_o. It decides the choice among lobes and the albedo AOV, so it need not
        be exact, but it must be positive wherever the lobe reflects anything."""
        raise NotImplementedError(f"{type(self).__name__} does not define estimated_albedo.")

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        """Return ``(value, pdf)``: f |cosθ_o|, and the density with which :meth:`sample` draws ``wo``."""
        raise NotImplementedError(f"{type(self).__name__} does not define eval_pdf.")

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        """Return the same in polarized variants, with a Mueller matrix for light from ``wo`` to ``wi``, whose Stokes
        vectors have the first axes ``x_o`` and ``x_i``. By default, and if the lobe transmits, it depolarises."""
        value, pdf = self.eval_pdf(wi, wo)
        return mi.depolarizer(mi.UnpolarizedSpectrum(value)), pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        """Draw a direction ``wo`` from three uniform variates, ``u`` and ``v = (v.x, v.y)``. It may lie beyond the
        horizon, where the lobe is zero."""
        raise NotImplementedError(f"{type(self).__name__} does not define sample.")

    def adjoint(self) -> Lobe:
        """Return the lobe for light tracing (``TransportMode.Importance``), where ``wi`` leads to the light and ``wo``
        to the viewer: its value is f(wo, wi) |cosθ_o|. If the lobe transmits, both are mirrored at the surface:
        wi.z > 0 and wo.z < 0, as always.

        The default is sampled like the lobe itself; override it if that misses directions."""
        return self if self.reciprocal and not mi.is_polarized else AdjointLobe(self)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        """Return the lobe's colour times its Fresnel reflectance for the mirror direction of ``wi``, regardless of its
        width and scale: its reflectance as a mirror. It is 0 for diffuse lobes; a BSDF with a glossy one that does not
        define it reflects an environment as it lights it, also under ``environment_reflection``."""
        return 0


class AdjointLobe(Lobe):
    """f(wo, wi) of a non-reciprocal lobe, or one with Mueller matrices, sampled like the lobe."""

    reciprocal = False

    def __init__(self, lobe: Lobe) -> None:
        self.lobe, self.glossy, self.transmits = lobe, lobe.glossy, lobe.transmits

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.estimated_albedo(wi)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        value, _ = self.lobe.eval_pdf(self._mirrored(wo), self._mirrored(wi))
        _, pdf = self.lobe.eval_pdf(wi, wo)
        return value * (abs(wo.z) / dr.maximum(wi.z, EPSILON)), pdf

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        matrix, _ = self.lobe.mueller_pdf(self._mirrored(wo), self._mirrored(wi), x_o, x_i)
        _, pdf = self.lobe.eval_pdf(wi, wo)
        return matrix * (abs(wo.z) / dr.maximum(wi.z, EPSILON)), pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.lobe.sample(wi, u, v)

    def _mirrored(self, w: mi.Vector3f) -> mi.Vector3f:
        return mi.Vector3f(w.x, w.y, -w.z) if self.transmits else w


class WeightedLobe(Lobe):
    """A lobe times g(wi, wo) = g(wo, wi), sampled like the lobe: the weight is g times the lobe's. ``mean(wi)``
    approximates the mean of g over ``wo``."""

    def __init__(
        self, lobe: Lobe, g: Callable[[mi.Vector3f, mi.Vector3f], Spectrum], mean: Callable[[mi.Vector3f], Spectrum]
    ) -> None:
        self.lobe, self.g, self.mean = lobe, g, mean
        self.glossy, self.reciprocal = lobe.glossy, lobe.reciprocal
        self.anisotropic, self.transmits = lobe.anisotropic, lobe.transmits

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.estimated_albedo(wi) * self.mean(wi)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        value, pdf = self.lobe.eval_pdf(wi, wo)
        return value * self.g(wi, wo), pdf

    def mueller_pdf(
        self, wi: mi.Vector3f, wo: mi.Vector3f, x_i: mi.Vector3f, x_o: mi.Vector3f
    ) -> tuple[mi.Spectrum, mi.Float]:
        matrix, pdf = self.lobe.mueller_pdf(wi, wo, x_i, x_o)
        return mi.Spectrum(mi.UnpolarizedSpectrum(self.g(wi, wo))) @ matrix, pdf

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.lobe.sample(wi, u, v)

    def mirror_reflectance(self, wi: mi.Vector3f) -> Spectrum:
        return self.lobe.mirror_reflectance(wi) * self.mean(wi)


class Mixture:
    """Several lobes sampled as one: lobe k with probability ∝ the luminance of its estimated albedo at ``wi``.

    In ``mirrored`` lanes (a mask, or None) light comes from behind: there only transmitting lobes count, and elsewhere
    only the others."""

    def __init__(self, lobes: list[Lobe], wi: mi.Vector3f, mirrored: mi.Bool | None = None) -> None:
        self.lobes, self.wi = lobes, wi
        if len(lobes) == 1:
            self.probabilities = [mi.Float(1)]
            return
        counts = [1.0] * len(lobes)
        if mirrored is not None:
            counts = [select(mirrored, 1.0, 0.0) if it.transmits else select(mirrored, 0.0, 1.0) for it in lobes]
        energies = [count * luminance(lobe.estimated_albedo(wi)) for count, lobe in zip(counts, lobes, strict=True)]
        total = sum(energies)
        black = total < SMALL
        scale = dr.rcp(dr.select(black, sum(counts), total))
        self.probabilities = [
            dr.select(black, count, energy) * scale for count, energy in zip(counts, energies, strict=True)
        ]

    def eval_pdf(self, wo: mi.Vector3f, transmitted: bool, *axes: mi.Vector3f) -> tuple[mi.Spectrum, mi.Float]:
        """Return ``(value, pdf)`` of all lobes of one side: Σ f_k |cosθ_o| and Σ P_k pdf_k. In polarized variants it
        takes the first axes of Stokes vectors, too (:meth:`Lobe.mueller_pdf`)."""
        total, density = mi.Spectrum(0), 0.0
        for probability, lobe in zip(self.probabilities, self.lobes, strict=True):
            if lobe.transmits == transmitted:
                value, pdf = lobe.mueller_pdf(self.wi, wo, *axes) if axes else lobe.eval_pdf(self.wi, wo)
                total, density = total + value, density + probability * pdf
        return total, density

    def sample(self, u: mi.Float, v: mi.Point2f) -> tuple[mi.Vector3f, mi.UInt32]:
        """Return ``(wo, k)``: a direction and the index of the lobe that it was drawn from."""
        if len(self.lobes) == 1:
            return self.lobes[0].sample(self.wi, u, v), 0
        index, start, share = mi.UInt32(0), mi.Float(0), self.probabilities[0]
        end = share
        for k, probability in enumerate(self.probabilities[1:], start=1):
            passed = (u >= end) & (probability > 0)
            index = dr.select(passed, k, index)
            start, share = dr.select(passed, end, start), dr.select(passed, probability, share)
            end = end + probability
        u = clamp((u - start) / dr.maximum(share, TINY), 0, ONE_MINUS_EPSILON)
        wo = self.lobes[0].sample(self.wi, u, v)
        for k, lobe in enumerate(self.lobes[1:], start=1):
            if len(self.lobes) > 2:  # then most lanes do not draw from it, and branching is faster
                wo = dr.if_stmt((wo,), index == k, lambda wo, lobe=lobe: lobe.sample(self.wi, u, v), lambda wo: wo)
            else:
                wo = dr.select(index == k, lobe.sample(self.wi, u, v), wo)
        return wo, index
