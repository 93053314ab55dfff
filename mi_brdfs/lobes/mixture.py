"""The choice among lobes, and the resulting density."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..math import ONE_MINUS_EPSILON, SMALL, TINY, clamp, luminance, select
from .lobe import Lobe


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

    def eval_pdf(self, wo: mi.Vector3f, transmitted: bool) -> tuple[mi.UnpolarizedSpectrum, mi.Float]:
        """Return ``(value, pdf)`` of all lobes of one side: Σ f_k |cosθ_o| and Σ P_k pdf_k."""
        total, density = mi.UnpolarizedSpectrum(0), 0.0
        for probability, lobe in zip(self.probabilities, self.lobes, strict=True):
            if lobe.transmits == transmitted:
                value, pdf = lobe.eval_pdf(self.wi, wo)
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
