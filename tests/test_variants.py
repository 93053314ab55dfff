"""Every model in every variant that there is, in threads, in frozen functions, and what of it can be copied."""

import copy
import functools
import importlib
import itertools
import os
import signal
from concurrent.futures import ThreadPoolExecutor

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from catalogue import REPRESENTATIVES, ROWS
from support import call, fresh_process, hemisphere, is_scalar, near_mirror, sphere

import mi_brdfs
from mi_brdfs import starting
from mi_brdfs.mitsuba import registry
from mi_brdfs.mitsuba.registry import own_models

NAMES = [model.plugins[0] for model in own_models()]
RICHEST = {
    row.bsdf["type"]: row
    for row in sorted(ROWS, key=lambda row: len(row.bsdf))
    if not row.sharp and not any(isinstance(given, dict) for given in row.bsdf.values())
}
"""The row of each model with the most parameters, among the grey ones: they mean the same in every variant."""

PLATFORMS = [
    f"{backend}_ad_{colour}"
    for backend in ("llvm", "cuda", "metal")
    for colour in ("rgb", "mono", "mono_polarized", "spectral", "spectral_polarized")
]
VARIANTS = list(dict.fromkeys([*mi.variants(), *PLATFORMS]))
"""What this Mitsuba has, and what it comes with on other platforms."""
COMPILED_RGB = ["llvm_ad_rgb", "cuda_ad_rgb", "metal_ad_rgb"]


def mostly_slow(variants):
    """The variants as parameters: but for the first of LLVM's they are slow."""
    return [pytest.param(name, marks=[] if name == "llvm_ad_rgb" else pytest.mark.slow) for name in variants]


@pytest.fixture(scope="module", params=mostly_slow(VARIANTS))
def variant(request):
    """Each variant in turn, unless this Mitsuba or this machine is without it. Whether it is does not depend on our
    plugins: they are registered only afterwards."""
    if request.param not in mi.variants():
        pytest.skip(f"this Mitsuba has no {request.param}")
    try:
        importlib.import_module(f"mitsuba.{request.param}")
    except ImportError as error:
        pytest.skip(f"{request.param} does not run here: {error}")
    with mi.variant_context(request.param):
        yield request.param


def value_and_density(bsdf):
    """What a BSDF is at a few pairs of directions."""
    return call(bsdf.eval_pdf, mi.BSDFContext(), hemisphere(20, 1), hemisphere(20, 2))


def check_each(check, cases):
    """A check of each case by its name, that fails with all that go wrong."""
    flaws = []
    for name, case in cases.items():
        try:
            check(case)
        except Exception as error:
            while error.__cause__:
                error = error.__cause__
            flaws.append(f"{name}: {type(error).__name__}: {error}")
    assert not flaws, "\n".join(flaws)


# --- The matrix -----------------------------------------------------------------------------------------------------


def with_mueller(bsdf):
    """``bsdf.eval_pdf_sample``, which gives all but the first entries of its Mueller matrices as well."""

    def method(*arguments):
        value, pdf, bs, weight = bsdf.eval_pdf_sample(*arguments)
        matrices = (value, weight) if mi.is_polarized else ()
        others = list(itertools.product(range(4), range(4)))[1:]
        return value, pdf, bs, weight, *(matrix[entry] for matrix in matrices for entry in others)

    return method


def polarizes(bsdf):
    """Whether it has facets of a conductor or a dielectric; the lobe of ``low``'s smooth variant has no facets."""
    return not {"eta", "material", "int_ior"}.isdisjoint(bsdf) and bsdf.get("variant") != "smooth"


def in_plain_python():
    return is_scalar() and not mi.is_polarized


