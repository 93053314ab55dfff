"""Fits of known materials: what was put in comes out, within the stated uncertainty."""

import pytest
from fits import MODELS, measured

from mi_brdfs.fit import fit
from mi_brdfs.mitsuba.registry import own_models

pytestmark = pytest.mark.usefixtures("llvm_rgb")


def test_every_model_is_tried():
    assert set(MODELS) == {model.plugins[0] for model in own_models()}


@pytest.mark.parametrize("name", MODELS)
def test_recovers_parameters(name):
    """Exactly from exact data, and within 3σ from noisy ones with gaps and negatives."""
    model = MODELS[name]
    truth = model.drawn(seed=1)
    exact, noisy = fit(
        [measured(name, truth), measured(name, truth, seed=2, noise=0.01)], name, given=model.given, starts=4
    )
    assert exact.file == noisy.file == "arrays"
    for parameter, value in truth.items():
        assert exact.bsdf[parameter] == pytest.approx(value, rel=1e-3), parameter
        assert abs(noisy.bsdf[parameter] - value) < 3 * noisy.sigma[parameter], parameter
    assert noisy.negative > 50 and noisy.missing > 200
    assert exact.errors["log"]["fitted"] < 1e-5
    assert noisy.errors["log"]["held_out"] < 1.2 * noisy.errors["log"]["fitted"]
