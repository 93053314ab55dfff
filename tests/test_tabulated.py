"""The plugin of measured files: what it evaluates, how it is drawn from, what it shares, what it refuses."""

from __future__ import annotations

import gc
import itertools
import os
import re
import weakref
from pathlib import Path

import drjit as dr
import merl_tables
import mitsuba as mi
import numpy as np
import pytest
from reference import rotate
from scipy.interpolate import RegularGridInterpolator
from support import (
    LOFT,
    call,
    context,
    direction,
    efficiencies,
    hemisphere,
    interaction,
    numbers,
    observed,
    pairs,
    shared,
)

import mi_brdfs
from mi_brdfs.measured import read
from mi_brdfs.probe.sources import find_sources
from mi_brdfs.validation import check

JUDGED = ("horizon", "support", "eval_pdf", "weight", "pdf", "chi2", "components", "recompiles")
"""The checks of how directions are drawn; the values are the file's."""


def ggx(theta_h, theta_d, alpha, f0=(0.9, 0.6, 0.3), diffuse=0.02):
    """A rough conductor without shadowing over a diffuse ground, from its half and difference angles."""
    cos2 = np.cos(theta_h) ** 2
    d = alpha**2 / (np.pi * (cos2 * (alpha**2 - 1) + 1) ** 2)
    f0 = np.array(f0)
    fresnel = f0 + (1 - f0) * (1 - np.cos(theta_d))[..., None] ** 5
    return diffuse + d[..., None] * fresnel / 4


def write_merl(path, f, shape=(90, 30, 36)):
    """Write a table of f(θh, θd, φd), shape (…, 3), where both directions are above the horizon, and -1 elsewhere."""
    places = merl_tables.centres(shape)
    above = merl_tables.lowest(*places) > 0
    return merl_tables.write(path, np.where(above[..., None], f(*places), -merl_tables.SCALE), shape)


@pytest.fixture
def glossy(tmp_path):
    return str(write_merl(tmp_path / "glossy.binary", lambda h, d, p: ggx(h, d, 0.2)))


# --- Values ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "scalar_rgb"])
def test_values_are_those_of_an_independent_trilinear_interpolation(variant, tmp_path):
    shape = 20, 18, 24
    table = np.random.default_rng(3).uniform(0.1, 1, (*shape, 3))
    file = write_merl(tmp_path / "noise.binary", lambda h, d, p: table, shape)
    above = merl_tables.lowest(*merl_tables.centres(shape)) > 0
    usable = np.where(above[..., None], table, np.nan)  # how gaps are filled is another matter
    nodes = [(np.arange(n) + 0.5) / n for n in shape]
    nodes[2] = np.concatenate([nodes[2][-1:] - 1, nodes[2], nodes[2][:1] + 1])  # φd goes round after half a turn
    round_trip = np.concatenate([usable[:, :, -1:], usable, usable[:, :, :1]], axis=2)
    wi, wo = pairs(4000 if variant.startswith("llvm") else 200, 1, 0.1)
    h, d, p = merl_tables.angles(wi, wo)
    interpolator = RegularGridInterpolator(nodes, round_trip, bounds_error=False)
    expected = interpolator(np.stack([np.sqrt(2 * h / np.pi), 2 * d / np.pi, p / np.pi % 1], -1)) * wo[:, 2:]
    inside = np.isfinite(expected[:, 0])  # without the half cells at the ends of the axes
    assert inside.mean() > 0.6
    with mi.variant_context(variant):
        bsdf = mi.load_dict({"type": "merl", "filename": str(file)})
        (value,) = call(bsdf.eval, context(), wi.astype(np.float32), wo.astype(np.float32))
    # An angle's float32, 1e-6 where two directions almost cancel, over the width of a cell, 0.04.
    np.testing.assert_allclose(value[inside], expected[inside], atol=1e-4)


