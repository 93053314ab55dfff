"""How far a table is from Helmholtz's reciprocity, f(wi, wo) = f(wo, wi)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import NUMPY, components
from ..coordinates import Spherical
from ..grid import Grid, usable
from ..scattered import Samples

PAIRS = 1 << 17
"""The most nodes that are compared."""
SAME = np.radians(0.1)
"""By how much angles of samples may differ that count as the same."""


@dataclass(frozen=True)
class ReciprocityError:
    """Percentiles of |f(wi, wo) - f(wo, wi)| by the larger of the two."""

    median: float
    percentile95: float
    pairs: int
    """How many pairs of directions were compared."""


def reciprocity_error(data: Grid | Samples) -> ReciprocityError | None:
    """Return how far values are from those with the directions exchanged, over the nodes of a grid where both were
    measured, or over the pairs of samples whose directions are each other's. Channels count alike, and directions in
    proportion to both cosines: light near the horizon matters little, and is measured worst.

    Return None if a grid's coordinates make it 0, or nothing was measured both ways.
    """
    if isinstance(data, Samples):
        wi, wo, f, reverse = _exchanged(data)
    elif data.coordinates.reciprocal:
        return None
    else:
        count = math.prod(data.values.shape[:-1])
        chosen = np.sort(np.random.default_rng(1).permutation(count)[:PAIRS]) if count > PAIRS else np.arange(count)
        wi, wo, _ = data.pairs(chosen)
        both = data.measured(wi, wo) & data.measured(wo, wi)
        wi, wo = wi[both], wo[both]
        f, reverse = data.evaluate(wi, wo), data.evaluate(wo, wi)
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


def _exchanged(samples: Samples) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ``(wi, wo, f, reverse)`` of the samples for which there is one with the directions exchanged; isotropic
    ones may also be turned and mirrored."""
    wi, wo, f = samples.pairs()
    coordinates = Spherical(mirrored=not samples.anisotropic, anisotropic=samples.anisotropic)
    pair = components(wi), components(wo)
    places = [np.stack(coordinates.locate(*each, NUMPY), axis=1) for each in (pair, pair[::-1])]
    steps = np.round(np.concatenate(places) / SAME).astype(np.int64)
    _, group = np.unique(steps, axis=0, return_inverse=True)
    one, other = np.split(group.ravel(), 2)
    _, here, exchanged = np.intersect1d(one, other, return_indices=True)
    different = here != exchanged
    here, exchanged = here[different], exchanged[different]
    return wi[here], wo[here], usable(f[here]), usable(f[exchanged])
