"""The metrics of fits: how far a model's values are from measured ones.

An error is √(Σ w (T(f cosθi) - T(f' cosθi))² / Σ w), over pairs of directions and channels, f measured and f' of the
model, up to the cut of the angles θi and θo. Papers leave the root, the sum of weights or both out; the setting with
the least error is the same. With dωi = sinθi dθi dφi, and dωo alike:

    log         T(x) = ln(1 + x)   w = dωi dθo dφo    E2 of Löw et al. 2012
    l2          T(x) = x           w = dωi dθo dφo    E1 of Löw et al. 2012
    ngan        T(x) = x           w = dωi dωo        Ngan et al. 2005
    cube-root   T(x) = ∛x          w = dωi dωo        Fores et al. 2012

So Löw's weight is sinθi on a grid of equal steps, which gives θo near the normal more weight than a solid angle does.
The first three agree with the loss functions of BBM (github.com/bsdfbenchmark/bbm, ``include/loss``), which sum over
channels, average over samples and take no root; the papers' own text was not at hand. For Fores et al. only the
abstract was: "cube root" and that it is compared with root mean squares. Others read it as the mean of
|f cosθi - f' cosθi|^⅔ (code of Sztrajman et al. 2021). The cut of 80° is that of Ngan et al. as it is commonly told; it
is not part of a metric.

J. Löw, J. Kronander, A. Ynnerman, J. Unger, BRDF models for accurate and efficient rendering of glossy surfaces, ACM
TOG 31(1), 2012, doi:10.1145/2077341.2077350. A. Ngan, F. Durand, W. Matusik, Experimental analysis of BRDF models,
EGSR 2005, doi:10.2312/EGWR/EGSR05/117-126. A. Fores, J. Ferwerda, J. Gu, Toward a perceptually based metric for BRDF
modeling, CIC 20, 2012, doi:10.2352/CIC.2012.20.1.art00025.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..parameters.messages import meant

POLE = float(np.sin(np.radians(2)))
"""The least sine of θo that weights are divided by: a pair at the normal stands for a cell about it."""


class Metric(NamedTuple):
    """What is compared, and with which weight."""

    transform: Callable[[np.ndarray], np.ndarray]
    """T of f cosθi."""
    derivative: Callable[[np.ndarray], np.ndarray]
    """T'."""
    solid_angle: bool
    """Whether pairs weigh by the solid angles of both directions, or by that of wi and the polar angle of wo alone."""
    text: str
    """What it is, and whose."""
    cosine: bool = False
    """Whether pairs weigh by cosθo, too."""

    def weights(self, wo: np.ndarray, solid_angle: np.ndarray) -> np.ndarray:
        """Return the weights w of pairs, for the solid angles dωi dωo that each stands for."""
        if self.solid_angle:
            return solid_angle * wo[:, 2] if self.cosine else solid_angle
        return solid_angle / np.maximum(np.hypot(wo[:, 0], wo[:, 1]), POLE)


def _same(x: np.ndarray) -> np.ndarray:
    return x


def _log(x: np.ndarray) -> np.ndarray:
    """Return ln(1 + x), and its mirror image for the negative channels of colours outside sRGB."""
    return np.copysign(np.log1p(np.abs(x)), x)


SMALLEST = 1e-6
"""The f cosθi below which a root is steep enough to be held."""


def _cube_root_slope(x: np.ndarray) -> np.ndarray:
    return np.maximum(np.abs(x), SMALLEST) ** (-2 / 3) / 3


METRICS = {
    "log": Metric(_log, lambda x: 1 / (1 + np.abs(x)), False,
                  "ln(1 + f cosθi), weighted by sinθi (E2 of Löw et al. 2012)"),
    "l2": Metric(_same, np.ones_like, False, "f cosθi, weighted by sinθi (E1 of Löw et al. 2012)"),
    "ngan": Metric(_same, np.ones_like, True, "f cosθi, weighted by solid angle (Ngan et al. 2005)"),
    "cube-root": Metric(np.cbrt, _cube_root_slope, True,
                        "the cube root of f cosθi, weighted by solid angle (Fores et al. 2012)"),
    # As BBM states them (github.com/bsdfbenchmark/bbm, cosine_weighted_l2.h and cosine_weighted_log.h; the paper's own
    # text was not at hand): J. Bieron, P. Peers, An adaptive BRDF fitting metric, CGF 39(4), 2020,
    # doi:10.1111/cgf.14054. The paper then chooses among fits by pictures, as `mi-brdfs fit --image` does.
    "bieron-l2": Metric(_same, np.ones_like, True,
                        "f cosθi, weighted by solid angle and cosθo (Bieron and Peers 2020)", cosine=True),
    "bieron-log": Metric(_log, lambda x: 1 / (1 + np.abs(x)), True,
                         "ln(1 + f cosθi), weighted by solid angle and cosθo (Bieron and Peers 2020)", cosine=True),
}  # fmt: skip
"""By name."""


def find_metric(name: str) -> Metric:
    """Return the metric of a name, or raise a ValueError."""
    if name not in METRICS:
        near = meant(str(name), METRICS)
        hint = f"did you mean {near!r}? There" if near else "there"
        raise ValueError(f"There is no metric {name!r}; {hint} are {', '.join(METRICS)}.")
    return METRICS[name]