def test_a_lambertian_table_is_lambertian_in_every_variant(variant, tmp_path):
    file = write_merl(tmp_path / "matte.binary", lambda h, d, p: np.array([0.5, 0.5, 0.5]) / np.pi, (45, 45, 36))
    bsdf = mi.load_dict({"type": "tabulated", "filename": str(file)})
    wi, wo = (hemisphere(50, seed, 0.3) for seed in (1, 2))  # away from cells below the horizon
    (value,) = call(bsdf.eval, context(), wi, wo)
    # White is white in spectral variants, too.
    np.testing.assert_allclose(value, 0.5 / np.pi * np.broadcast_to(wo[:, 2:], value.shape), rtol=1e-4)


def test_rgb_keeps_its_colour_in_spectral_variants(tmp_path):
    colour = np.array([0.7, 0.3, 0.1])
    file = write_merl(tmp_path / "rust.binary", lambda h, d, p: colour / np.pi, (60, 60, 12))
    wavelengths, weights = observed()
    with mi.variant_context("llvm_ad_spectral"):
        bsdf = mi.load_dict({"type": "tabulated", "filename": str(file)})
        si = interaction(np.tile([0, 0, 1], (len(wavelengths), 1)), wavelengths=np.tile(wavelengths[:, None], 4))
        f = numbers(bsdf.eval(context(), si, mi.Vector3f(0.6, 0, 0.8), True))[:, 0] / 0.8
    # The spectra are linear between 48 wavelengths.
    np.testing.assert_allclose(np.pi * f @ weights, colour, atol=2e-3)


def test_scale_is_a_colour_and_has_a_derivative(llvm_rgb, glossy):
    plain = mi.load_dict({"type": "tabulated", "filename": glossy})
    tinted = mi.load_dict({"type": "tabulated", "filename": glossy, "scale": {"type": "rgb", "value": [2, 1, 0.5]}})
    wi, wo = (w.astype(np.float32) for w in pairs(100, 1, 0.1))
    (value,), (scaled,) = (call(bsdf.eval, context(), wi, wo) for bsdf in (plain, tinted))
    np.testing.assert_allclose(scaled, value * [2, 1, 0.5], rtol=1e-5)
    params = mi.traverse(tinted)
    assert list(params.keys()) == ["scale.value"]
    dr.enable_grad(params["scale.value"])
    dr.backward(dr.sum(tinted.eval(context(), interaction(wi), mi.Vector3f(wo.T))))
    np.testing.assert_allclose(np.array(dr.grad(params["scale.value"])).ravel(), value.sum(axis=0), rtol=1e-4)


def test_values_have_a_range(llvm_rgb, glossy):
    """What an optimiser drives below 0 counts as 0, leads back, and is projected."""
    bsdf = mi.load_dict({"type": "tabulated", "filename": glossy, "differentiable": True})
    assert mi_brdfs.ranges(bsdf) == {"scale.value": (0, np.inf), "values": (0, np.inf)}
    wi, wo = (w.astype(np.float32) for w in pairs(64, 1, 0.1))
    params = mi.traverse(bsdf)
    params["values"] = mi.TensorXf(np.array(params["values"]) - 1e3)
    dr.enable_grad(params["values"])
    params.update()
    value = bsdf.eval(context(), interaction(wi), mi.Vector3f(wo.T))
    assert not np.array(value).any()
    dr.backward(-dr.sum(value))
    assert np.array(dr.grad(params["values"])).min() < 0
    mi_brdfs.project(params)
    assert np.array(params["values"]).min() == 0


@pytest.mark.slow
def test_negative_channels_of_a_file_stay_in_range(llvm_rgb):
    file = str(shared("rgl", "chm_mint_rgb.bsdf"))
    bsdf = mi.load_dict({"type": "tabulated", "filename": file, "differentiable": True})
    assert mi_brdfs.ranges(bsdf)["values"] == (-np.inf, np.inf)


