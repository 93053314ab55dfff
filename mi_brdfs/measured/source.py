"""What a file is written from: a BRDF that can be asked for any pair of directions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .observer import to_srgb


@dataclass(frozen=True)
class Source:
    """A BRDF as a function, from a measurement or a BSDF."""

    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """Returns f in 1/sr, float64 of shape (N, channels), for ``wi`` and ``wo`` of shape (N, 3); both are above the
    horizon."""
    wavelengths: np.ndarray | None = None
    """In nm, one a channel; None where the channels are linear sRGB."""
    anisotropic: bool = False
    material: str = ""

    def rgb(self) -> Source:
        """Return the same in linear sRGB: spectra under D65, a single wavelength as grey."""
        if self.wavelengths is None:
            return self
        weights = to_srgb(self.wavelengths) if len(self.wavelengths) > 1 else np.ones((1, 3))
        return replace(self, evaluate=lambda wi, wo: np.maximum(self.evaluate(wi, wo) @ weights, 0), wavelengths=None)
