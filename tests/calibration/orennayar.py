"""Oren and Nayar's model: how much of the sampler that was fitted to EON suits it, by the least mean relative variance.

    python tests/calibration/orennayar.py [--check] [NAME ...]

A tolerance of 10 % is a difference in efficiency of 0.001.
"""

from __future__ import annotations

from collections.abc import Iterator

from harness import Fit, attributes, main, number, variance_loss

from mi_brdfs.models.orennayar import FullLobe, QualitativeLobe

ANGLES = 5, 30, 60, 80


def fits() -> Iterator[Fit]:
    for kind in QualitativeLobe, FullLobe:

        def loss(kind=kind):
            lobes = [kind(number(rho), number(sigma)) for rho in (0.2, 0.8) for sigma in (0.1, 0.2, 0.35, 0.6, 1, 1.5)]
            return variance_loss(lobes, ANGLES)()

        yield attributes(kind, "RETRO", loss, tolerance=0.1)


if __name__ == "__main__":
    main(__doc__, fits)
