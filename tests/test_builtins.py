"""Our models against Mitsuba's own where the two are the same model."""

import mitsuba as mi
import numpy as np
import pytest
import scipy.stats
from support import call, efficiencies, hemisphere, is_scalar, near_mirror

GGX = {"type": "roughconductor", "distribution": "ggx"}
PAIRS = {
    "diffuse": ({"type": "lambert", "reflectance": 0.3}, {"type": "diffuse", "reflectance": 0.3}),
    "none": ({"type": "walter", "alpha": 0.3}, GGX | {"alpha": 0.3, "material": "none"}),
    "none anisotropic": (
        {"type": "walter", "material": "none", "alpha_u": 0.05, "alpha_v": 0.4},
        GGX | {"alpha_u": 0.05, "alpha_v": 0.4, "material": "none"},
    ),
    "gold": ({"type": "walter", "alpha": 0.2, "material": "Au"}, GGX | {"alpha": 0.2, "material": "Au"}),
    "eta and k": (
        {"type": "walter", "alpha": 0.6, "eta": 1.5, "k": 2.0, "specular_reflectance": 0.7},
        GGX | {"alpha": 0.6, "eta": 1.5, "k": 2.0, "specular_reflectance": 0.7},
    ),
    "sharp": ({"type": "walter", "alpha": 0.01, "material": "Cu"}, GGX | {"alpha": 0.01, "material": "Cu"}),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_same_values(pair, variant):
    """To float32 round-off: both round the half vector, by some 1e-7, and D has slope 4/α at most: 4e-5 at α = .01.
    Of polarized light these are the intensities: test_polarization has the rest."""
    ours, theirs = map(mi.load_dict, PAIRS[pair])
    count = 100 if is_scalar() else 20_000
    wi = hemisphere(count, 1)
    wo = near_mirror(wi, hemisphere(count, 2), 0.02)
    ctx = mi.BSDFContext()
    expected = call(theirs.eval, ctx, wi, wo)[0]
    assert (expected > 0).mean() > 0.9
    np.testing.assert_allclose(call(ours.eval, ctx, wi, wo)[0], expected, rtol=4e-5, atol=1e-12)


@pytest.mark.usefixtures("llvm_rgb")
def test_same_picture():
    """Per-pixel two-sample t-tests over 32 renders each, at 1 % for the whole picture."""
    pictures = []
    for offset, bsdf in zip((0, 1000), PAIRS["none"], strict=True):
        scene = mi.load_dict(
            {
                "type": "scene",
                "integrator": {"type": "path", "max_depth": 3},
                "sensor": {
                    "type": "perspective",
                    "fov": 35,
                    "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
                    "film": {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}},
                },
                "shape": {"type": "sphere", "bsdf": bsdf},
                "key": {"type": "point", "position": [3, 3, 3], "intensity": 20.0},
                "sky": {"type": "constant", "radiance": 0.5},
            }
        )
        pictures.append(np.array([mi.render(scene, spp=32, seed=seed + offset) for seed in range(32)], np.float64))
    ours, theirs = pictures
    varies = (ours.std(axis=0) > 1e-6) | (theirs.std(axis=0) > 1e-6)
    _, p = scipy.stats.ttest_ind(ours[:, varies], theirs[:, varies], equal_var=False)
    assert varies.sum() > 400
    assert p.min() > 1 - (1 - 0.01) ** (1 / p.size)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_walter_wastes_fewer_samples_than_roughconductor(alpha):
    bsdfs = {"type": "walter", "alpha": alpha}, GGX | {"material": "none", "alpha": alpha}
    ours, theirs = (efficiencies(bsdf, (5, 30, 60, 80)) for bsdf in bsdfs)
    assert (ours >= theirs).all(), (ours, theirs)
    assert ours[0] / theirs[0] >= {0.5: 1.2, 1.0: 1.8}.get(alpha, 1)
