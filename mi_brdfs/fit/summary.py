"""Fits in tables: what the command prints, and its report shows."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from .result import Fit


class Median(NamedTuple):
    """A model over several materials."""

    error: float
    """By which models are ranked: the FLIP error where pictures were compared, and else the held-out one."""
    held_out: float
    fitted: float
    model: str
    files: int
    best_in: int
    flip: float | None


def notes(fit: Fit) -> str:
    """Return what of a fit calls for caution, in words."""
    words = ["albedo above 1"] * (fit.albedo > 1) + ["unresolved"] * (not fit.resolved)
    return ", ".join(words + ([f"at an end: {', '.join(fit.bounds)}"] if fit.bounds else []))


def values(fit: Fit) -> list[tuple[str, float, float | None]]:
    """Return ``(name, value, standard deviation)`` of each fitted number; of a colour's numbers, the first has the
    name."""
    found = []
    for name, sigma in fit.sigma.items():
        value = fit.bsdf[name]
        for k, number in enumerate(value["value"] if isinstance(value, dict) else [value]):
            found.append(("" if k else name, number, sigma[k] if isinstance(sigma, list) else sigma))
    return found


def medians(ranked: Sequence[Sequence[Fit]]) -> list[Median]:
    """Return the medians of each model's errors over materials, whose fits are each in the order of their rank; the
    best first."""
    by_model: dict[str, list[Fit]] = {}
    for own in ranked:
        for it in own:
            by_model.setdefault(it.model, []).append(it)
    winners = [own[0].model for own in ranked]
    found = []
    for model, own in by_model.items():
        held_out = median(it.held_out for it in own)
        fitted = median(it.errors[it.metric]["fitted"] for it in own)
        seen = [it.flip for it in own if it.flip is not None]
        flip = median(seen) if seen else None
        error = held_out if flip is None else flip
        found.append(Median(error, held_out, fitted, model, len(own), winners.count(model), flip))
    return sorted(found, key=lambda it: it.error)
