"""Optimisation from random starts, with steps that overshoot: parameters end within their ranges."""

import zlib

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from fuzzing import ways
from reference import fresnel_conductor
from support import hemisphere, interaction, numbers

import mi_brdfs
from mi_brdfs.microfacet.fresnel import Conductor
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.probe.arrays import floats

pytestmark = pytest.mark.usefixtures("llvm_rgb")

SIDE = 10
STARTS, PAIRS = SIDE * SIDE, 12
LARGEST = 1e3
"""Ranges that go on beyond are searched up to here: wider ones hold lobes that 12 pairs of directions do not meet."""

UNIT = 1e-3
"""Up to which a loss is that of values, and beyond which of their logarithms."""


class Problem:
    """Find the parameters of a BSDF again from its values for some pairs of directions, from many starts at once: each
    parameter is a bitmap, of which each pixel belongs to one start."""

    def __init__(self, given, quantities):
        self.rng = np.random.default_rng(zlib.crc32(" ".join(quantity.name for quantity in quantities).encode()))
        self.quantities = quantities
        bitmaps = {name: self._bitmap(np.zeros((SIDE, SIDE, 1))) for name in self.limits()}
        self.bsdf = mi.load_dict(given | bitmaps)
        self.params = mi.traverse(self.bsdf)
        self.keys = {name: f"{name}.data" for name in bitmaps}
        v, u = np.mgrid[0:SIDE, 0:SIDE]
        uv = np.stack([u.ravel(), v.ravel()], axis=-1) / SIDE + 0.5 / SIDE
        wi = np.tile(hemisphere(PAIRS, 1, 0.2), (STARTS, 1))
        near = wi * [-1, -1, 1] + np.random.default_rng(2).normal(0, 0.15, wi.shape)
        near[:, 2] = np.maximum(near[:, 2], 0.1)
        self.si = interaction(wi)
        self.si.uv = mi.Point2f(np.repeat(uv, PAIRS, axis=0).T.astype(np.float32))
        self.wo = mi.Vector3f((near / np.linalg.norm(near, axis=1, keepdims=True)).T.astype(np.float32))
        self.set({name: self.draw(limits) for name, limits in self.limits().items()})
        self.target = dr.detach(self.values())
        dr.eval(self.target)  # before the bitmaps change, which CUDA keeps in one place
        self.starts = {name: self.draw(limits) for name, limits in self.limits().items()}

    def limits(self):
        return {q.name: (max(q.limits[0], -LARGEST), min(q.limits[1], LARGEST)) for q in self.quantities}

    @staticmethod
    def _bitmap(data):
        bitmap = mi.Bitmap(np.float32(data), mi.Bitmap.PixelFormat.Y)
        return {"type": "bitmap", "bitmap": bitmap, "filter_type": "nearest", "raw": True, "format": "variant"}

    def draw(self, limits):
        """Values between the limits, of all magnitudes if these are far apart."""
        low, high = limits
        if low >= 0 and high > 10:
            return np.exp(self.rng.uniform(np.log(max(low, 0.5)), np.log(high), STARTS))
        return self.rng.uniform(low, high, STARTS)

    def set(self, values):
        for name, drawn in values.items():
            self.params[self.keys[name]] = mi.TensorXf(floats(np.broadcast_to(drawn, STARTS)), (SIDE, SIDE, 1))
        self.params.update()

    def values(self):
        return mi.luminance(self.bsdf.eval(mi.BSDFContext(), self.si, self.wo, True))

    def squares(self, values):
        """What the loss of each start is a sum of."""
        return dr.square(dr.asinh(values / UNIT) - dr.asinh(self.target / UNIT))

    def losses(self):
        """The loss of each start."""
        values = self.values()
        dr.eval(values)  # by the kernel of the target
        return np.array(self.squares(values)).reshape(STARTS, PAIRS).sum(axis=1)

    def attached(self, keys, settings):
        """The values of some settings, with derivatives for all of ``keys``, so that these share a kernel."""
        self.set(settings)
        for key in keys:
            dr.enable_grad(self.params[key])
        self.params.update()
        return self.bsdf.eval(mi.BSDFContext(), self.si, self.wo, True)

    def backward(self, keys, key, settings, sign):
        """The derivative of ``sign`` times the sum of a start's values with respect to its parameter."""
        values = self.attached(keys, settings)
        dr.backward(dr.opaque(mi.Float, sign) * mi.luminance(values))
        return np.array(dr.grad(self.params[key]).array)

    def forward(self, keys, key, settings):
        """The derivative of each channel of a start's values, as far as it counts in them, with respect to its
        parameter."""
        values = self.attached(keys, settings)
        for each in keys:
            dr.set_grad(self.params[each], dr.opaque(mi.TensorXf, each == key, (SIDE, SIDE, 1)))
            dr.enqueue(dr.ADMode.Forward, self.params[each])
        dr.traverse(dr.ADMode.Forward)
        counted = [mi.luminance(mi.Color3f(*row.tolist()))[0] for row in np.eye(3)]
        return (numbers(dr.grad(values), STARTS * PAIRS) * counted).reshape(STARTS, PAIRS, 3)

    def optimise(self, steps):
        """The losses in the beginning and at the end, and where the parameters end, by name."""
        self.set(self.starts)
        before = self.losses()
        optimizer = mi.ad.Adam(lr=1)
        for key in self.keys.values():
            optimizer[key] = self.params[key]
        self.params.update(optimizer)
        for step in range(steps):
            decay = 0.4 * 0.5 ** (6 * step / steps)
            rates = {self.keys[n]: decay * min(high - low, 50) for n, (low, high) in self.limits().items()}
            optimizer.set_learning_rate(rates)
            dr.backward(self.squares(self.values()))  # of which the sum would be a kernel of its own
            optimizer.step()
            self.params.update(optimizer)
            mi_brdfs.project(self.params, optimizer)
        return before, self.losses(), {n: np.array(self.params[k]).ravel() for n, k in self.keys.items()}


