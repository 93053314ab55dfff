"""Fits against those of SciPy's optimiser on the float64 references."""

from pathlib import Path

import numpy as np
import pytest
from fits import MODELS
from scipy.optimize import least_squares
from support import ROOT, shared

from mi_brdfs.fit import fit, observe
from mi_brdfs.fit.unknowns import configurations
from mi_brdfs.mitsuba.registry import find_model

pytestmark = pytest.mark.usefixtures("llvm_rgb")

SEVEN = ["ward", "phong", "blinnphong", "ashikhminshirley", "walter", "cooktorrance", "low"]
STARTS = 10


def oracle(name: str, material) -> float:
    """The least error of the metric "log" of ten runs from random starts, on the fitted pairs and one channel."""
    model = MODELS[name]
    (configuration,) = configurations(find_model(name), model.given, {}, 1, 1, False)
    unknowns = [next(u for u in configuration.unknowns if u.name == name) for name in model.parameters]
    rows = slice(0, material.fitted)
    wi, wo, solid_angle = material.wi[rows], material.wo[rows], material.solid_angle[rows]
    ratio = wi[:, 2].astype(float) / wo[:, 2]
    target = np.log1p(material.f[rows, 0] * wi[:, 2])
    weight = solid_angle / np.maximum(np.hypot(wo[:, 0], wo[:, 1]).astype(float), np.sin(np.radians(2)))
    root = np.sqrt(weight / weight.sum())

    def residuals(u):
        values = {v.name: float(v.from_scale(x)) for v, x in zip(unknowns, u, strict=True)}
        return root * (np.log1p(model.reference(wi, wo, **values) * ratio) - target)

    low, high = np.transpose([unknown.ends for unknown in unknowns])
    rng, errors = np.random.default_rng(1), []
    for _ in range(STARTS):
        start = low + (high - low) * rng.uniform(0.1, 0.9, len(low))
        errors.append(np.sqrt(2 * least_squares(residuals, start, bounds=(low, high), max_nfev=200).cost))
    return min(errors)


@pytest.mark.parametrize("name", [SEVEN[0], *(pytest.param(name, marks=pytest.mark.slow) for name in SEVEN[1:])])
@pytest.mark.parametrize(
    "file",
    [
        "AnoBlackEC1onAlum.bsdf",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("aeroglaze_z307.bsdf", "rgl")),
    ],
)
def test_no_worse_than_least_squares(name, file):
    """The error is at most 1.01 times the best of ten runs of SciPy's; of colours, the green channel is compared."""
    paths = sorted(shared("rgl").glob("*.bsdf"))[::4] if file == "rgl" else [ROOT / "scenes" / "measured" / file]
    materials = [green(path) for path in paths]
    for path, material, it in zip(paths, materials, fit(materials, name, starts=STARTS), strict=True):
        expected = oracle(name, material)
        assert it.errors["log"]["fitted"] <= 1.01 * expected + 1e-7, Path(path).name


def green(path):
    """A material's middle channel, at a thousand pairs of directions."""
    from dataclasses import replace

    material = observe(path, pairs=2000)
    channel = [material.channels // 2]
    return replace(material, f=material.f[:, channel], usable=material.usable[:, channel])