def check_values_and_samples(row):
    bsdf, ctx = with_mueller(mi.load_dict(row.bsdf)), mi.BSDFContext()
    count = 40 if is_scalar() else 2000
    rng = np.random.default_rng(3)
    u, v = rng.random((count, 1)), rng.random((count, 2))
    wi = hemisphere(count, 1)
    given = near_mirror(wi, (sphere if row.transmits else hemisphere)(count, 2), 0.1)
    sampled = call(bsdf, ctx, wi, given, u, v)[2].astype(np.float32)
    for wo in (given, sampled):
        value, pdf, _, density, weight, *mueller = call(bsdf, ctx, wi, wo, u, v)
        expected = np.where(abs(wo[:, 2]) > 0.02, row.reference(wi, wo), 0)
        checked = expected > 1e-6 * expected.max()
        assert checked.mean() > 0.1
        np.testing.assert_allclose(value[checked], np.broadcast_to(expected[checked, None], value[checked].shape), 1e-4)
        assert (pdf[checked] > 0).all()
        assert np.any(mueller) == (mi.is_polarized and polarizes(row.bsdf))
    np.testing.assert_allclose(pdf, density, rtol=1e-4, atol=1e-6)
    drawn = density[:, 0] > 0
    assert drawn.mean() > 0.3
    np.testing.assert_allclose(weight[drawn], value[drawn] / pdf[drawn], rtol=1e-4, atol=1e-7)
    assert not weight[~drawn].any()
    for of_value, of_weight in zip(mueller[:15], mueller[15:], strict=True):
        np.testing.assert_allclose(of_weight[drawn], of_value[drawn] / pdf[drawn], rtol=1e-3, atol=1e-5)
    if in_plain_python():
        bsdf = mi.load_dict(row.bsdf)
        for each, own in ((call(bsdf.eval, ctx, wi, wo)[0], value), (call(bsdf.pdf, ctx, wi, wo)[0], pdf)):
            np.testing.assert_allclose(each, own, rtol=1e-6)


def test_values_and_samples(variant):
    """Values are the reference's, as close as in test_values, where samples go, near the mirror direction and
    elsewhere; weights are value over density, in all elements; and only conductors and dielectrics polarize. Where
    nothing has to be compiled for it, all choices of a model are tried, and ``eval`` and ``pdf`` are what they are
    together."""
    rows = (row for row in REPRESENTATIVES if not any(isinstance(given, dict) for given in row.bsdf.values()))
    check_each(check_values_and_samples, {row.name: row for row in rows} if in_plain_python() else RICHEST)


@functools.cache
def keys_in(variant):
    """The keys of all parameters, by plugin name and for some of the rows."""
    with mi.variant_context(variant):
        bsdfs = {name: {"type": name} for name in NAMES}
        bsdfs |= {row.name: row.bsdf for row in RICHEST.values()}
        return {name: list(mi.traverse(mi.load_dict(bsdf)).keys()) for name, bsdf in bsdfs.items()}


def test_parameters_have_the_same_keys(variant):
    assert keys_in(variant) == keys_in("scalar_rgb")


@pytest.mark.slow
@pytest.mark.parametrize("variant", COMPILED_RGB, indirect=True)
def test_bsdfs_outlive_changes_of_variant(variant):
    """In a process that begins with a compiled variant, lest a value of that is kept and met by another."""
    variants = [variant, variant.replace("rgb", "spectral"), "scalar_rgb"]
    with fresh_process() as process:
        first, again = process.submit(there_and_back, variants).result()
    for before, after in zip(first, again, strict=True):
        np.testing.assert_array_equal(before, after)


def there_and_back(variants):
    """What all models are in each of some variants, and what the same BSDFs are after all of them."""
    bsdfs, first, again = [], [], []
    for variant in variants:
        mi.set_variant(variant)
        bsdfs.append([mi.load_dict(row.bsdf) for row in RICHEST.values()])
        first += [result for bsdf in bsdfs[-1] for result in value_and_density(bsdf)]
    for variant, loaded in zip(variants, bsdfs, strict=True):
        mi.set_variant(variant)
        again += [result for bsdf in loaded for result in value_and_density(bsdf)]
    return first, again


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("sent, raised", [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, starting.Terminated)])
def test_signals_wait_until_all_plugins_are_registered(sent, raised, monkeypatch):
    register, registered = registry._register_for, []

    def struck(variant):
        os.kill(os.getpid(), sent)
        register(variant)
        registered.append(variant)

    mi.set_variant("scalar_rgb")
    monkeypatch.setattr(registry, "_register_for", struck)
    former = signal.signal(signal.SIGTERM, starting._exit)
    try:
        with pytest.raises(raised):
            mi.set_variant("llvm_ad_rgb")
    finally:
        signal.signal(signal.SIGTERM, former)
    assert registered[-1:] == ["llvm_ad_rgb"]


# --- Threads --------------------------------------------------------------------------------------------------------

IN_THREADS = pytest.mark.parametrize("variant", mostly_slow(["scalar_rgb", *COMPILED_RGB]), indirect=True)