FEW = "eon", "ward"
"""Models that are always tried: one of numbers that are shares, and one whose number has a logarithmic range."""
MODELS = [
    pytest.param(model, id=model.plugins[0], marks=[] if model.plugins[0] in FEW else pytest.mark.slow)
    for model in own_models()
]


def problems(model):
    """One for each way to give the parameters of a model. Films, whose derivatives take long to compile, are tried on
    one model, and on one lobe: they are the same on all."""
    for options in ways(model.declared()):
        if "film" in str(options):
            if model.plugins[0] != "walter":
                continue
            options = options.without("haze", "haze_spread", "retroreflectivity")
        given = {"type": model.plugins[0], **options.words}
        try:
            yield str(options), Problem(given, options.quantities)
        except RuntimeError as error:  # words that do not go together
            assert "is not known for distribution" in str(error)


@pytest.mark.parametrize("model", MODELS)
def test_adam_ends_within_the_ranges(model):
    """From a hundred starts each; and it gets nearer to the values that it is to find."""
    for name, problem in problems(model):
        before, after, ends = problem.optimise(20)
        for quantity in problem.quantities:
            low, high = np.float32(quantity.limits)
            assert ((ends[quantity.name] >= low) & (ends[quantity.name] <= high)).all(), (name, quantity.name)
        assert np.isfinite(after).all(), name
        assert np.median(after) < 0.5 * np.median(before), name


LIMITED_WITHIN = {"burley": ("roughness", "anisotropic"), "lafortune": ("cx", "cy", "cz", "exponent")}
"""Parameters of which a model limits what it makes of them, too, so that a value's derivative may lose a part."""


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_beyond_the_ranges_lead_back(model):
    """Each value that a descent inwards lowers has the derivative that it has at the limit, and the others none; and
    forward derivatives are those at the limit. Channels of colours are values of their own."""
    led, seen = 0, set()
    for name, problem in problems(model):
        drawn = {n: problem.draw(limits) for n, limits in problem.limits().items()}
        colours = {quantity.name for quantity in problem.quantities if quantity.colour}
        ranges = {key: limits for key, limits in mi_brdfs.ranges(problem.bsdf).items() if key in problem.keys.values()}
        new = {key: limits for key, limits in ranges.items() if (key, limits) not in seen}  # to other words
        seen |= set(new.items())
        for key, (low, high) in new.items():
            parameter = key.partition(".")[0]
            for limit, inward in ((low, 1), (high, -1)):
                if not np.isfinite(limit):
                    continue
                at, beyond = drawn | {parameter: limit}, drawn | {parameter: limit - inward * (0.3 + 1e-3 * abs(limit))}
                slope = problem.forward(new, key, at)
                noise = 1e-6 + 1e-5 * abs(slope).max()
                led_back = problem.forward(new, key, beyond)
                np.testing.assert_allclose(led_back, slope, rtol=1e-4, atol=noise, err_msg=name)
                slope = slope.reshape(STARTS, -1) if parameter in colours else slope.sum(axis=-1)
                for sign in (1, -1):
                    expected = np.where(sign * slope * inward < 0, sign * slope, 0).sum(axis=1)
                    got = problem.backward(new, key, beyond, sign)
                    if parameter.partition("_")[0] in LIMITED_WITHIN.get(model.plugins[0], ()):
                        assert (got * inward <= 0).all(), name
                    else:
                        np.testing.assert_allclose(got, expected, rtol=1e-3, atol=PAIRS * noise, err_msg=name)
                    led += np.count_nonzero(got)
    assert led > STARTS / 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "given, name, start, target",
    [
        ({"type": "orennayar"}, "sigma", 0.8, 0.05),
        ({"type": "orennayar", "model": "full"}, "alpha", 0.8, 0.05),
        ({"type": "roughdiffuse"}, "alpha", 0.8, 0.05),
        ({"type": "low"}, "int_ior", 2, 1.05),
        ({"type": "low", "variant": "smooth"}, "int_ior", 2, 1.05),
        ({"type": "toon"}, "diffuse_smooth", 0.8, 0.05),
        ({"type": "toon"}, "specular_smooth", 0.8, 0.05),
        ({"type": "nishino", "variant": "microfacet"}, "int_ior", -0.5, 1.3),
    ],
)
def test_a_limit_without_a_derivative_is_left(given, name, start, target):
    """From where σ², the reflectance of a dielectric or an edge do not change with it, and from beyond: with and
    without projection."""
    bsdf, key = mi.load_dict(given | {name: target}), f"{name}.value"
    params = mi.traverse(bsdf)
    low, _ = mi_brdfs.ranges(bsdf)[key]
    wi, wide = hemisphere(400, 1, 0.1), hemisphere(400, 2, 0.1)
    near = wi * [-1, -1, 1] + np.random.default_rng(3).normal(0, 0.2, wi.shape)
    near[:, 2] = np.maximum(near[:, 2], 0.1)
    wo = np.concatenate([wide[:200], (near / np.linalg.norm(near, axis=1, keepdims=True))[200:]])
    si, wo = interaction(wi), mi.Vector3f(wo.T.astype(np.float32))

    def values():
        return mi.luminance(bsdf.eval(mi.BSDFContext(), si, wo, True))

    expected = dr.detach(values())
    dr.eval(expected)
    for projected in (False, True):
        optimizer = mi.ad.Adam(lr=0.1)
        optimizer[key] = mi.Float(start)
        params.update(optimizer)
        lowest = start
        for _ in range(200):
            dr.backward(dr.mean(dr.square(dr.asinh(values()) - dr.asinh(expected))))
            optimizer.step()
            params.update(optimizer)
            lowest = min(lowest, optimizer[key][0])
            if projected:
                mi_brdfs.project(params, optimizer)
        assert lowest < low
        assert optimizer[key][0] == pytest.approx(target, abs=0.02), projected


