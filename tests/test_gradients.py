"""Derivatives of weights, values and pictures, against finite differences."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import reference
from catalogue import FIRST_ROWS, ROWS, SMOOTH, mostly_slow
from support import direction, hemisphere, interaction, sample_arguments, unit

from mi_brdfs.math import aligned
from mi_brdfs.probe.arrays import columns_of

pytestmark = pytest.mark.usefixtures("llvm_rgb")

FEW = "eon", "ward"
"""Plugins that are always tried."""
PATHS = {"type": "prb", "max_depth": 3}
SAMPLES = 10_000


def scene_of(bsdf, integrator):
    """A sphere under a point light, where a highlight has no noise, and a sky with a broad bright spot, where both the
    light and the BSDF are sampled."""
    v, u = np.mgrid[0:16, 0:32]
    spot = np.exp(-((v - 5) ** 2 + (u - 18) ** 2) / 20)
    sky = np.repeat((0.01 + 0.2 * spot)[..., None], 3, axis=2).astype(np.float32)
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sensor": {
                "type": "perspective",
                "fov": 22,
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 6], [0.25, 0.25, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
            },
            "shape": {"type": "sphere", "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 70), "bsdf": bsdf},
            "key": {"type": "point", "position": [2, 3, 5], "intensity": 20.0},
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky)},
        }
    )


def gradients_of(params, keys, loss):
    """The derivatives of a loss by key, of parameters that have none before and after."""
    for key in keys:
        dr.enable_grad(params[key])
    params.update()
    dr.backward(loss())
    found = {key: dr.grad(params[key]).numpy() for key in keys}
    for key in keys:
        dr.disable_grad(params[key])
    return found


def differences(params, key, entries, step, loss):
    """Central differences of a loss for some entries of a parameter."""
    original = np.array(params[key])
    found = []
    for entry in entries:
        losses = []
        for shift in (step, -step):
            moved = original.copy()
            moved.ravel()[entry] += shift
            update(params, key, moved)
            losses.append(loss())
        found.append((losses[0] - losses[1]) / (2 * step))
    update(params, key, original)
    return found


def update(params, key, array):
    """Set a parameter to the values of a NumPy array."""
    params[key] = aligned(type(params[key])(array))
    params.update()


@pytest.mark.parametrize("name", mostly_slow(SMOOTH, FEW))
def test_weights_have_the_derivatives_of_values(name):
    """The derivative of the mean weight of some samples, for every continuous parameter, is that of f cosθ_o over the
    density where neither this nor the direction moves, by central differences. So E[weight], which is the albedo, has
    the derivative of the albedo: it would not if those were differentiated as well, as the choice among lobes depends
    on the parameters, too. What each channel of a sample counts is random: turns of the frame or of a hue change no sum
    of all alike."""
    bsdf, ctx, rng = mi.load_dict(SMOOTH[name]), mi.BSDFContext(), np.random.default_rng(1)
    params = mi.traverse(bsdf)
    si, variates = interaction(hemisphere(SAMPLES, 2, 0.1)), sample_arguments(rng.random((SAMPLES, 3)))
    counts = rng.random((3, SAMPLES))
    bs, _ = bsdf.sample(ctx, si, *variates, True)
    pdf, wo = np.array(bs.pdf), mi.Vector3f(bs.wo)
    for key in params.keys():  # for all of them to have the same kernels
        update(params, key, np.array(params[key]))

    def weights():
        return dr.dot(bsdf.sample(ctx, si, *variates, True)[1], mi.Color3f(columns_of(counts.T)))

    def values():
        value = np.float64(bsdf.eval(ctx, si, wo, True)) * counts
        return value.sum(axis=0)[pdf > 0] @ (1 / pdf[pdf > 0])

    for key, gradient in gradients_of(params, params.keys(), weights).items():
        step = 0.01 * params[key].numpy().ravel()[0]
        (expected,) = differences(params, key, [slice(None)], step, values)
        assert gradient.sum() == pytest.approx(expected, rel=0.02), key


@pytest.mark.parametrize(
    "name",
    ["eon", *(pytest.param(it, marks=pytest.mark.slow) for it in ("ward balanced", "low smooth", "walter walk"))],
)
def test_prb_agrees_with_finite_differences(name):
    """To 2 %, for every continuous parameter; the picture's brightest parts, so the highlight, weigh most. (The weights
    show a turned frame: the highlight that they would be symmetric to has no derivative for the rotation.)

    Both sides use the same random numbers, so they share most of their noise; what remains is below 1 % for 1M paths.
    A central difference over ±3 % errs by some tenths of a percent.
    """
    turned = {"rotation": SMOOTH[name]["rotation"] + 0.05} if "rotation" in SMOOTH[name] else {}
    weights = dr.square(mi.render(scene_of({**SMOOTH[name], **turned}, PATHS), spp=64, seed=99))
    scene = scene_of(SMOOTH[name], PATHS)
    params = mi.traverse(scene)

    def loss(**seeds):
        return dr.mean(mi.render(scene, params, spp=1 << 12, **seeds) * weights, axis=None)

    keys = [key for key in params.keys() if key.startswith("shape.bsdf.")]
    assert keys
    for key, gradient in gradients_of(params, keys, lambda: loss(seed=2, seed_grad=1)).items():
        step = 0.03 * params[key].numpy().ravel()[0]
        (expected,) = differences(params, key, [slice(None)], step, lambda: loss(seed=1).numpy().item())
        assert gradient.sum() == pytest.approx(expected, rel=0.02), key


@pytest.mark.parametrize(
    "bsdf, key, theta",
    [
        ({"type": "burley", "metallic": 1, "roughness": 0.02}, "roughness", 30),
        ({"type": "cooktorrance", "distribution": "blinn", "alpha": 1.5}, "alpha", 70),
        ({"type": "lafortune", "normalization": "none", "exponent": 1000, "cz": 1.5}, "exponent", 0),
        ({"type": "lafortune", "normalization": "none", "exponent": 1000, "cz": 1.5}, "cz", 0),
    ],
)
def test_limits_within_models_can_be_left(bsdf, key, theta):
    """A parameter may be within its range, but what a model makes of it be limited: the derivatives that lead back from
    there remain."""
    azimuth = 180 if bsdf["type"] == "burley" else 0  # the mirror direction, where a wider lobe is darker
    bsdf = mi.load_dict(bsdf)
    params = mi.traverse(bsdf)
    key = f"{key}.value"
    dr.enable_grad(params[key])
    params.update()
    wi, wo = direction(theta), direction(theta, azimuth)
    dr.backward(bsdf.eval(mi.BSDFContext(), interaction(wi), mi.Vector3f(wo), True)[0])
    derivative = dr.grad(params[key]).numpy().item()
    assert np.isfinite(derivative) and derivative != 0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_limited_roughness_takes_nothing_from_the_other(sign):
    """Burley's αv is held, αu is not: the derivative for what both depend on is a difference's, whichever the loss."""
    bsdf = mi.load_dict({"type": "burley", "base_color": 0, "roughness": 0.04, "anisotropic": 0.9})
    params, ctx = mi.traverse(bsdf), mi.BSDFContext()
    wo = mi.Vector3f(unit([[-0.29, 0.02, 0.95], [-0.2, 0, 0.97]]).T)
    si = interaction(unit([0.3, 0, 0.95]))

    def loss():
        return sign * dr.sum(bsdf.eval(ctx, si, wo, True)[0])

    keys = ["roughness.value", "anisotropic.value"]
    for key, gradient in gradients_of(params, keys, loss).items():
        (expected,) = differences(params, key, [0], 3e-4, lambda: loss().numpy().item())
        assert gradient.item() == pytest.approx(expected, rel=0.01), key


def one_sided(given, name, step):
    """The derivative of a sum of values, weighed at random, for a parameter, and its difference to one side."""
    bsdf, key, ctx = mi.load_dict(given), f"{name}.value", mi.BSDFContext()
    params, weights = mi.traverse(bsdf), mi.Float(np.random.default_rng(3).random(2000))
    si, wo = interaction(hemisphere(2000, 1)), mi.Vector3f(hemisphere(2000, 2).T)

    def total():
        return dr.sum(bsdf.eval(ctx, si, wo, True)[0] * weights)

    (gradient,) = gradients_of(params, [key], total).values()
    before = total().numpy().item()
    params[key] = given[name] + step
    params.update()
    return gradient.item(), (total().numpy().item() - before) / step


@pytest.mark.parametrize("name, step", [("cx", 1e-3), ("cy", 1e-3), ("cz", -1e-3)])
def test_one_of_several_factors_at_their_ends_goes_inwards(name, step):
    """Lafortune's Cmax is that of the others then."""
    gradient, expected = one_sided({"type": "lafortune", "exponent": 20, "cx": -1.5, "cy": -1.5, "cz": 1.5}, name, step)
    assert gradient == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("way", ["walk", "kulla-conty", "turquin"])