def check_loaded(bsdfs):
    """That the BSDFs of all rows are what they are when loaded one by one."""
    alone = [mi.load_dict(row.bsdf) for row in ROWS]
    assert list(map(str, bsdfs)) == list(map(str, alone))
    for k in [ROWS.index(row) for row in RICHEST.values()]:
        np.testing.assert_array_equal(value_and_density(bsdfs[k])[0], value_and_density(alone[k])[0], str(alone[k]))


@IN_THREADS
def test_loading_in_threads(variant):
    """Each of them beside others of its model, and beside some that fail, each with its own error."""
    with ThreadPoolExecutor(8) as pool:
        futures = [[pool.submit(mi.load_dict, bsdf) for bsdf in (row.bsdf, row.bsdf | {"alfa": 1})] for row in ROWS]
    for row, (_, bad) in zip(ROWS, futures, strict=True):
        assert f"{row.bsdf['type']}: unknown parameter alfa" in str(bad.exception())
    check_loaded([good.result() for good, _ in futures])


@IN_THREADS
@pytest.mark.parametrize("loader", ["load_dict", "load_string"])
def test_loading_a_scene_of_many(variant, loader):
    """Mitsuba's loaders instantiate the plugins of a scene in parallel, and name the one that is wrong."""
    given = [row.bsdf for row in ROWS]
    check_loaded(load(loader, given))
    with pytest.raises(RuntimeError, match="ward: unknown parameter alfa"):
        load(loader, [*given, {"type": "ward", "alfa": 1}, *given])


def load(loader, bsdfs):
    """The BSDFs of a scene of spheres."""
    scene = {"type": "scene"} | {f"sphere_{k}": {"type": "sphere", "bsdf": bsdf} for k, bsdf in enumerate(bsdfs)}
    if loader == "load_string":
        scene = mi.parser.write_string(mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), scene))
    return [shape.bsdf() for shape in getattr(mi, loader)(scene, parallel=True, optimize=False).shapes()]


# --- Frozen functions -----------------------------------------------------------------------------------------------

CONTROL = {"type": "roughconductor", "alpha": 0.3}
"""A BSDF of Mitsuba, to tell what can be expected."""


def evaluate(bsdf, wi, wo):
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = wi
    return bsdf.eval_pdf(mi.BSDFContext(), si, wo)


def pairs(seed):
    return (mi.Vector3f(hemisphere(500, seed + offset).T) for offset in (0, 100))


def check_frozen_values(bsdf):
    bsdf, frozen = mi.load_dict(bsdf), dr.freeze(evaluate)
    params = mi.traverse(bsdf)
    for seed in range(4):
        directions = list(pairs(seed))
        ours, expected = frozen(bsdf, *directions), evaluate(bsdf, *directions)
        dr.eval(ours, expected)
        for each, own in zip(ours, expected, strict=True):
            assert dr.any(own > 0, axis=None)
            np.testing.assert_array_equal(np.array(each), np.array(own))
        for key in params.keys():
            if key.endswith(".value"):
                params[key] = params[key] * 0.95
        params.update()
    assert frozen.n_recordings == 1


@pytest.mark.parametrize("variant", COMPILED_RGB, indirect=True)
def test_frozen_values(variant):
    """Recorded once, and replayed for other directions and other parameters."""
    check_each(check_frozen_values, {"roughconductor": CONTROL} | {name: row.bsdf for name, row in RICHEST.items()})


def tiles():
    """A square of each model beside the other, under a sky of radiance one."""
    T, n = mi.ScalarTransform4f, len(NAMES)
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": {
            "type": "perspective",  # Mitsuba cannot freeze its orthographic one
            "fov": np.degrees(2 * np.arctan(0.25)),
            "to_world": T().look_at([n, 0, 4 * n], [n, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 8 * n, "height": 8, "rfilter": {"type": "box"}},
        },
        "sky": {"type": "constant"},
    }
    for k, name in enumerate(NAMES):
        to_world = T().translate([2 * k + 1, 0, 0]).rotate([1, 1, 0], 30)
        scene[name] = {"type": "rectangle", "to_world": to_world, "bsdf": {"type": name}}
    return mi.load_dict(scene)


@pytest.mark.parametrize("variant", COMPILED_RGB, indirect=True)
def test_frozen_pictures(variant):
    """In a process of its own: Dr.Jit records no picture while a BSDF that its scene does not hold is alive."""
    with fresh_process() as process:
        process.submit(check_frozen_pictures, variant).result()


