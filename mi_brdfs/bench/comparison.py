"""The comparison of two BSDFs, or the numbers of one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from rich.table import Column, Table

from ..given import load_described, sources_of
from ..mitsuba import guests
from ..probe.arrays import Array, interaction, luminance, sample_arguments, vectors
from ..probe.bsdf import BSDFProbe, Part
from ..probe.directions import direction, hemisphere
from ..probe.sources import BSDFSource
from ..probe.variates import lattice, random, sampling_efficiency
from ..variants import is_measurable
from .pictures import SIZE, bsdf_of, first_pictures, render_in_turn, sphere
from .statistics import Interval, deviations, in_turn, median_interval, time_variance

LANES, CALL_ROUNDS, FIRST_ROUNDS = 1 << 20, 31, 3
STAGES = "efficiency", "calls", "pictures", "first pictures"
ANGLES = 5, 30, 60, 80
"""Angles of incidence, in degrees."""
AZIMUTHS = 0, 45, 90
"""Azimuths at which anisotropic parts are measured; the least efficiency counts."""
LOG2_POINTS = 13
"""log₂ of the number of points per direction, in each of their shifted copies: efficiencies are accurate to 0.001."""


@dataclass(frozen=True)
class Measurement:
    """A quantity of each BSDF, and that of the first over that of the second with its 95 % confidence interval."""

    name: str
    values: list[float]
    """Empty if only the ratio tells anything."""
    format: str
    """How values are written."""
    ratio: tuple[float, Interval] | None = None


@dataclass(frozen=True)
class Comparison:
    """What :func:`compare` has measured."""

    names: list[str]
    measurements: list[Measurement]

    def to_dict(self) -> dict[str, Any]:
        """Return the results in JSON's types."""
        return asdict(self)

    def table(self) -> Table:
        """Return a row for each quantity, a column for each BSDF, and one for the ratio of two."""
        columns = [Column(name, overflow="fold", justify="right") for name in self.names]
        columns += [Column("first / second", no_wrap=True)] if len(self.names) == 2 else []
        table = Table(Column("", no_wrap=True), *columns, box=None, pad_edge=False)
        for it in self.measurements:
            cells = [it.format.format(value) for value in it.values] or [""] * len(self.names)
            if it.ratio:
                ratio, (low, high) = it.ratio
                cells.append(f"{ratio:.2f}× [{low:.2f}, {high:.2f}]")
            table.add_row(it.name, *cells)
        return table


def compare(*bsdfs: str | dict | BSDFSource, on_progress: Callable[[str], None] = lambda stage: None) -> Comparison:
    """Measure one BSDF, or two in turn, in the active variant: the efficiency η = E[w]²/E[w²] of the weights that
    ``sample`` returns, the least over three azimuths for an anisotropic BSDF; the time of ``eval_pdf_sample`` in a
    kernel; the time and the variance of a picture of a sphere under a constant environment by ``path``, whose product
    is the time to a picture with the same noise; and the time to the first picture of a new process, which traces and
    compiles, unless no other process can import the model. Times are medians, meaningful on an idle machine only.

    Args:
        bsdfs: what the command line takes, or dicts.
        on_progress: called with the name of each of ``STAGES`` before it.

    Raises:
        ValueError: if these are not one BSDF or two, or the variant is not vectorized and unpolarized.
    """
    if not is_measurable(mi.variant()):
        raise ValueError(f"Measuring needs a vectorized and unpolarized variant, not {mi.variant()}.")
    found: list[Any] = [it for given in bsdfs for it in (sources_of(given) if isinstance(given, str) else [given])]
    names = [str(it.get("type")) if isinstance(it, dict) else it.name for it in found]
    if len(found) not in (1, 2):
        words = ", ".join(str(it.get("type")) if isinstance(it, dict) else it.word for it in found)
        raise ValueError(f"name one BSDF or two to compare, not {len(found)}: {words}")
    efficiency, calls, pictures, first = STAGES
    on_progress(efficiency)
    probes = [BSDFProbe(load_described(bsdf_of(it))) for it in found]
    etas = np.array([sampling(probe, probe.whole).least() for probe in probes])
    rows = [Measurement(f"η at {angle}°", list(each), "{:.3f}") for angle, each in zip(ANGLES, etas.T, strict=True)]
    on_progress(calls)
    rows.append(_timed("eval and sample", call_times(probes), "{:.2f} ns"))
    on_progress(pictures)
    importable = all(guests.source(type(model)) for probe in probes for model in probe.models if model)
    del probes  # whatever is alive is part of the kernels
    seconds, luminance = render_in_turn([partial(_scene, it) for it in found])
    noise = deviations(luminance)
    rows.append(_timed("picture", 1e3 * seconds, "{:.0f} ms"))
    rows.append(Measurement("its variance", noise.mean(axis=1).tolist(), "{:.2g}"))
    if len(found) == 2 and noise.all():
        rows.append(Measurement("time × variance", [], "", time_variance(seconds[0] / seconds[1], noise)))
    if importable:
        on_progress(first)
        rows.append(_timed("first picture", first_pictures([[it] for it in found], FIRST_ROUNDS), "{:.2f} s"))
    return Comparison(names, rows)