@pytest.mark.parametrize(
    "given, name, step",
    [
        ({"type": "walter", "alpha_u": 0.5, "alpha_v": 0.5}, "alpha_u", 2e-3),
        ({"type": "walter", "alpha_u": 0.5, "alpha_v": 0.5}, "alpha_v", -2e-3),
        ({"type": "burley", "roughness": 0.9, "metallic": 1, "anisotropic": 0}, "anisotropic", 4e-3),
    ],
)
def test_where_both_roughnesses_are_the_same_derivatives_are_those_of_one_side(given, name, step, way):
    """Of facets that are stretched along dp_du, as Burley's are if they are: so they are in what facets lose, too. That
    nearly makes up for what the lobe changes by, but not for its curvature: differences leave out the second order."""
    given = given | {"multiscatter": way}
    (gradient, near), (_, far) = one_sided(given, name, step), one_sided(given, name, 2 * step)
    assert gradient == pytest.approx(2 * near - far, rel=0.02)


@pytest.mark.parametrize("way", ["walk", "kulla-conty"])
def test_what_facets_lose_knows_that_total_reflection_moves_with_the_index(way):
    """Without that the derivative was less by a third."""
    given = {"type": "walter", "alpha": 0.5, "int_ior": 1.2, "ext_ior": 1.7, "multiscatter": way}
    gradient, expected = one_sided(given, "int_ior", 1e-3)
    assert gradient == pytest.approx(expected, rel=0.05)