def test_values_have_derivatives_on_request(llvm_rgb, glossy):
    bsdf = mi.load_dict({"type": "tabulated", "filename": glossy, "differentiable": True})
    params = mi.traverse(bsdf)
    wi, wo = (w.astype(np.float32) for w in pairs(64, 1, 0.1))
    (value,) = call(bsdf.eval, context(), wi, wo)
    table = params["values"]
    dr.enable_grad(table)
    params.update()
    dr.backward(dr.sum(bsdf.eval(context(), interaction(wi), mi.Vector3f(wo.T))))
    # f is linear in the table: the derivatives weigh its values to f.
    gradient = np.array(dr.grad(params["values"]), np.float64)
    assert np.sum(gradient * np.array(params["values"])) == pytest.approx(value.sum(), rel=1e-4)
    params["values"] = mi.TensorXf(2 * np.array(params["values"]))
    params.update()
    (doubled,) = call(bsdf.eval, context(), wi, wo)
    np.testing.assert_allclose(doubled, 2 * value, rtol=1e-5)
    params["values"] = mi.TensorXf([1.0, 2.0])  # kernels would read beyond it
    with pytest.raises(ValueError, match=r"values has the shape \(2,\); it must have"):
        params.update()


REAL = {
    "Zemax": lambda: LOFT,
    "MBSDF": lambda: shared("mbsdf", "carpaint_red.mbsdf"),
    "Zemax, anisotropic": lambda: shared("loft", "IMX455.bsdf"),
    "RGL": lambda: shared("rgl", "chm_mint_rgb.bsdf"),
}
"""A file of each kind of table; those that the repository may not contain are skipped where they are not."""
KINDS = ["Zemax", *(pytest.param(kind, marks=pytest.mark.slow) for kind in [*REAL][1:])]


