"""Histograms of samples against the integrals of the density, which the statistical tests are made of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ..probe.arrays import Array, luminance
from ..probe.bsdf import BSDFProbe, Part, Samples
from ..probe.chi_square import ChiSquare, chi_square, lone_cell, surprise
from ..probe.directions import angles_of, azimuth_axis
from ..probe.partition import Partition, partitions
from ..probe.variates import random
from .incidents import Incident

COUNT = 1 << 18
"""Samples for a direction that was asked for."""
CELLS, GROUPS = 1024, 64
PILOT = 1 / 8
"""Samples that the cells are made by, for each that is counted."""
RANDOM_COUNT, RANDOM_CELLS = 1 << 14, 128
"""Those of a direction at random."""
CAPS = 2, 4, 8
"""The radii of caps that are tested, in degrees."""
DOUBTFUL = 64
"""The most cells of a suspect over which the density is integrated anew."""
HORIZON = 6e-8
"""The |cosθ| at which float32 tells a direction from the horizon."""
LARGEST = 2.0**127
"""A number that float32 cannot tell from an infinite one."""
CONFIRMED = 2
"""Directions that fail before the others need no second look."""


@dataclass(frozen=True)
class Trial:
    """A histogram of samples against the integrals of the density."""

    part: str
    incident: Incident
    partition: Partition
    counts: Array
    """How many of the samples are drawn in each cell."""
    weights: Array
    """The sums of the luminance of their weights, and of eval/pdf for them, in each cell: shape (2, cells)."""
    count: int = COUNT
    """How many samples there are."""
    seed: int = 0
    """That of their variates."""
    left_out: float = 0
    """The part of the samples in cells that do not count, as the integrals over them are not precise."""
    doubt: float = 0
    """How far the other integrals may be off together."""

    @property
    def axis(self) -> Array:
        """The azimuth of the plane of incidence, as a unit vector (cosφ, sinφ)."""
        return azimuth_axis(self.incident.wi)

    @property
    def settled(self) -> Array:
        """Whether the integral over a cell is known to less than the deviation of its samples."""
        return self.count * self.partition.errors <= 0.2 * np.sqrt(np.maximum(self.expected, 1))

    @property
    def share(self) -> float:
        """The part of the samples that is drawn, in the cells that count."""
        return float(self.counts.sum()) / self.count

    @property
    def integral(self) -> float:
        """The integral of the density over these."""
        return float(self.partition.integrals.sum())

    @property
    def mismatch(self) -> float:
        """How far the two are apart, besides the doubt."""
        return max(abs(self.integral - self.share) - self.doubt, 0)

    @cached_property
    def expected(self) -> Array:
        """The counts that the density expects."""
        return self.count * np.maximum(self.partition.integrals, 0)

    @cached_property
    def test(self) -> ChiSquare:
        """The gravest of three tests: of the cells, which sees what is wrong in few of them, of groups of neighbours,
        which sees what is slightly wrong in many, and of the cell or the cap that deviates most."""
        fine = chi_square(self.counts, self.expected)
        share = np.cumsum(np.fmin(self.expected, self.count))  # a density may be infinite
        share = share / max(share[-1], 1e-30)
        groups = np.minimum(share * GROUPS, GROUPS - 1).astype(int)
        counts, expected = (np.bincount(groups, each, GROUPS) for each in (self.counts, self.expected))
        graver = min(fine, chi_square(counts, expected), key=lambda test: test.p_value)
        least = min(graver.p_value, lone_cell(*self._caps()))
        return replace(graver, p_value=min(3 * least, 1), worst=fine.worst)

    def _caps(self) -> tuple[Array, Array]:
        """Return the counts and what is expected of each cell, and of all cells about each of some of them, within caps
        of several sizes: one wrong place may lie in many cells."""
        own, centres = [self.counts, self.expected], self.partition.centres
        middles = centres[:: max(len(centres) // 1000, 1)]
        cosines, each = middles @ centres.T, np.stack(own, axis=1).astype(np.float32)
        within = np.empty_like(cosines)
        caps = [np.greater(cosines, np.float32(np.cos(radius)), out=within) @ each for radius in np.radians(CAPS)]
        counts, expected = (np.concatenate([each, *(cap[:, k] for cap in caps)]) for k, each in enumerate(own))
        return counts, expected

    @property
    def doubtful(self) -> Array:
        """The cells that deviate most, if far."""
        excess = surprise(self.counts, self.expected)
        worst = np.argsort(excess)[-DOUBTFUL:]
        return worst[excess[worst] > 6]

    def fails(self, p_value: float, error: float) -> bool:
        """Return whether it fails for a significance and a tolerance of the integral."""
        return not (self.test.p_value > p_value and self.mismatch < error)

    @property
    def deviation(self) -> str:
        """Where the two deviate most."""
        worst, expected, drawn = self.test.worst, self.expected.sum(), self.counts.sum()
        at = angles_of(self.partition.centres[worst])
        told = (
            f"at {at}, {self.counts[worst]} of {self.count} samples fall where pdf expects {self.expected[worst]:.1f}"
        )
        overall = f"; over all directions it expects {expected / max(drawn, 1):.3g} times those drawn"
        return told + overall * bool(abs(expected - drawn) > 0.05 * drawn)


def trials_of(probe: BSDFProbe, part: Part, asked: Sequence[Incident], at_random: Sequence[Incident]) -> list[Trial]:
    """Make a trial of a part for each direction of incidence, those that were asked for and then some at random."""
    found = _trials(probe, part, asked, COUNT, CELLS)
    if at_random:
        found += _trials(probe, part, at_random, RANDOM_COUNT, RANDOM_CELLS)
    # What is narrow, or jumps close to a line of the cells, may escape the quadrature: suspects get cells across that
    # line, made by as many samples as are counted, until some fail.
    confirmed = 0
    for k in [k for k, trial in enumerate(found) if trial.fails(1e-3, 5e-4)]:
        if confirmed < CONFIRMED:
            (found[k],) = _trials(probe, part, [found[k].incident], COUNT, CELLS, pilot=1, turn=0.6)
            confirmed += found[k].fails(1e-6, 2e-3)
    return found


def _trials(
    probe: BSDFProbe,
    part: Part,
    incidents: Sequence[Incident],
    count: int,
    cells: int,
    pilot: float = PILOT,
    turn: float = 0,
) -> list[Trial]:
    """Make the trials of several directions together: a kernel has the work of many of them. The cells are turned about
    the normal by an angle, in radians."""
    wis, uvs = (np.array([incident[field] for incident in incidents], np.float32) for field in (1, 2))

    def drawn(count: int, seed: int) -> Iterator[Samples]:
        at_once = max(1, COUNT // count)
        for first in range(0, len(wis), at_once):
            some, uv = (np.repeat(each[first : first + at_once], count, axis=0) for each in (wis, uvs))
            samples = probe.sample(part, some, random(len(some), seed + 2 * first), uv)
            for fields in zip(*(np.split(field, len(some) // count) for field in samples), strict=True):
                yield Samples(*fields)

    def density(of: Array | int, wo: Array) -> Array:
        wi, uv = (np.take(each.T, of, axis=1).T for each in (wis, uvs))
        return np.nan_to_num(probe.pdf(part, wi, wo, uv))

    pilots = [samples.wo[samples.drawn] for samples in drawn(int(count * pilot), 0)]
    # The quadrature is as precise as for the larger count, for the sake of the sum.
    cos, sin = np.cos(turn), np.sin(turn)
    axes = np.array([azimuth_axis(wi) for wi in wis]) @ [[cos, sin, 0], [-sin, cos, 0]]
    made = partitions(density, pilots, list(axes), COUNT, cells)
    found = []
    at_once = max(1, COUNT // count)
    for k, (incident, partition, samples) in enumerate(zip(incidents, made, drawn(count, 1), strict=True)):
        # What is rejected may look as if it were drawn: let the integral decide whether black samples count.
        integral = partition.integrals.sum()
        counted = min(samples.drawn, samples.lit, key=lambda these: abs(these.mean() - integral))
        # No cell holds the density of what a rounding error lifts out of the horizon.
        counted &= abs(samples.wo[:, 2]) > HORIZON
        counts, weights = _sums(partition, samples, counted)
        trial = Trial(part.name, incident, partition, counts, weights, count, 1 + 2 * (k - k % at_once))
        if turn:
            if len(doubtful := trial.doubtful):
                trial = replace(trial, partition=partition.refined(partial(density, k), doubtful))
            kept = trial.settled
            rest = replace(trial, partition=trial.partition.only(kept), counts=counts[kept], weights=weights[:, kept])
            trial = replace(rest, left_out=trial.share - rest.share, doubt=float(rest.partition.errors.sum()))
        found.append(trial)
    return found


def _sums(partition: Partition, samples: Samples, counted: Array) -> tuple[Array, Array]:
    """Return :attr:`Trial.counts` and :attr:`Trial.weights` of those samples that are counted."""
    own, count = partition.cells(samples.wo[counted]), len(partition.starts)
    with np.errstate(divide="ignore", invalid="ignore"):
        both = luminance(samples.weight), luminance(samples.value) / samples.pdf
    sums = [np.bincount(own, np.nan_to_num(each[counted], posinf=LARGEST), count) for each in both]
    return np.bincount(own, minlength=count), np.array(sums)
