"""Values against the independent float64 reference."""

import mitsuba as mi
import numpy as np
import pytest
from catalogue import EXTREME, ROWS, mostly_slow
from support import call, direction, hemisphere, sphere

ROUNDING = 2e-7
"""A few float32 ulp of the length of a direction."""
COSINES = [1, 0.999, 0.9, 0.7, 0.4, 0.1, 0.05, 0.02]


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", mostly_slow([*ROWS, *EXTREME]))
def test_matches_the_reference(row):
    """Within 1e-4 where f is above 1e-6 of its peak: a few float32 ulp, times the at most 14 e-foldings of a lobe. What
    is seen there can be sampled. Where total reflection begins, the slope of F has no end: there it may differ by what
    a rounded direction makes of the reference."""
    bsdf, ctx = mi.load_dict(row.bsdf), mi.BSDFContext()
    rng = np.random.default_rng(7)
    wi = np.repeat([direction(np.degrees(np.arccos(cosine)), 37) for cosine in COSINES], 6000, axis=0)
    wo = call(bsdf.sample, ctx, wi, rng.random((len(wi), 1)), rng.random((len(wi), 2)))[0].astype(np.float32)
    around = sphere if row.transmits else hemisphere
    wo = np.where((abs(wo) if row.transmits else wo)[:, 2:] < 0.02, around(len(wi), 8), wo)
    uniform = np.arange(len(wi)) % 6000 < 2000
    wo[uniform] = around(uniform.sum(), 9)
    value, pdf = (result[:, 0] for result in call(bsdf.eval_pdf, ctx, wi, wo))
    expected = row.reference(wi, wo)
    highest = expected.reshape(len(COSINES), -1).max(axis=1)
    checked = expected > np.repeat(1e-6 * highest, 6000)
    assert (checked.reshape(len(COSINES), -1).sum(axis=1) > 500).all()
    assert (pdf[checked] > 0).all()
    other = checked & (abs(value - expected) > 1e-4 * expected)
    if other.any():
        rounded = [row.reference(wi[other], wo[other] + [0, 0, error]) for error in (-ROUNDING, ROUNDING)]
        sensitivity = abs(rounded - expected[other]).max(axis=0)
        np.testing.assert_array_less(abs(value - expected)[other], 1e-4 * expected[other] + sensitivity)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", mostly_slow(EXTREME))
def test_finite_at_grazing_and_normal_incidence(row):
    bsdf, ctx = mi.load_dict(row.bsdf), mi.BSDFContext()
    special = [[0, 0, 1], [1, 0, 1e-7], [0, -1, 1e-4], [0.6, 0.8, 1e-20], [1e-20, 0, 1], [0.6, 0, 0.8]]
    special = np.concatenate([np.array(special, np.float32), (sphere if row.transmits else hemisphere)(200, 3, 0)])
    wi, wo = (np.repeat(special, len(special), axis=0), np.tile(special, (len(special), 1)))
    value, pdf = call(bsdf.eval_pdf, ctx, wi, wo)
    assert np.isfinite(value).all() and np.isfinite(pdf).all() and (value >= 0).all() and (pdf >= 0).all()
    uniform = np.array([[0, 0, 0], [0, 0, 1 - 2**-24], [0, 1 - 2**-24, 0], [1 - 2**-24] * 3, [0.5, 0.5, 0.5]])
    uniform = np.concatenate([uniform, np.random.default_rng(4).random((100, 3))])
    wi, samples = np.repeat(special, len(uniform), axis=0), np.tile(uniform, (len(special), 1))
    wo, pdf, weight = call(bsdf.sample, ctx, wi, samples[:, :1], samples[:, 1:])
    assert np.isfinite(wo).all() and np.isfinite(pdf).all() and np.isfinite(weight).all() and (weight >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(wo, axis=1), 1, atol=1e-5)