@pytest.mark.parametrize("interpolation", ["trilinear", "nearest"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_table_is_looked_up_as_in_numpy(llvm_rgb, kind, interpolation):
    path, (wi, wo) = REAL[kind](), pairs(20000, 1, 0.1)
    wo[:8000] = wi[:8000] * [-1, -1, 1] + np.random.default_rng(3).normal(0, 0.05, (8000, 3))
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    bsdf = mi.load_dict({"type": "tabulated", "filename": str(path), "interpolation": interpolation})
    (value,) = call(bsdf.eval, context(), wi.astype(np.float32), wo.astype(np.float32))
    above = wo[:, 2] > 0.01
    expected = read(path).data.evaluate(wi, wo, interpolation)[above] * wo[above, 2:]
    # Between nodes that differ by a factor, the float32 of an angle is 1e-5 of f; and it may be nearest to another one.
    off = abs(value[above] - expected).max(axis=1) > 2e-4 * expected.max()
    assert off.mean() <= (0 if interpolation == "trilinear" else 1e-3)


def test_rotation_turns_an_anisotropic_table(llvm_rgb, tmp_path):
    path, (wi, wo) = tmp_path / "streaks.csv", pairs(1000, 1, 0.1)
    angles = itertools.product((0, 40, 80), range(0, 360, 60), (0, 40, 80), range(0, 360, 60))
    rows = [f"{i},{p},{o},{p + d},{2 + np.cos(np.radians(2 * p - d)) * i / 80}\n" for i, p, o, d in angles]
    path.write_text("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f\n" + "".join(rows))
    plain = mi.load_dict({"type": "tabulated", "filename": str(path)})
    assert mi.has_flag(plain.flags(), mi.BSDFFlags.Anisotropic)
    rotated = mi.load_dict({"type": "tabulated", "filename": str(path), "rotation": 0.1})
    (value,) = call(plain.eval, context(), wi.astype(np.float32), wo.astype(np.float32))
    wi, wo = (rotate(w, -0.1).astype(np.float32) for w in (wi, wo))
    (same,) = call(rotated.eval, context(), wi, wo)
    np.testing.assert_allclose(same, value, atol=1e-3 * value.max())


def test_calls_can_be_frozen(llvm_rgb, glossy):
    """What kernels read is found."""
    bsdf, (wi, wo) = mi.load_dict({"type": "merl", "filename": glossy}), pairs(100, 1)

    frozen = dr.freeze(lambda bsdf, si, wo: bsdf.eval(context(), si, wo))
    for k in (1, 10, 100):
        si, towards = interaction(wi[:k]), mi.Vector3f(wo[:k].T)
        np.testing.assert_allclose(numbers(frozen(bsdf, si, towards)), numbers(bsdf.eval(context(), si, towards)))
    assert frozen.n_recordings < 3


# --- Sampling -------------------------------------------------------------------------------------------------------


SAMPLED = [0.3, *(pytest.param(it, marks=pytest.mark.slow) for it in (0.03, "Zemax, anisotropic", "RGL"))]
"""Metals by their roughness, and real files."""


@pytest.mark.parametrize("of", SAMPLED)
def test_sampling_and_density_pass_the_checks(llvm_rgb, tmp_path, of):
    made = tmp_path / "metal.binary"
    file = REAL[of]() if of in REAL else write_merl(made, lambda h, d, p: ggx(h, d, of))
    report = check({"type": "tabulated", "filename": str(file)}, only=JUDGED)
    assert not report.failures, report


def test_noise_is_next_to_none(llvm_rgb, tmp_path):
    for alpha in (0.01, 0.5):
        file = write_merl(tmp_path / f"{alpha}.binary", lambda h, d, p, alpha=alpha: ggx(h, d, alpha))
        assert (efficiencies({"type": "tabulated", "filename": str(file)}, (5, 30, 60, 80)) > 0.96).all()


def test_scalar_variants_draw_alike(glossy):
    wi = np.array([direction(theta, 20) for theta in (5, 45, 85)], np.float32)
    u, v = (np.random.default_rng(1).random((3, n)).astype(np.float32) for n in (1, 2))
    drawn = []
    for variant in ("scalar_rgb", "llvm_ad_rgb"):
        with mi.variant_context(variant):
            bsdf = mi.load_dict({"type": "merl", "filename": glossy})
            wo, _, weight = call(bsdf.sample, context(), wi, u, v)
            value, density = call(bsdf.eval_pdf, context(), wi, wo.astype(np.float32))
        np.testing.assert_allclose(weight * density, value, rtol=1e-3, atol=1e-6 * value.max())
        drawn.append((wo, value, density))
    for scalar, compiled in zip(*drawn, strict=True):
        # Where a density rises steeply, the float32 of a direction is 1 % of it.
        np.testing.assert_allclose(scalar, compiled, rtol=0.02, atol=1e-4)


# --- Files ----------------------------------------------------------------------------------------------------------


def test_a_file_is_in_memory_once(llvm_rgb, glossy):
    several = [mi.load_dict({"type": kind, "filename": glossy}) for kind in ("merl", "tabulated") * 5]
    tables = {id(bsdf.model.tables) for bsdf in several}
    assert len(tables) == 1
    other = mi.load_dict({"type": "merl", "filename": glossy, "differentiable": True})
    assert id(other.model.tables) not in tables
    dead = weakref.ref(several[0].model.tables)
    del several
    gc.collect()
    assert dead() is None


def test_a_file_that_changes_is_read_again(llvm_rgb, tmp_path):
    """Also if its size and its time do not."""
    path = tmp_path / "matte.binary"
    values = []
    for albedo in (0.2, 0.6):
        write_merl(path, lambda h, d, p, albedo=albedo: np.full(3, albedo / np.pi), (9, 9, 18))
        os.utime(path, (0, 0))
        bsdf = mi.load_dict({"type": "merl", "filename": str(path)})
        (value,) = call(bsdf.eval, context(), *np.array([[[0, 0, 1]], [[0.6, 0, 0.8]]], np.float32))
        values.append(value[0, 0])
    assert values[1] == pytest.approx(3 * values[0], rel=1e-5)


def test_a_relative_name_is_beside_the_scene(llvm_rgb, glossy, tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<scene version="3.0.0"><bsdf type="twosided" id="b"><bsdf type="merl">'
        '<string name="filename" value="glossy.binary"/></bsdf></bsdf></scene>'
    )
    assert mi.load_file(str(scene)) is not None


def test_what_is_wrong_is_said_in_a_sentence(llvm_rgb):
    for given, sentence in [
        ({}, "tabulated: filename is missing; give the path of the measured file."),
        ({"filename": ""}, "filename is empty"),
        ({"filename": "nowhere.binary"}, "nowhere.binary: No such file or directory."),
        ({"filename": "."}, "is a directory; give a file in it."),
    ]:
        with pytest.raises(RuntimeError, match=re.escape(sentence)):
            mi.load_dict({"type": "tabulated", **given})


def test_the_quantity_of_a_file_that_does_not_state_it(llvm_rgb, tmp_path):
    """And large values, the density of which is finite."""
    file, wi, wo = tmp_path / "x.csv", direction(0)[None], direction(60)[None]
    rows = [f"{i},{o},{p},4e35,1,1" for i in (0, 80) for o in (0, 60, 80) for p in (0, 120, 240)]
    file.write_text("\n".join(["theta_i_deg,theta_o_deg,phi_o_deg,r,g,b", *rows]))
    given = [{"type": "tabulated", "filename": str(file), "quantity": it} for it in ("f", "f cos")]
    f, f_cos = (call(mi.load_dict(it).eval_pdf, context(), wi, wo) for it in given)
    np.testing.assert_allclose(f_cos[0], f[0] / 0.5, rtol=1e-5)
    assert np.isfinite(f[1]).all() and (f[1] > 0).all()


def test_commands_take_the_file_itself_and_know_its_plugin(llvm_rgb, glossy):
    assert "tabulated" in mi_brdfs.info("merl") and "tabulated" not in mi_brdfs.list_models()
    (source,) = find_sources(glossy, {"extrapolate": "zero"})
    assert source.load() == {"type": "tabulated", "filename": glossy, "extrapolate": "zero"}
    with pytest.raises(RuntimeError, match=r"nowhere\.binary: No such file"):
        list(find_sources("nowhere.binary"))


def test_a_file_may_have_the_name_of_a_plugin(llvm_rgb, glossy, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("ward").symlink_to(glossy)
    assert [next(find_sources(word)).load()["type"] for word in ("ward", "./ward")] == ["ward", "tabulated"]


# --- MERL's own files, where there are some --------------------------------------------------------------------------

MERL = sorted(Path(os.environ.get("MI_BRDFS_MERL_DIR", "nowhere")).glob("*.binary"))
WITH_MERL = pytest.mark.skipif(not MERL, reason="MI_BRDFS_MERL_DIR names no folder with MERL's .binary files")


def test_merls_folder_is_looked_in(llvm_rgb, tmp_path, monkeypatch):
    write_merl(tmp_path / "made-up.binary", lambda h, d, p: ggx(h, d, 0.2), (9, 9, 18))
    with pytest.raises(RuntimeError, match="No such file"):
        mi.load_dict({"type": "merl", "filename": "made-up.binary"})
    monkeypatch.setenv("MI_BRDFS_MERL_DIR", str(tmp_path))
    assert mi.load_dict({"type": "merl", "filename": "made-up.binary"}) is not None


@WITH_MERL
@pytest.mark.slow
def test_noise_of_merls_materials(llvm_rgb):
    found = np.array([efficiencies({"type": "merl", "filename": str(path)}, (5, 30, 60, 80)) for path in MERL])
    assert (np.median(found, axis=0) >= 0.99).all()
    assert (found >= 0.96).all()


@WITH_MERL
@pytest.mark.slow
@pytest.mark.parametrize("path", MERL, ids=lambda path: path.stem)
def test_sampling_merls_materials(llvm_rgb, path):
    angles = (5, 25, 45, 65, 85)
    report = check({"type": "merl", "filename": str(path)}, only=JUDGED, angles=angles, significance=0.01 / len(MERL))
    assert not report.failures, report
