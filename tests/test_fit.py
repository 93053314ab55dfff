"""Fits of known materials: what was put in comes out, within the stated uncertainty."""

import numpy as np
import pytest
from fits import MODELS, measured

from mi_brdfs.fit import fit
from mi_brdfs.mitsuba.registry import own_models

pytestmark = pytest.mark.usefixtures("llvm_rgb")

COUNT = 1000
"""Pairs of directions of a material, half of them fitted. How many deviations there are, and so what the tests can see,
does not depend on it."""
CHECKED = 4
"""Of the twelve noisy materials of each model those of which each parameter is looked at, 308 in all."""
FEW = "wrap", "ward", "burley"
"""Models that are always tried: a diffuse one, a glossy one, and one whose channels mix."""
NEVER = 4.2
"""Standard deviations beyond which a normal distribution has one of 308 in one of a hundred runs."""


def test_every_model_is_tried():
    assert set(MODELS) == {model.plugins[0] for model in own_models()}


def noisy(name: str) -> list[list[float]]:
    """Return how many of the stated standard deviations each parameter is off, in fits to materials at random that are
    of one model, with noise, gaps and negatives."""
    own = 1000 * (1 + list(MODELS).index(name))
    truths = [MODELS[name].drawn(own + k) for k in range(12)]
    data = [measured(name, truth, COUNT, own + k, noise=0.01) for k, truth in enumerate(truths)]
    fits = fit(data, name, given=MODELS[name].given, starts=2)
    assert np.mean([it.negative for it in fits]) > COUNT / 60 and np.mean([it.missing for it in fits]) > COUNT / 15
    assert np.median([it.held_out / it.errors["log"]["fitted"] for it in fits]) < 1.2
    pairs = zip(truths, fits, strict=True)
    return [[(it.bsdf[key] - value) / it.sigma[key] for key, value in truth.items()] for truth, it in pairs]


@pytest.mark.parametrize(
    "name", [each if each in FEW else pytest.param(each, marks=pytest.mark.slow) for each in MODELS]
)
def test_recovers_parameters(name):
    """Exactly from exact data."""
    model = MODELS[name]
    truth = model.drawn(seed=1)
    (exact,) = fit(measured(name, truth, COUNT), name, given=model.given, starts=4)
    assert exact.file == "arrays" and exact.errors["log"]["fitted"] < 1e-5
    for parameter, value in truth.items():
        assert exact.bsdf[parameter] == pytest.approx(value, rel=1e-3), parameter


@pytest.mark.parametrize("names", [FEW, pytest.param(MODELS, marks=pytest.mark.slow)], ids=["few", "all"])
def test_the_uncertainty_is_neither_too_small_nor_too_large(names):
    """From noisy data with gaps and negatives, parameters are found within 3σ. Of a normal distribution one of 370 is
    beyond, so of the materials of a model, whose parameters go together, one may have some, but not far. Deviations
    have a root mean square of 1, up to about three of its own standard deviations."""
    found = {name: np.array(noisy(name)) for name in names}
    for name, off in found.items():
        largest = np.abs(off[:CHECKED]).max(axis=1)
        assert (largest > 3).sum() <= 1 and largest.max() < NEVER, name
    off = np.concatenate([np.ravel(each) for each in found.values()])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(1, abs=2.4 / np.sqrt(len(off)))


@pytest.mark.slow
def test_the_uncertainty_counts_what_is_at_an_end():
    """With noise of a tenth, wrap and exponent can hardly be told apart: where wrap ends at 1, the exponent is no
    surer for that."""
    model = MODELS["wrap"]
    truths = [model.drawn(seed) | {"wrap": 0.78} for seed in range(12)]
    data = [measured("wrap", truth, seed=seed, noise=0.1) for seed, truth in enumerate(truths)]
    fits = fit(data, "wrap", starts=2)
    ended = [(it, truth) for it, truth in zip(fits, truths, strict=True) if "wrap" in it.bounds]
    assert ended
    for it, truth in ended:
        assert it.sigma["wrap"] is None and "wrap" not in it.correlations
        assert abs(it.bsdf["exponent"] - truth["exponent"]) < 3 * it.sigma["exponent"] < 1.5
