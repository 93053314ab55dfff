"""Pairs of directions, for which derivatives are compared."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, columns_of
from ..probe.bsdf import Part
from ..probe.directions import direction, on_side
from .differences import Differences
from .outcome import Outcome
from .run import Run

TOLERANCE = 0.02
LOST = 3
"""How many times its last digit a value may be off, as of formulas whose terms cancel."""
DARK = 1e-5
"""What part of the light is rounding, as where an index of refraction of 1 reflects nothing."""


class Pairs(NamedTuple):
    """Pairs of directions."""

    wi: Array
    wo: Array
    scale: Array
    """One over their density."""

    @property
    def weights(self) -> Array:
        """By what to weigh values in a sum, in which no pair counts as much as another, nor does a channel."""
        of_pairs = np.random.default_rng(20).uniform(0.5, 1.5, (len(self.wi), 1))
        return self.scale * of_pairs * np.geomspace(1, 4, dr.size_v(mi.UnpolarizedSpectrum))

    def steep(self, cosine: float) -> Pairs:
        """Return those whose directions are both that far from grazing."""
        kept = np.minimum(abs(self.wi[:, 2]), abs(self.wo[:, 2])) > cosine
        return Pairs(*(each[kept] for each in self))


def edges_of(part: Part) -> Pairs:
    """Return pairs of directions where formulas break: normal, grazing, mirrored, equal."""
    edge = np.array([direction(t, phi) for t in (0, 1e-3, 45, 89, 89.9, 89.99) for phi in (0, 50, 180)])
    ways = np.repeat(edge, len(edge), axis=0), np.tile(edge, (len(edge), 1))
    wi, wo = (np.concatenate([on_side(w, side) for side in part.sides]) for w in ways)
    return Pairs(wi, wo, np.ones((len(wi), 1)))


def differentiate_sum(values: Any, pairs: Pairs) -> None:
    """Differentiate the weighted sum of values, without the sum itself, which would be a kernel of its own."""
    dr.backward(mi.unpolarized_spectrum(values) * mi.UnpolarizedSpectrum(columns_of(pairs.weights)))


def light_of(run: Run, pairs: Pairs) -> float:
    """Return the weighted sum of the values."""
    return float(np.nansum(pairs.weights * run.probe.eval(run.probe.whole, pairs.wi, pairs.wo)))


def disagreement(name: str, derivatives: Array, reverse: Any, pairs: Pairs, light: float) -> tuple[str, float]:
    """Return what to say if the reverse derivative of the weighted sum of values is not that of the forward ones, but
    for rounding of the ``light``, and by how much it is off; nothing if it is."""
    weighted = pairs.weights * derivatives
    total, error = weighted.sum(), abs(reverse - weighted.sum())
    if error <= max(TOLERANCE * abs(weighted).sum(), DARK * light):
        return "", 0
    told = f"of {name}, that of a weighted sum of values is {reverse:.4g} by dr.backward, but {total:.4g} by dr.forward"
    return told, float(error)


def compare_differences(
    outcome: Outcome, name: str, compared: Array, found: Differences, pairs: Pairs
) -> tuple[float, float]:
    """Add a fault if derivatives are off on average; return their error and their size."""
    low, high, trusted, noise = found
    scales = np.broadcast_to(pairs.scale, trusted.shape)[trusted]
    ad, low, high, noise = (x[trusted] * scales for x in (np.nan_to_num(compared), low, high, noise))
    fd = np.clip(ad, low, high)
    error, size = float(abs(ad - fd).sum()), float(max(abs(fd).sum(), abs(ad).sum()))
    if error > TOLERANCE * size + LOST * noise.sum():
        k = np.nonzero(trusted)[0][int(np.argmax(abs(ad - fd)))]
        sizes = f"those of eval average {abs(ad).mean():.3g} in size, finite differences {abs(fd).mean():.3g}"
        told = f"{name} are off by {error / size:.0%}: {sizes}"
        outcome.fault(told, error / size, wi=pairs.wi[k], wo=pairs.wo[k])
    outcome.data = {"error": error, "size": size}
    return error, size
