"""Scattered samples as a grid: weights, symmetries, what lies beyond, and how well samples that were left out come
back."""

import mitsuba as mi
import numpy as np
import pytest
from support import call, context, direction, efficiencies, pairs, shared
from test_measured_rows import colours, streaks

from mi_brdfs.measured import Samples, read, scattered
from mi_brdfs.measured.scattered import as_grid, embedded, nearest


@pytest.mark.parametrize(
    "f, anisotropic, gain", [(colours, False, 0.5), pytest.param(streaks, True, 0.75, marks=pytest.mark.slow)]
)
def test_a_smooth_brdf_comes_back(f, anisotropic, gain):
    """Better than from the nearest neighbour; in four dimensions, 2000 samples are few."""
    wi, wo = pairs(2000, 5, 0.05)
    values = f(wi, wo)
    grid = as_grid(Samples(wi, wo, values, anisotropic))
    assert np.nanmin(grid.values) >= values.min()
    assert np.nanmax(grid.values) <= values.max()
    wi_2, wo_2 = pairs(1000, 9, 0.2)
    found, expected = grid.evaluate(wi_2, wo_2), f(wi_2, wo_2)
    points, others = embedded(wi, wo, anisotropic), embedded(wi_2, wo_2, anisotropic)
    neighbour = values[nearest(points, others, 1)[:, 0]]
    assert np.median(abs(found / expected - 1)) < gain * np.median(abs(neighbour / expected - 1))
    np.testing.assert_allclose(grid.evaluate(wo_2, wi_2), found, rtol=1e-6)


def test_beyond_the_measured_range(monkeypatch):
    monkeypatch.setattr(scattered, "MOST_NODES", 20_000)
    wi, wo = pairs(2000, 13, 0.5)
    samples = Samples(wi, wo, colours(wi, wo), False)
    inside, outside = direction(30)[None], direction(80, 60)[None]
    held, zero = as_grid(samples), as_grid(samples, "zero")
    assert np.all(held.evaluate(inside, outside) > 0.05)
    assert np.all(zero.evaluate(inside, outside) == 0)
    assert np.all(zero.evaluate(outside, inside) == 0)
    assert np.all(zero.evaluate(inside, inside) == held.evaluate(inside, inside))


def test_missing_values_and_few_samples():
    wi, wo = pairs(30, 15, 0.05)
    values = colours(wi, wo)
    values[3] = np.nan
    assert np.all(as_grid(Samples(wi, wo, values, False)).evaluate(wi, wo) > 0.05)
    one = as_grid(Samples(wi[:1], wo[:1], values[:1], False))
    np.testing.assert_allclose(one.evaluate(wi, wo), np.broadcast_to(values[0], values.shape))
    with pytest.raises(ValueError, match="No sample has a value"):
        as_grid(Samples(wi[3:4], wo[3:4], values[3:4], False))


@pytest.mark.slow
@pytest.mark.parametrize("parts", [("cornell", "krylon_blue.brdf"), ("retro", "retro-3M-jaune.dat")])
def test_left_out_samples(parts):
    """Every tenth sample is predicted better than by its nearest neighbour, by a ninth at least."""
    samples = read(shared(*parts)).data
    delta = samples.wi[:, 0] * samples.wo[:, 1] - samples.wi[:, 1] * samples.wo[:, 0]
    # One of each mirrored pair, lest the other one tell.
    used = np.all(np.isfinite(samples.values), axis=1) & (delta < 1e-9)
    wi, wo, f = samples.wi[used], samples.wo[used], samples.values[used].mean(axis=1, keepdims=True)
    order = np.random.default_rng(1).permutation(len(f))
    left, kept = order[::10], np.delete(order, np.s_[::10])
    points = embedded(wi, wo, False)
    neighbour = f[kept][nearest(points[kept], points[left], 1)[:, 0]]
    grid = as_grid(Samples(wi[kept], wo[kept], f[kept], False))

    def error(found):
        return np.sqrt(np.mean(np.log((found + 1e-3) / (f[left] + 1e-3)) ** 2))

    assert error(grid.evaluate(wi[left], wo[left])) < 0.9 * error(neighbour)


@pytest.mark.slow
def test_noise_of_a_goniometers_samples_is_next_to_none(llvm_rgb, tmp_path):
    """θi every 10°, as in Cornell's files, and half vectors that fill no grid."""
    rng = np.random.default_rng(1)
    h = np.stack([direction(*it) for it in zip(10 * rng.random(800), 360 * rng.random(800), strict=True)])
    wi = np.repeat([direction(theta) for theta in range(10, 90, 10)], 100, axis=0)
    wo = 2 * np.sum(wi * h, axis=1, keepdims=True) * h - wi
    above = wo[:, 2] > 0.05
    wi, wo = (w[above].astype(np.float32) for w in (wi, wo))
    (value,) = call(mi.load_dict({"type": "walter", "alpha": 0.02}).eval, context(), wi, wo)
    angles = [np.arccos(wi[:, 2]), np.arccos(wo[:, 2]), np.arctan2(wo[:, 1], wo[:, 0])]
    rows = np.column_stack([*angles, value / wo[:, 2:]])
    np.savetxt(
        path := tmp_path / "g.csv", rows, "%.7g", ",", header="theta_i_rad,theta_o_rad,phi_o_rad,r,g,b", comments=""
    )
    assert (efficiencies({"type": "tabulated", "filename": str(path)}, (5, 30, 43, 60, 70, 74, 80)) > 0.94).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "parts, least", [(("cornell", "krylon_blue.brdf"), 0.99), (("retro", "retro-3M-jaune.dat"), 0.96)]
)
def test_noise_of_measured_samples_is_next_to_none(llvm_rgb, parts, least):
    bsdf = {"type": "tabulated", "filename": str(shared(*parts))}
    assert (efficiencies(bsdf, (5, 30, 60, 70, 74, 80)) > least).all()
