"""What a file is written from: a BRDF that can be asked for any pair of directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..observer import to_srgb
from .arrays import stacked
from .coordinates import spherical

LOWEST = np.cos(np.radians(80))
"""The cosine to the normal up to which BRDFs are compared."""
AT_ONCE = 1 << 22
"""The most values that are evaluated together."""


@dataclass(frozen=True)
class Source:
    """A BRDF as a function, from a measurement or a BSDF."""

    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """Returns f in 1/sr, float64 of shape (N, channels), for ``wi`` and ``wo`` of shape (N, 3); both are unit
    vectors above the horizon."""
    wavelengths: np.ndarray | None = None
    """In nm, one a channel; None where the channels are linear sRGB. Writers take no unknown ones (NaN)."""
    anisotropic: bool = False
    material: str = ""

    def rgb(self) -> Source:
        """Return the same in linear sRGB: spectra under D65, a single wavelength as grey."""
        if self.wavelengths is None:
            return self
        weights = to_srgb(self.wavelengths) if len(self.wavelengths) > 1 else np.ones((1, 3))

        def evaluate(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
            parts = [self.evaluate(wi[k], wo[k]) @ weights for k in batches(len(wi), len(weights))]
            return np.maximum(np.concatenate(parts), 0)

        return replace(self, evaluate=evaluate, wavelengths=None)

    def check_size(self, pairs: int, most: int) -> None:
        """Raise a ValueError if there are more values than ``most`` at so many pairs of directions."""
        if self.wavelengths is not None and pairs * len(self.wavelengths) > most:
            raise ValueError(
                f"{len(self.wavelengths):,} wavelengths at {pairs:,} pairs of directions would be more values than the "
                f"{most:,} that are written; keep at most {most // pairs:,} of them"
            )


def pairs(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw pairs of directions up to 80° from the normal, always the same: ``wi`` cosine-weighted, ``wo`` cosine-
    weighted or around the mirror direction, by half vectors whose angles are log-uniform from 0.05° to 30°."""
    rng = np.random.default_rng(1)

    def lambertian() -> np.ndarray:
        cosine, phi = np.sqrt(rng.uniform(LOWEST**2, 1, count)), rng.uniform(0, 2 * np.pi, count)
        return stacked(spherical(np.arccos(cosine), phi))

    wi = lambertian()
    tilt, azimuth = np.radians(np.exp(rng.uniform(np.log(0.05), np.log(30), count))), rng.uniform(0, 2 * np.pi, count)
    h = stacked(spherical(tilt, azimuth))
    mirrored = 2 * np.sum(wi * h, axis=-1, keepdims=True) * h - wi
    near = (np.arange(count) % 2 == 0) & (mirrored[:, 2] > LOWEST)
    return wi, np.where(near[:, None], mirrored, lambertian())


def batches(pairs: int, channels: int) -> Iterator[slice]:
    """Yield parts of pairs of directions whose values are in memory together."""
    step = max(1, AT_ONCE // channels)
    return (slice(k, k + step) for k in range(0, max(pairs, 1), step))
