"""The intermediate of all formats: measured values on a grid, or at single pairs of directions."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from ..observer import observer
from ..parameters.messages import brief, printable
from ..probe.arrays import luminance
from .files import FileError
from .grid import Grid
from .scattered import Samples

Quantity = Literal["stated", "f", "f cos"]
"""What a file holds: what it states, or f or f cosθo where it states nothing."""
MOST = 1e36
"""The largest value: float32 holds it times a solid angle."""
MOST_CHANNELS = 4096
LEAST_NM = 12.0
"""In nm, between the 10.6 µm of carbon dioxide lasers and the 13.5 nm of extreme ultraviolet light."""
MOST_UNSEEN = 0.2
"""The share of the luminance that spectra may leave out without a warning."""


@dataclass(frozen=True)
class Measurement:
    """A measured BRDF.

    ``values`` of ``data`` are f in 1/sr, as the file has them up to its stated scale: negative ones, and NaN where
    nothing was measured, are kept. Whatever renders takes these as 0, whatever fits gives them no weight, and
    :func:`mi_brdfs.measured.report.summary.summarize` counts them.
    """

    path: Path
    format: str
    """MERL, RGL, Zemax, …"""
    data: Grid | Samples
    wavelengths: np.ndarray | None = None
    """In nm, one a channel; None where the channels are linear sRGB."""
    material: str = ""
    """What the file calls it."""
    quantity: Literal["f", "f cos"] = "f"
    """What the file holds; ``data`` is f in either case."""
    stated_albedos: dict[float, list[float]] = field(default_factory=dict)
    """The directional albedos (total integrated scatter, TIS) that the file states, by θi in radians: one for each
    angle of rotation, or a single one."""
    notes: dict[str, str] = field(default_factory=dict)
    """What else the file says of itself."""

    def __post_init__(self) -> None:
        # What a file calls itself must not control a terminal.
        object.__setattr__(self, "material", brief(self.material))
        lines = {name: " ".join(text.split()) for name, text in self.notes.items()}
        object.__setattr__(self, "notes", {printable(name): printable(text) for name, text in lines.items()})

    @property
    def title(self) -> str:
        """The name of the file, after that of the material where it is another."""
        name = self.path.name
        return name if self.material in ("", brief(self.path.stem)) else f"{self.material} ({name})"


def representable(measurement: Measurement) -> Measurement:
    """Return a measurement that can be rendered, with NaN in place of values beyond ``MOST``, infinite ones among them.
    Raise a FileError if no value is left that is positive, or wavelengths are too many, no numbers, the same or in
    micrometres. Warn of spectra that leave out much of what the eye sees."""
    values, nm = measurement.data.values, measurement.wavelengths
    if values.shape[-1] > MOST_CHANNELS:
        raise FileError(
            f"{measurement.path} has {values.shape[-1]:,} wavelengths, of which at most {MOST_CHANNELS:,} can be read; "
            "keep every second one, or fewer."
        )
    if nm is not None and len(nm) > 1 and not np.all((np.diff(nm) > 0) & np.isfinite(nm[1:])):
        raise FileError(f"{measurement.path}: its wavelengths must be numbers that differ.")
    if nm is not None and nm[-1] < LEAST_NM:
        numbers = f"{nm[0]:g} to {nm[-1]:g}" if len(nm) > 1 else f"{nm[0]:g}"
        raise FileError(f"{measurement.path}: wavelengths of {numbers} look like micrometres; write nm.")
    if nm is not None and len(nm) > 1:
        fine, weights = observer()
        unseen = float(luminance(weights)[(fine < nm[0]) | (fine > nm[-1])].sum())
        if unseen > MOST_UNSEEN:
            warnings.warn(
                f"{measurement.path}: its wavelengths of {nm[0]:g} to {nm[-1]:g} nm leave out {unseen:.0%} of what the "
                "eye sees; there, the value of the nearest one is shown.", stacklevel=2,
            )  # fmt: skip
    values[~((values >= -MOST) & (values <= MOST))] = np.nan
    # Samples with a missing channel are left out where others are interpolated.
    kept = values if isinstance(measurement.data, Grid) else values[np.isfinite(values).all(axis=1)]
    if not np.any(kept > np.finfo(np.float32).tiny):
        raise FileError(f"{measurement.path}: no value is positive and at most {MOST:g}; there is nothing to render.")
    return measurement
