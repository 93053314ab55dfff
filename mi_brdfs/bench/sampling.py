"""The efficiency of samplers."""

from __future__ import annotations

from typing import NamedTuple

import mitsuba as mi
import numpy as np

from ..probe.arrays import Array, luminance
from ..probe.bsdf import BSDFProbe, Part
from ..probe.directions import direction
from ..probe.variates import lattice, sampling_efficiency

ANGLES = 5, 30, 60, 80
"""Angles of incidence, in degrees."""
AZIMUTHS = 0, 45, 90
"""Azimuths at which anisotropic parts are measured; the least efficiency counts."""
LOG2_POINTS = 13
"""log₂ of the number of points per direction, in each of their shifted copies: efficiencies are accurate to 0.001."""


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
