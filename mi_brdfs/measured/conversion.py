"""Measured files, and any BSDF, written in another format."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import mitsuba as mi
import numpy as np

from ..probe.arrays import CENTRE, Array
from ..probe.bsdf import BSDFProbe, load
from ..probe.sources import name_of
from ..variants import is_measurable
from ..writing import replacing
from .arrays import NUMPY, components, stacked
from .coordinates import turned_about_normal
from .files import named
from .formats import ENDINGS, read
from .grid import Grid, usable
from .measurement import Measurement
from .report.counts import Range, census, in_one_plane
from .report.summary import percent
from .scattered import Samples, as_grid
from .source import Source, batches, pairs

PAIRS = 1 << 15
BAKED_TO = 80
"""The angle, in degrees, up to which a conversion is judged."""
NEAR_NORMAL = 10
"""The angle up to which a measurement may leave out the normal, in degrees, without a word."""
GREY = "What was measured at one wavelength became grey."
MOSTLY = 0.99
"""The share of directions that counts as all: others lie between the last node and the horizon."""
ALIKE = 1e-3
"""By what part of its peak f may change where it counts as the same."""


@dataclass(frozen=True)
class Conversion:
    """What was written, and how it differs from what was given."""

    path: Path
    format: str
    rms: float
    """The root mean square error of f cosθo, in parts of its peak, at random pairs of directions up to 80° from the
    normal: half of the ``wo`` are cosine-weighted, half of them around the mirror direction."""
    largest: float
    """The largest error, outside one cell of the peak."""
    losses: tuple[str, ...]
    """What the file does not hold, and what it holds that was not measured, a sentence each."""

    def __str__(self) -> str:
        error = (
            f"Read back at {PAIRS:,} random pairs of directions up to {BAKED_TO}° from the normal, f cosθ is off by "
            f"{percent(self.rms)} of its peak (root mean square), and by at most {percent(self.largest)} farther "
            "than a cell from the peak."
        )
        return "\n".join([f"{named(self.path)}: {self.format}.", error, *self.losses])


def convert(
    given: str | Path | Measurement | mi.BSDF | dict, path: str | Path, format: str | None = None
) -> Conversion:
    """Write a measured file, or a BSDF, in another format.

    ``given`` is the path of a measured file or what :func:`read` returned of it; or a BSDF or its dict, of which the
    reflection on its front side is written, without delta functions, as the active variant evaluates it at texture
    coordinates (0.4, 0.3). ``path`` ends in what the format's files end in: ``.binary`` for MERL, ``.bsdf`` for RGL,
    ``.csv``; ``format`` chooses among formats with the same ending.

    A file that exists is replaced, once the new one is complete.

    Raises:
        FileError: if the given file cannot be read.
        ValueError: if the format cannot hold what is given, none has this ending, there is nothing to write, or a BSDF
            is given and the active variant is not a vectorized one with rgb.
        OSError: if the file cannot be written.
    """
    path = Path(path)
    file = given.path if isinstance(given, Measurement) else given.get("filename") if isinstance(given, dict) else given
    if isinstance(file, (str, Path)) and Path(file).exists() and path.exists() and os.path.samefile(file, path):
        raise ValueError(f"{named(path)} cannot be converted onto itself; give another name")
    if path.exists() and not path.is_file():
        raise ValueError(f"{named(path)} is not a regular file; give the name of one")
    writer = _writer(path, format)
    losses: list[str] = []
    if isinstance(given, (str, Path, Measurement)):
        measurement = given if isinstance(given, Measurement) else read(given)
        source = _of_measurement(measurement)
        losses += _not_measured(measurement)
    else:
        probe = _probe(given)
        source = _baked(probe)
        losses += _left_out(probe)
    if source.wavelengths is not None and not np.isfinite(source.wavelengths).all():
        source = source.rgb()
        losses.append(GREY)
    with replacing(path) as part:
        writer.write(part, source)
        rms, largest, more = _compared(source, read(part))
    return Conversion(path, writer.NAME, rms, largest, (*losses, *more))


def _probe(bsdf: mi.BSDF | dict[str, Any]) -> BSDFProbe:
    variant = mi.variant()
    if not is_measurable(variant) or not mi.is_rgb:
        raise ValueError(f"a BSDF is written in a vectorized rgb variant such as llvm_ad_rgb, not {variant or 'none'}")
    loaded = load(bsdf) if isinstance(bsdf, dict) else bsdf
    if not isinstance(loaded, mi.BSDF):
        raise ValueError(f"{type(loaded).__name__} is not a BSDF of {variant}")
    return BSDFProbe(loaded)


def _baked(probe: BSDFProbe) -> Source:
    if not probe.components:
        raise ValueError("the BSDF reflects and transmits in single directions only: there is no value to write")

    def evaluate(wi: Array, wo: Array) -> Array:
        wi, wo = (stacked(components(w)).astype(np.float32) for w in (wi, wo))
        parts = batches(len(wi), 4)
        f = [probe.eval(probe.whole, wi[k], wo[k]) / np.maximum(wo[k, 2:], 1e-12) for k in parts]
        return usable(np.concatenate(f))

    wi, wo = pairs(PAIRS)
    # Each pair is turned by another angle.
    turns = np.linspace(0, 2 * np.pi, PAIRS)
    f, turned = evaluate(wi, wo), evaluate(*(stacked(turned_about_normal(components(w), turns)) for w in (wi, wo)))
    if not f.any():
        raise ValueError("the BSDF reflects nothing on its front side: there is no value to write")
    return Source(evaluate, anisotropic=not _alike(f, turned), material=name_of(probe.bsdf))


def _of_measurement(measurement: Measurement) -> Source:
    grid = as_grid(measurement.data)
    if not grid.usable.any():
        raise ValueError(f"{named(measurement.path)} has no positive value: there is nothing to write")
    return Source(grid.evaluate, measurement.wavelengths, grid.anisotropic, measurement.material)


def _not_measured(measurement: Measurement) -> Iterator[str]:
    """Yield what of a measurement means nothing, or is not there, and is made up."""
    data, found = measurement.data, census(measurement.data)
    if found.above.negative and not (isinstance(data, Grid) and data.signed):
        yield f"{percent(found.above.negative / found.above.values)} of its values were negative and became 0."
    if found.above.missing:
        yield (
            f"{percent(found.above.missing / found.above.values)} of its values were missing; they are filled in from "
            "those around them, with 0 where there are none."
        )
    if planar := in_one_plane(data):
        yield "It was measured in the plane of incidence only; what lies beside it is interpolated."
    ranges = [("θi", found.theta_i), ("θo", found.theta_o)]
    told = [f"{name} {low:.4g} to {high:.4g}°" for name, (low, high) in ranges if low > NEAR_NORMAL or high < BAKED_TO]
    if told:
        yield f"It was measured for {' and '.join(told)}; what lies beyond has the values at the border."
    if not planar and (share := _share(data, found.theta_i, found.theta_o)) < MOSTLY:
        directions = "the directions in between" if told else "all directions"
        yield f"Of {directions} {percent(share)} were measured; the others have the values at the border."


def _share(data: Grid | Samples, *ranges: Range) -> float:
    """Return the share of pairs of directions within ranges of θi and θo that was measured."""
    both = np.array(pairs(PAIRS))[:, 1::2]  # the others are around the mirror direction
    theta, (low, high) = np.degrees(np.arccos(both[..., 2])), np.transpose(ranges)[..., None]
    within = np.all((low <= theta) & (theta <= high), axis=0)
    return float(data.measured(*both[:, within]).mean()) if within.any() else 1.0


def _left_out(probe: BSDFProbe) -> Iterator[str]:
    """Yield what of a BSDF is not written."""
    if probe.deltas:
        yield "Its reflection or transmission in single directions (delta functions) is left out."
    if any(part.has(mi.BSDFFlags.Transmission) for part in probe.components):
        yield "The light that it transmits is left out."
    wi, wo = (np.float32(w) for w in pairs(PAIRS))
    elsewhere = np.random.default_rng(2).random((PAIRS, 2), np.float32)
    f = probe.eval(probe.whole, wi, wo)
    if wrong := np.mean(~(np.isfinite(f) & (f >= 0))):
        yield f"{percent(float(wrong))} of its values are negative or not finite, and became 0."
    if not _alike(usable(f), usable(probe.eval(probe.whole, wi, wo, elsewhere))):
        yield f"It varies over the surface; this is how it is at texture coordinates {CENTRE}."


def _alike(f: Array, other: Array) -> bool:
    return bool(abs(f - other).max() <= ALIKE * f.max())


def _writer(path: Path, format: str | None) -> ModuleType:
    """Return the module of the format to write, or raise a ValueError."""
    fitting = ENDINGS.get(path.suffix.lower(), [])
    chosen = [it for it in fitting if format is None or it.NAME.lower() == format.lower()]
    if not chosen:
        wanted = f"{named(path)} as {format}" if fitting else named(path)
        known = [f"{ending} ({it.NAME})" for ending, formats in ENDINGS.items() for it in formats]
        raise ValueError(f"there is no way to write {wanted}; files that can be written are {', '.join(known)}")
    return chosen[0]


def _compared(source: Source, written: Measurement) -> tuple[float, float, list[str]]:
    """Return the root mean square error, the largest, and what was lost on the way."""
    grid = as_grid(written.data)
    other, losses = Source(grid.evaluate, written.wavelengths), []
    if source.wavelengths is not None and written.wavelengths is None:
        count = len(source.wavelengths)
        losses.append(f"Its {count} wavelengths became linear sRGB, as seen under D65." if count > 1 else GREY)
    if source.wavelengths is None or written.wavelengths is None:
        source, other = source.rgb(), other.rgb()
    wi, wo = pairs(PAIRS)
    # By how much f cosθo differs, what it is, and by how much that with the directions exchanged differs, where that is
    # the most of all channels.
    found = []
    for k in batches(PAIRS, grid.values.shape[-1]):
        cosine = wo[k, 2:]
        f = source.evaluate(wi[k], wo[k]) * cosine
        error, change = other.evaluate(wi[k], wo[k]) * cosine - f, source.evaluate(wo[k], wi[k]) * cosine - f
        found.append([abs(error).max(axis=-1), f.max(axis=-1), abs(change).max(axis=-1)])
    error, brightest, changes = np.concatenate(found, axis=1)
    peak = brightest.max() or 1.0
    if grid.coordinates.reciprocal and changes.max() > ALIKE * peak:
        losses.append(
            f"{written.format} is reciprocal: f is the mean over both orders of the directions, between which f "
            f"cosθ differs by up to {percent(changes.max() / peak)} of its peak."
        )
    places, _ = grid.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
    cells = np.stack([np.interp(x, a.nodes, np.arange(len(a.nodes))) for a, x in zip(grid.axes, places, strict=True)])
    far = (abs(cells - cells[:, [brightest.argmax()]]) > 1).any(axis=0)
    return float(np.sqrt(np.mean(error**2)) / peak), float(error[far].max(initial=0) / peak), losses