def check_frozen_pictures(variant):
    mi.set_variant(variant)
    scene = tiles()
    params = mi.traverse(scene)
    keys = [key for key in params.keys() if "bsdf" in key and key.endswith(".value")]

    def picture(scene, seed):
        return mi.render(scene, spp=4, seed=seed)

    frozen = dr.freeze(picture, auto_opaque=False)
    for seed in range(5):
        images = [np.array(render(scene, dr.opaque(mi.UInt32, seed))) for render in (frozen, picture)]
        np.testing.assert_allclose(*images, rtol=1e-5)
        for key in keys:
            params[key] = params[key] * 0.95
        params.update()
    assert frozen.n_recordings < 5


@pytest.mark.parametrize("bsdf", [CONTROL, {"type": "ward"}], ids=lambda bsdf: bsdf["type"])
@pytest.mark.parametrize("variant", COMPILED_RGB, indirect=True)
def test_frozen_optimisation(variant, bsdf):
    """A step of an optimiser, gradients and all, is the same frozen, and so are the next ones."""

    def step(bsdf, params, optimizer, wi, wo):
        params.update(optimizer)
        value, _ = evaluate(bsdf, wi, wo)
        dr.backward(dr.sum(value, axis=None))
        optimizer.step()
        return value

    def steps(step):
        loaded = mi.load_dict(bsdf)
        params = mi.traverse(loaded)
        params.keep(r".*alpha.value")
        (key,) = params.keys()
        optimizer = mi.ad.Adam(lr=0.01)
        optimizer[key] = params[key]
        values = [np.array(step(loaded, params, optimizer, *pairs(seed))) for seed in range(5)]
        return values, np.array(optimizer[key])

    frozen = dr.freeze(step)
    (values, alpha), (frozen_values, frozen_alpha) = steps(step), steps(frozen)
    np.testing.assert_allclose(frozen_values, values, rtol=1e-5)
    np.testing.assert_allclose(frozen_alpha, alpha, rtol=1e-5)
    assert alpha != pytest.approx(np.array(mi.traverse(mi.load_dict(bsdf))["alpha.value"]))
    assert frozen.n_recordings < 5


# --- Copies ---------------------------------------------------------------------------------------------------------


def described(declared):
    """All that declarations say of themselves."""
    return [(type(parameter), parameter.names, parameter.shown, parameter.rows()) for parameter in declared]


def bound(model, declared, bsdf):
    """What a model with the given declarations makes of a configuration, in words."""
    twin = type(model.__name__, (model,), {"plugins": model.plugins, **{each.name: each for each in declared}})
    props = mi.Properties()
    for name, given in bsdf.items():
        if name != "type":
            props[name] = mi.load_dict(given) if isinstance(given, dict) else given
    return str(vars(twin(props)))


def test_a_changed_deepcopy_leaves_the_model_alone():
    """Also where it declares parameters of its own, of which one may belong to several words."""
    model = mi_brdfs.mitsuba.registry.find_model("microfacet")
    before = described(model.declared())
    declared = copy.deepcopy(model.declared())
    assert described(declared) == before and bound(model, declared, {"alpha": 0.1})
    distribution = next(parameter for parameter in declared if parameter.name == "distribution")
    distribution.words["beckmann"]["alpha"].limits = (0.05, 0.5)
    assert described(model.declared()) == before != described(declared)
    assert bound(model, model.declared(), {"alpha": 0.04})
    with pytest.raises(ValueError, match=r"alpha = 0.04 is not allowed; it must be a number in \[0.05, 0.5\]"):
        bound(model, declared, {"alpha": 0.04})


@pytest.mark.parametrize("variant", ["scalar_rgb"], indirect=True)
def test_preview_scenes_are_the_users_own(variant):
    """Changing one changes neither the next nor the material that it was made of."""
    material = {"type": "ward", "specular_reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.3]}}
    given = copy.deepcopy(material)
    scene = mi_brdfs.preview_scene(given, stage="lamp")
    scene["sensor"]["film"].update(width=4, height=3)
    scene["key"]["radius"] *= 2
    other = mi_brdfs.preview_scene(given, stage="lamp")
    assert (other["sensor"]["film"]["width"], 2 * other["key"]["radius"]) == (512, scene["key"]["radius"])
    assert given == material
    smaller = copy.copy(scene) | {"integrator": {"type": "direct"}}
    assert mi.render(mi.load_dict(smaller), spp=1).shape == (3, 4, 3)
    assert scene["integrator"]["type"] == "path"