# --- Derivatives of the BSDFs themselves ----------------------------------------------------------------------------


def pairs_of_directions(count=500):
    """``(wi, wo, kinked)``: pairs at random, near and at the mirror direction, back where wi came from, and along and
    near the normal; and where f may have a kink."""
    rng = np.random.default_rng(1)

    def near(w, spread):
        close = unit(w + spread * rng.normal(size=w.shape))
        close[:, 2] = abs(close[:, 2])
        return close

    wi, wo = np.float64(hemisphere(count, 2, 0.05)), np.float64(hemisphere(count, 3, 0.05))
    normal, mirror = np.tile([0.0, 0.0, 1.0], (count, 1)), wi * [-1, -1, 1]
    smooth = [(wi, wo), (wi, near(mirror, 0.05)), (normal, wo), (wi, normal), (near(normal, 1e-4), wo)]
    kinked = [(wi, mirror), (wi, wi)]
    wi, wo = (np.float32(np.concatenate(part)) for part in zip(*smooth, *kinked, strict=True))
    return wi, wo, np.arange(len(wi)) >= len(smooth) * count


@pytest.mark.parametrize(
    "row", mostly_slow([*FIRST_ROWS.values(), *(row for row in ROWS if row.name == "orennayar full")], FEW)
)
def test_derivatives_for_the_directions_agree_with_the_reference(row):
    """Those of eval along tangents of wi and wo, to 2 %, against differences of the float64 reference; at a kink, what
    lies between those to the two sides will do."""
    wi, wo, kinked = pairs_of_directions()
    bsdf, rng = mi.load_dict(row.bsdf), np.random.default_rng(4)
    si, towards = interaction(wi), mi.Vector3f(wo.T)
    inputs = {"wi": si.wi, "wo": towards}
    dr.enable_grad(inputs)
    dr.backward(bsdf.eval(mi.BSDFContext(), si, towards, True)[0], flags=dr.ADFlag.Default | dr.ADFlag.AllowNoGrad)
    for name, w in (("wi", wi), ("wo", wo)):
        w = np.float64(w)
        tangent = rng.normal(size=w.shape)
        tangent = unit(tangent - w * np.sum(tangent * w, axis=1, keepdims=True))
        derivative = np.sum(dr.grad(inputs[name]).numpy().T * tangent, axis=1)

        def value(shift, name=name, w=w, tangent=tangent):
            moved = unit(w + shift[:, None] * tangent)
            return row.reference(moved, wo) if name == "wi" else row.reference(wi, moved)

        step = np.where(kinked, 1e-4, 2e-6)  # at a kink longer than the float32 directions are off it
        here = value(0 * step)
        above, below = (value(step) - here) / step, (here - value(-step)) / step
        expected = np.clip(derivative, np.minimum(above, below), np.maximum(above, below))
        scale = abs(expected) + 1e-3 * here + 1e-4 * abs(expected).max()
        assert (abs(derivative - expected) < 0.02 * scale).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("kappa", [-80.0, 0.0, 40.0, 55.0, 65.0, 80.0])
