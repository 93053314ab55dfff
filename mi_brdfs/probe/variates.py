"""Uniform variates for ``sample``, rows of three, and the efficiency of the weights that it returns for them."""

from __future__ import annotations

import numpy as np

from .arrays import Array

SHIFTS = 16
"""Copies of the lattice, each shifted at random: their spread tells the error of their mean."""


def random(count: int, seed: int) -> Array:
    """Draw uniform variates, float32 of shape (count, 3)."""
    return np.random.default_rng(seed).random((count, 3), dtype=np.float32)


def lattice(log2_count: int, seed: int) -> Array:
    """Return points of a lattice that fill the unit cube evenly, shifted at random; float32, shape (SHIFTS·2^n, 3)."""
    # The steps are the powers of the root of x⁴ = x + 1, after M. Roberts' generalisation of the golden ratio.
    steps = 1 / 1.2207440846057596 ** np.arange(1, 4)
    points = np.arange(1 << log2_count)[:, None] * steps
    shifts = np.random.default_rng(seed).random((SHIFTS, 1, 3))
    return np.minimum((points + shifts) % 1, 1 - 2**-24).reshape(-1, 3).astype(np.float32)


def sobol(log2_count: int, seed: int) -> Array:
    """Return the first 2^n points of Sobol's sequence, their digits exchanged at random; float32, shape (2^n, 3). Their
    means are nearer to the truth than those of as many points of the lattice, but tell nothing of their error."""
    # The direction numbers of the polynomials 1, x + 1 and x² + x + 1, after S. Joe and F. Y. Kuo 2008.
    first, second, third = [1] * 32, [1], [1, 3]
    for k in range(1, 32):
        second.append(2 * second[k - 1] ^ second[k - 1])
    for k in range(2, 32):
        third.append(2 * third[k - 1] ^ 4 * third[k - 2] ^ third[k - 2])
    points = np.random.default_rng(seed).integers(1 << 32, size=(1, 3), dtype=np.uint32)
    for k in range(log2_count):
        numbers = np.array([first[k], second[k], third[k]], np.uint32) << np.uint32(31 - k)
        points = np.concatenate([points, points ^ numbers])
    return np.minimum(points / 2.0**32, 1 - 2**-24).astype(np.float32)


def sampling_efficiency(weights: Array) -> Array:
    """Return η = E[w]²/E[w²] of the luminance w of sampling weights, over the last axis: 1 is perfect, 1/η - 1 the
    relative variance of one sample under uniform light, and 0 stands for black."""
    squares = (weights**2).mean(axis=-1)
    return weights.mean(axis=-1) ** 2 / np.where(squares > 0, squares, 1)