@pytest.mark.parametrize(
    "bsdf, black",
    [
        ({"type": "orennayar", "model": "full"}, "reflectance"),
        ({"type": "roughdiffuse"}, "reflectance"),
        ({"type": "walter", "alpha": 0.5, "f82": 0.5, "f90": 0.0}, "f0"),
    ],
)
def test_a_black_surface_can_become_brighter(bsdf, black):
    loaded = mi.load_dict(bsdf | {black: 0.0})
    params = mi.traverse(loaded)
    key = next(key for key in params.keys() if key.startswith(black))
    dr.enable_grad(params[key])
    params.update()
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    dr.backward(mi.luminance(loaded.eval(mi.BSDFContext(), si, mi.Vector3f(0.6, 0, 0.8), True)))
    assert dr.grad(params[key])[0] > 0.1


@pytest.mark.parametrize("k", [0.0, 1e-4, 0.01, 1.0])
@pytest.mark.parametrize("eta", [0.2, 0.5, 1.5])
def test_derivatives_for_the_extinction(eta, k):
    """Also where hardly any light is absorbed and all of it reflected, beyond the critical angle. Where it vanishes at
    0, it is another, with which an optimisation leaves it."""
    cos, step = np.cos(np.radians([10, 40, 50, 60, 80])), 1e-6
    extinction = dr.full(mi.Float, k, len(cos))
    dr.enable_grad(extinction)
    found = Conductor(mi.Float(eta), extinction)(mi.Float(cos))
    dr.forward(extinction)
    expected = (fresnel_conductor(cos, eta, k + step) - fresnel_conductor(cos, eta, k)) / step
    counts = (expected < -0.01) if k == 0 else np.ones(len(cos), bool)
    assert counts.any() or eta > 1
    # The derivatives of terms near 1 cancel.
    np.testing.assert_allclose(np.array(dr.grad(found))[counts], expected[counts], rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(np.array(found), fresnel_conductor(cos, eta, k), atol=1e-6)


def test_where_no_extinction_has_no_derivative_it_is_that_of_another():
    """Also just below the critical angle of 30°, where that for k² grows without bounds."""
    cos, step = np.cos(np.radians([10, 29, 29.9])), 1e-6
    extinction = dr.full(mi.Float, 0, len(cos))
    dr.enable_grad(extinction)
    found = Conductor(mi.Float(0.5), extinction)(mi.Float(cos))
    dr.forward(extinction)
    within = (fresnel_conductor(cos, 0.5, 0.3 + step) - fresnel_conductor(cos, 0.5, 0.3)) / step
    np.testing.assert_allclose(np.array(dr.grad(found)), within, rtol=2e-3)