def test_derivatives_of_a_high_peak(kappa):
    """Of Nishino's distribution, of which the integral without its factor 1/C grows like exp(κ)."""
    wi, wo, _ = pairs_of_directions()
    bsdf = mi.load_dict({"type": "nishino", "gamma": 20.0, "kappa": kappa})
    params = mi.traverse(bsdf)
    dr.enable_grad(params["kappa.value"])
    params.update()
    value = bsdf.eval(mi.BSDFContext(), interaction(wi), mi.Vector3f(wo.T), True)[0]
    dr.forward(params["kappa.value"])
    step = 1e-3
    expected = [
        reference.nishino(wi, wo, 0, 1, k, 20, "microfacet", np.ones_like) for k in (kappa + step, kappa - step)
    ]
    expected = (expected[0] - expected[1]) / (2 * step)
    np.testing.assert_allclose(dr.grad(value).numpy(), expected, rtol=1e-3, atol=1e-4 * abs(expected).max())


# --- Scenes that had none -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("bsdf", [{"type": "orennayar", "model": "full"}, {"type": "roughdiffuse", "alpha": 0.6}])
def test_a_plane_seen_from_straight_above(bsdf):
    """There wi is the normal: the gradients for a normal map and for the heights of the vertices, by a light that makes
    no noise."""
    bitmap = mi.Bitmap(np.tile(np.float32([0.5, 0.5, 1]), (2, 2, 1)))
    normalmap = {"type": "bitmap", "raw": True, "filter_type": "nearest", "bitmap": bitmap}
    props = mi.Properties()
    props["bsdf"] = mi.load_dict({"type": "normalmap", "normalmap": normalmap, "nested": bsdf})
    mesh = mi.Mesh("plane", 4, 2, has_vertex_texcoords=True, props=props)
    params = mi.traverse(mesh)
    params["vertex_positions"] = [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]
    params["vertex_texcoords"] = [0, 0, 1, 0, 1, 1, 0, 1]
    params["faces"] = [0, 1, 2, 0, 2, 3]
    params.update()
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {
                "type": "orthographic",
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
            },
            "plane": mesh,
            "light": {"type": "point", "position": [0.3, 0.2, 2]},
        }
    )
    params = mi.traverse(scene)
    weights = np.random.default_rng(1).random((4, 4, 3), np.float32)

    def picture(**seeds):
        return mi.render(scene, params, spp=16, **seeds)

    def weighted():
        return dr.sum(picture(seed=2, seed_grad=1) * mi.TensorXf(weights), axis=None)

    keys = {"plane.bsdf.normalmap.data": range(12), "plane.vertex_positions": range(2, 12, 3)}
    gradients = gradients_of(params, keys, weighted)
    for key, entries in keys.items():
        expected = differences(params, key, entries, 1e-3, lambda: np.sum(np.float64(picture(seed=1)) * weights))
        found = gradients[key].ravel()[entries]
        np.testing.assert_allclose(found, expected, rtol=0.02, atol=0.01 * np.abs(expected).max(), err_msg=key)


@pytest.mark.parametrize("integrator", ["path", "direct"])
def test_integrators_of_attached_densities_agree_with_prb(integrator):
    """``blendbsdf`` divides by the density that its BSDFs return, and these integrators differentiate what it does."""
    blend = {"type": "blendbsdf", "weight": 0.5, "a": {"type": "walter", "alpha": 0.4}, "b": {"type": "lambert"}}
    scene = scene_of(blend, PATHS | {"max_depth": 2})
    params = mi.traverse(scene)
    (key,) = (name for name in params.keys() if "alpha" in name)

    def gradient(integrator):
        def loss():
            return dr.mean(mi.render(scene, params, integrator=integrator, spp=256, seed=2, seed_grad=1), axis=None)

        return gradients_of(params, [key], loss)[key].item()

    # With the same seed they draw the same samples.
    depth = {} if integrator == "direct" else {"max_depth": 2}
    assert gradient(mi.load_dict({"type": integrator, **depth})) == pytest.approx(
        gradient(scene.integrator()), rel=0.01
    )