class Sampling(NamedTuple):
    """The statistics of a part's samples: arrays over the angles and azimuths."""

    albedo: Array
    eta: Array
    """η = E[w]²/E[w²], w being the luminance of the weights that ``sample`` returns, zeros included: 1 is perfect, and
    1/η - 1 is the relative variance of one sample under uniform light. 0 where the part is black."""

    def least(self) -> Array:
        """Return the least efficiency over the azimuths, for each angle."""
        return self.eta.min(axis=1)


def sampling(probe: BSDFProbe, part: Part) -> Sampling:
    """Return the statistics of a part's samples, by points that fill the space of the variates evenly."""
    azimuths = AZIMUTHS if part.has(mi.BSDFFlags.Anisotropic) else AZIMUTHS[:1]
    directions = np.array([direction(theta, phi) for theta in ANGLES for phi in azimuths])
    w = luminance(probe.weights(part, directions, lattice(LOG2_POINTS, 1))).reshape(len(ANGLES), len(azimuths), -1)
    full = len(ANGLES), len(AZIMUTHS)
    return Sampling(np.broadcast_to(w.mean(axis=-1), full), np.broadcast_to(sampling_efficiency(w), full))


def call_times(probes: list[BSDFProbe]) -> Array:
    """Return the nanoseconds that ``eval_pdf_sample`` takes for a lane, in kernels of each BSDF in turn, compiled
    before; shape (BSDFs, rounds). Tracing does not count."""
    si, wo, variates = interaction(hemisphere(LANES, 1)), vectors(hemisphere(LANES, 2)), random(LANES, 3)
    u, v = sample_arguments(variates)
    times = np.zeros((len(probes), CALL_ROUNDS))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for k, each in in_turn(len(probes), 1 + CALL_ROUNDS):
            dr.kernel_history_clear()
            probe = probes[k]
            value, pdf, bs, weight = probe.bsdf.eval_pdf_sample(probe.whole.context, si, wo, u, v, True)
            dr.eval(dr.sum(value) + pdf + dr.sum(weight) + bs.pdf + dr.sum(bs.wo))
            if each:  # the first round compiles
                kernels = dr.kernel_history([dr.KernelType.JIT])
                times[k, each - 1] = 1e6 / LANES * sum(kernel["execution_time"] for kernel in kernels)
    return times


def _scene(given: Any) -> dict[str, Any]:
    return sphere(bsdf_of(given), SIZE)


def _timed(name: str, times: Array, format: str) -> Measurement:
    ratio = median_interval(times[0] / times[1]) if len(times) == 2 else None
    return Measurement(name, np.median(times, axis=1).tolist(), format, ratio)
