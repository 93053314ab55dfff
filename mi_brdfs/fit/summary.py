"""Fits in tables: what the command prints, and its report shows."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from .result import Fit


class Median(NamedTuple):
    """A model over several materials."""

    held_out: float
    fitted: float
    model: str
    files: int
    best_in: int


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
    least on held-out directions first."""
    by_model: dict[str, list[Fit]] = {}
    for own in ranked:
        for it in own:
            by_model.setdefault(it.model, []).append(it)
    winners = [own[0].model for own in ranked]
    return sorted(
        Median(
            median(it.held_out for it in own),
            median(it.errors[it.metric]["fitted"] for it in own),
            model,
            len(own),
            winners.count(model),
        )
        for model, own in by_model.items()
    )
