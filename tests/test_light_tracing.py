"""Light that is traced from its source: TransportMode.Importance, as in ``ptracer``, exchanges wi and wo."""

import mitsuba as mi
import numpy as np
import pytest
from catalogue import mostly_slow
from support import call, chi_square, context, direction, hemisphere, is_scalar, sphere

NOT_RECIPROCAL = {
    "toon": {"type": "toon", "diffuse_shadow": 0.2},
    "toon none": {"type": "toon", "normalization": "none", "diffuse_smooth": 0.3},
    "wrap": {"type": "wrap", "wrap": 0.5, "exponent": 3.0},
    "wrap sphere": {"type": "wrap", "domain": "sphere", "wrap": 0.8},
    "minnaert none": {"type": "minnaert", "normalization": "none"},
    "blinnphong original": {"type": "blinnphong", "normalization": "original"},
    "phong original": {"type": "phong", "normalization": "original"},
}
RECIPROCAL = {
    "ward": {"type": "ward", "alpha_u": 0.1, "alpha_v": 0.4, "rotation": 0.1},
    "minnaert": {"type": "minnaert"},
    "burley": {"type": "burley", "clearcoat": 0.5},
}
ALL = NOT_RECIPROCAL | RECIPROCAL
EVERYWHERE = "wrap sphere", "ward"
"""One with light from behind and one without: what exchanges the directions is the same for all models."""


def importance(component=None):
    ctx = context(component)
    ctx.mode = mi.TransportMode.Importance
    return ctx


def directions():
    """wi and wo on both sides of the surface."""
    return sphere(4000, 1), np.concatenate([hemisphere(2000, 2), sphere(2000, 3)])


def roles_are_exchanged(name):
    """f(wi, wo) of one mode is f(wo, wi) of the other."""
    wi, wo = (w[:: 41 if is_scalar() else 1] for w in directions())
    bsdf = mi.load_dict(ALL[name])
    (traced,) = call(bsdf.eval, importance(), wi, wo)
    (seen,) = call(bsdf.eval, mi.BSDFContext(), wo, wi)
    assert traced.any()
    np.testing.assert_allclose(traced / abs(wo[:, 2:]), seen / abs(wi[:, 2:]), rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("name", EVERYWHERE)
def test_the_roles_of_the_directions_are_exchanged(name, variant):
    roles_are_exchanged(name)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", [name for name in ALL if name not in EVERYWHERE])
def test_they_are_exchanged_for_all_models(name):
    roles_are_exchanged(name)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", mostly_slow(NOT_RECIPROCAL))
def test_the_sampler_draws_what_its_density_says(name):
    """By the stock χ² test, also from behind where light shines through; and weights are value over density."""
    bsdf, rng = mi.load_dict(NOT_RECIPROCAL[name]), np.random.default_rng(1)
    cases = [(theta, side) for side in ((1, -1) if "sphere" in name else (1,)) for theta in (10, 50, 80)]
    for theta, side in cases:
        wi = direction(theta, 20) * np.float32([1, 1, side])
        u, v = rng.random((20_000, 1)), rng.random((20_000, 2))
        wo, pdf, weight = call(bsdf.sample, importance(), wi, u, v)
        value, density = call(bsdf.eval_pdf, importance(), wi, wo)
        drawn = (pdf > 0).ravel()
        assert drawn.mean() > 0.5 and (wo[drawn, 2] > 0).all()
        np.testing.assert_allclose(pdf, density, rtol=1e-3)
        np.testing.assert_allclose((weight * pdf)[drawn], value[drawn], rtol=1e-3, atol=1e-6)

        test = chi_square(bsdf, importance(), wi, seed=theta)
        assert test.run(test_count=3 * len(NOT_RECIPROCAL) + 3, quiet=True), f"{theta}° {side}: {test.messages}"


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("side", [1, -1])
def test_a_component_alone_is_lit_from_its_side(side):
    """Of a sheet that reflects and transmits, each component has its own half of the light, and the whole both."""
    bsdf = mi.load_dict(NOT_RECIPROCAL["wrap sphere"])
    wi, wo = hemisphere(1000, 4) * np.float32([1, 1, side]), hemisphere(1000, 5)
    whole, reflected, transmitted = (call(bsdf.eval_pdf, importance(k), wi, wo) for k in (None, 0, 1))
    own, other = (reflected, transmitted) if side > 0 else (transmitted, reflected)
    assert not any(array.any() for array in other) and own[0].any()
    for got, expected in zip(whole, own, strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-5)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", ["wrap sphere", "blinnphong original", "ward"])
def test_a_particle_tracer_sees_what_a_path_tracer_sees(name):
    """A patch under a small lamp, also from behind: the mean brightness, to four standard errors of both over sixteen
    seeds. Of all models the check "mode" has it, by their values and weights."""
    lamp = mi.ScalarTransform4f().look_at([1.5, 0, -1 if "sphere" in name else 1], [0, 0, 0], [0, 0, 1]).scale(0.3)
    scene = {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "fov": 30,
            "to_world": mi.ScalarTransform4f().look_at([-2, 0.5, 2.5], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        },
        "patch": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(0.5), "bsdf": ALL[name]},
        "lamp": {"type": "rectangle", "to_world": lamp, "emitter": {"type": "area", "radiance": 20.0}},
    }
    means, errors = [], []
    for integrator in ("path", "ptracer"):
        loaded = mi.load_dict(scene | {"integrator": {"type": integrator, "max_depth": 2}})
        renders = [np.mean(np.array(mi.render(loaded, seed=seed, spp=256))) for seed in range(16)]
        means.append(np.mean(renders))
        errors.append(np.std(renders, ddof=1) / 4)
    assert np.hypot(*errors) < 0.02 * means[0]
    assert abs(means[1] - means[0]) < 4 * np.hypot(*errors), (means, errors)
