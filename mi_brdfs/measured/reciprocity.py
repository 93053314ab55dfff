"""How far a table is from Helmholtz's reciprocity, f(wi, wo) = f(wo, wi)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .measurement import Grid

PAIRS = 1 << 17
"""The most nodes that are compared."""


@dataclass(frozen=True)
class ReciprocityError:
    """Percentiles of |f(wi, wo) - f(wo, wi)| by the larger of the two."""

    median: float
    percentile95: float
    pairs: int
    """How many pairs of directions were compared."""


def reciprocity_error(grid: Grid) -> ReciprocityError | None:
    """Return how far the values at nodes are from what the table says with the directions exchanged, over the nodes
    where both were measured. Channels count alike, and nodes in proportion to both cosines: light near the horizon
    matters little, and is measured worst.

    Return None if the coordinates make it 0, or nothing was measured both ways.
    """
    if grid.coordinates.reciprocal:
        return None
    count = math.prod(grid.values.shape[:-1])
    chosen = np.sort(np.random.default_rng(1).permutation(count)[:PAIRS]) if count > PAIRS else np.arange(count)
    wi, wo, _ = grid.pairs(chosen)
    both = grid.measured(wi, wo) & grid.measured(wo, wi)
    wi, wo = wi[both], wo[both]
    f, reverse = grid.evaluate(wi, wo), grid.evaluate(wo, wi)
    larger = np.maximum(abs(f), abs(reverse))
    lit = larger > 0
    if not lit.any():
        return None
    error = abs(f - reverse)[lit] / larger[lit]
    weight = np.broadcast_to((wi[:, 2] * wo[:, 2])[:, None], f.shape)[lit]
    order = np.argsort(error)
    share = np.cumsum(weight[order]) / weight.sum()
    median, most = (float(error[order][np.searchsorted(share, level)]) for level in (0.5, 0.95))
    return ReciprocityError(median, most, len(f))
