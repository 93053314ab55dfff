"""Samplers, over all that is declared: at grazing, too, no sample weighs much more than the others."""

import gc

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support import context, interaction, numbers
from test_fuzz import CASES, FuzzedPlugin, directions, magnitudes

from mi_brdfs.math import luminance
from mi_brdfs.measure.variates import lattice, sampling_efficiency

SETTINGS = 48
LARGEST_WEIGHT = 20
"""Of a sample, over the mean."""
LEAST_ETA = 0.15
"""η = E[w]²/E[w²] of any setting …"""
SELDOM_BELOW = 0.5
"""… and of all but ``SELDOM`` of them."""
SELDOM = 0.05


def drawn(options, rng):
    """Values of the quantities by name: colours and other fractions are uniform, the rest of any magnitude."""
    values = {}
    for quantity in options.quantities:
        low, high = quantity.limits[0], min(quantity.limits[1], 1e3 if quantity.colour else 1e6)
        shape = (3, SETTINGS) if quantity.colour else SETTINGS
        if (low, high) == (0, 1) or low < 0:
            values[quantity.name] = rng.uniform(low, high, shape)
        else:
            values[quantity.name] = magnitudes(low or 1e-3, high, rng, shape)
    # Dielectrics of nearly the same index on both sides have a peak at grazing that samplers know too little of.
    if "ext_ior" in values:
        inside = values.get("int_ior", 1.333)
        outside, alike = values["ext_ior"], abs(np.log(inside / values["ext_ior"])) < 0.1
        values["ext_ior"] = np.where(alike, inside * np.where(outside > 1, 0.7, 1.4), outside)
    return {name: np.float32(value) for name, value in values.items()}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model, options", CASES)
def test_weights(model, options):
    """Of every lobe alone and of their mixture, from 30° to 89°, most of them beyond 80°, at any azimuth."""
    rng = np.random.default_rng(1)
    points = lattice(8, 1)
    plugin = FuzzedPlugin(model, options, largest=1e6, lanes=SETTINGS * len(points))
    settings = drawn(options, rng)
    theta = np.radians(
        np.where(rng.random(SETTINGS) < 0.2, rng.uniform(30, 80, SETTINGS), rng.uniform(80, 89, SETTINGS))
    )
    wi = directions(np.cos(theta), np.sin(theta), rng)

    plugin.values = {name: np.repeat(value, len(points), axis=-1) for name, value in settings.items()}
    plugin.enter()
    si = interaction(np.repeat(wi, len(points), axis=0))
    u, x, y = np.tile(points.T, SETTINGS)
    count = plugin.bsdf.component_count()
    parts = [None, *range(count)] if count > 1 else [None]
    weights = [
        luminance(plugin.bsdf.sample(context(part), si, mi.Float(u), mi.Point2f(x, y), True)[1]) for part in parts
    ]
    dr.eval(weights)
    for part, weight in zip(parts, weights, strict=True):
        weight = numbers(weight).reshape(SETTINGS, len(points))
        mean = weight.mean(axis=1)
        black = mean <= 1e-30
        mean = np.where(black, 1, mean)
        largest = weight.max(axis=1) / mean
        eta = np.where(black, 1, sampling_efficiency(weight))
        for wrong, figure in ((largest > LARGEST_WEIGHT, largest), (eta < LEAST_ETA, eta)):
            k = np.argmax(wrong)
            at = {name: value[..., k].tolist() for name, value in settings.items()}
            assert not wrong[k], f"{figure[k]:.3g} of part {part} at {np.degrees(theta[k]):.1f}°, wi {wi[k]}: {at}"
        assert (eta < SELDOM_BELOW).mean() <= SELDOM, f"part {part}: {np.sort(eta)[:5]}"


@pytest.fixture(autouse=True)
def no_lanes_left():
    yield
    gc.collect()
