"""Levenberg–Marquardt for many problems at once.

D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, SIAM 11(2), 1963,
doi:10.1137/0111030.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..probe.arrays import Array

STEPS = 80
"""The most steps of a fit."""
LONGEST = 1.5
"""The longest step along an unknown, on its scale."""
DAMPING, WEAKER, STRONGER, STRONGEST = 1e-2, 0.2, 4.0, 1e8
"""Damping at first, its factors after a step that gains and after one that does not, and where it gives up."""
GAIN = 1e-7
"""The relative gain of a step below which a problem is solved, if the next one gains as little."""


class Normal(NamedTuple):
    """Sums over the residuals r of each of P problems, in float64: r·r, shape (P,), Jᵀr, (P, K), and JᵀJ, (P, K, K)."""

    cost: Array
    gradient: Array
    matrix: Array


Sums = Callable[[Array, Array], Normal]
"""Returns the sums of some problems, by their indices, at points of shape (len(indices), K)."""


def solve(
    sums: Sums,
    start: Array,
    low: Array,
    high: Array,
    advance: Callable[[int], None] = lambda ended: None,
    steps: int = STEPS,
) -> tuple[Array, Array]:
    """Return ``(points, costs)`` of P problems in K unknowns within a box: no cost is above that of its start.

    Each problem has its own damping, and ends by itself. An unknown at an end of its range takes no part in a step that
    would leave it. ``advance`` is called with the number of problems that have ended since.
    """
    points, count = np.clip(start, low, high), len(start)
    damping, small = np.full(count, DAMPING), np.zeros(count, np.int64)
    active = np.arange(count)
    costs, gradient, matrix = (np.array(array) for array in sums(active, points))
    costs = np.where(np.isfinite(costs), costs, np.inf)
    for _ in range(steps):
        moves = damped_steps(points[active], gradient[active], matrix[active], damping[active], low, high)
        tried = np.clip(points[active] + moves, low, high)
        cost, new_gradient, new_matrix = sums(active, tried)
        cost = np.where(np.isfinite(cost), cost, np.inf)
        better = cost < costs[active]
        gain = np.where(better, 1 - cost / np.maximum(costs[active], 1e-300), 0)
        taken = active[better]
        points[taken], costs[taken] = tried[better], cost[better]
        gradient[taken], matrix[taken] = new_gradient[better], new_matrix[better]
        damping[active] *= np.where(better, WEAKER, STRONGER)
        damping[active] = np.maximum(damping[active], 1e-9)
        small[active] = np.where(better, np.where(gain < GAIN, small[active] + 1, 0), small[active])
        left = active[(small[active] < 2) & (damping[active] < STRONGEST) & (costs[active] > 1e-20)]
        advance(len(active) - len(left))
        active = left
        if not len(active):
            break
    advance(len(active))
    return points, costs


def damped_steps(x: Array, gradient: Array, matrix: Array, damping: Array, low: Array, high: Array) -> Array:
    """Return the damped steps of some problems from points x, at most ``LONGEST`` along each unknown."""
    g, a = np.nan_to_num(gradient), np.nan_to_num(matrix)
    held = ((x <= low) & (g > 0)) | ((x >= high) & (g < 0))
    free = ~held
    g, a = np.where(free, g, 0), a * (free[:, :, None] & free[:, None, :])
    diagonal = np.einsum("pkk->pk", a)
    floor = 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-300
    eye = np.eye(x.shape[1])
    scaled = a + eye * (damping[:, None] * np.maximum(diagonal, floor) + np.where(held, 1, floor))[:, None, :]
    return np.clip(-np.linalg.solve(scaled, g[..., None])[..., 0], -LONGEST, LONGEST)
