"""The check of derivatives for the directions."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, all_numbers, interaction, numbers, vectors
from ..probe.directions import beside
from .differences import differences
from .outcome import Outcome
from .pairs import DARK, Pairs, compare_differences, differentiate_sum, disagreement, edges_of, light_of
from .report import Finding
from .run import Run

TURN = 0.01
"""The step by which directions are turned, in parts of the width of a lobe."""


def directional(run: Run, pairs: Pairs | None) -> Finding:
    """Check the derivatives of ``eval`` and ``pdf`` for the directions: they are finite, also where formulas break, and
    those of ``eval`` are those of finite differences for some ``pairs``, if there are any."""
    outcome, probe, part = Outcome("gradients", "wi and wo"), run.probe, run.probe.whole
    wi, wo, _ = edges_of(part)
    some, mirrored = part.around(500, 15), wi * np.array([-1, -1, 1], np.float32)
    wi, wo = np.concatenate([wi, wi, some, some]), np.concatenate([wo, mirrored, some, beside(some, 16)])
    for name, method in (("eval", probe.bsdf.eval), ("pdf", probe.bsdf.pdf)):
        si, towards = interaction(wi), vectors(wo)
        dr.enable_grad(si.wi, towards)
        result = method(part.context, si, towards, True)
        if not dr.grad_enabled(result):
            continue
        dr.backward(result)
        for word, found in zip(("wi", "wo"), all_numbers(map(dr.grad, (si.wi, towards)), len(wi)), strict=True):
            bad = np.logical_not(np.isfinite(found).all(axis=1))
            why = f"as of {bad.mean():.1%} of the pairs tried"
            outcome.wrong(bad, f"the derivative of {name} for {word}", found, why, wi, wo)
    agreement = _compare_directional(run, outcome, pairs.steep(0.1)) if pairs else ""
    return outcome.finding(f"The derivatives of eval and pdf for the directions are finite{agreement}.")


def _compare_directional(run: Run, outcome: Outcome, pairs: Pairs) -> str:
    """Compare derivatives of ``eval``, as both directions turn, to finite differences; return what to say of them."""
    probe, part = run.probe, run.probe.whole
    step = TURN * min(run.spread(part), 1)
    if not len(pairs.wi) or step < 1e-5:
        return ""
    directions = np.array([pairs.wi, pairs.wo], np.float64)
    axes = np.cross(directions, np.random.default_rng(19).normal(size=directions.shape))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)

    def at(angle: float) -> Array:
        return probe.eval(part, *(np.cos(angle) * directions + np.sin(angle) * axes).astype(np.float32))

    if not abs(at(0) * pairs.scale).mean() > DARK:
        return ""

    def turned() -> tuple[mi.Float, Any]:
        # One for each lane: of a single one, each coordinate's share of the sum would be a kernel of its own.
        angle, si = dr.zeros(mi.Float, len(pairs.wi)), interaction(pairs.wi)
        dr.enable_grad(angle)
        si.wi, towards = (vectors(w) + angle * vectors(axis) for w, axis in zip(directions, axes, strict=True))
        return angle, probe.bsdf.eval(part.context, si, towards, True)

    angle, result = turned()
    if not dr.grad_enabled(result):
        return ""
    dr.forward(angle)
    derivative = numbers(dr.grad(result), len(pairs.wi))
    angle, result = turned()
    differentiate_sum(result, pairs)
    name = "the derivatives for wi and wo"
    told, off = disagreement(name, derivative, numbers(dr.grad(angle)).sum(), pairs, light_of(run, pairs))
    if told:
        outcome.fault(told, off)
    found = differences(at, step)
    found = found._replace(noise=found.noise + 1e-7 * abs(found.low) / step)
    if found.trusted.mean() < 0.5:
        return ""
    error, size = compare_differences(outcome, name, derivative, found, pairs)
    return f", and eval's agree with finite differences to {error / max(size, 1e-12):.1g}"
