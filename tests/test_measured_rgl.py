"""RGL's tensor files: read as Mitsuba's ``measured`` reads them, refused in a sentence if broken, and written."""

from __future__ import annotations

import re
import struct

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mitsuba import tensor_io
from support import context, interaction, numbers, pairs, refused, shared, traced

from mi_brdfs.measured import read
from mi_brdfs.measured.arrays import DRJIT, NUMPY, components
from mi_brdfs.measured.formats import rgl
from mi_brdfs.measured.source import Source
from mi_brdfs.probe.arrays import WAVELENGTHS, luminance, vectors
from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.probe.directions import direction
from mi_brdfs.probe.variates import lattice, sampling_efficiency

BANDS = np.array([400, 500, 550, 700], dtype=np.float32)


def material(phi_i=(0.0,), jacobian=1, wavelengths=None, theta_i=(0.0, 0.5, 1.1, np.pi / 2)):
    """The fields of a made-up material: smooth maps with random bumps, that respect no physics."""
    random = np.random.default_rng(len(phi_i))
    slices, isotropic = (len(phi_i), len(theta_i)), len(phi_i) <= 2

    def smooth(*shape):
        x, y = np.linspace(0, 1, shape[-1]), np.linspace(0, 1, shape[-2])[:, None]
        side = abs(y - 0.5) if isotropic else y
        a, b, c = (random.random((*shape[:-2], 1, 1)) for _ in range(3))
        return (0.3 + a * np.sin(np.pi * x) ** 2 + b * np.cos(2 * np.pi * y) ** 2 * x + c * side * x).astype(np.float32)

    fields = {
        "description": np.frombuffer(b"Made up", dtype=np.uint8),
        "phi_i": np.array(phi_i, dtype=np.float32),
        "theta_i": np.array(theta_i, dtype=np.float32),
        "ndf": smooth(5, 16),
        "sigma": smooth(3, 9),
        "vndf": smooth(*slices, 12, 20),
        "luminance": smooth(*slices, 7, 7),
        "jacobian": np.array([jacobian], dtype=np.uint8),
    }
    if isotropic:  # in all respects: Mitsuba does not initialize the symmetry by which it turns wi
        fields["sigma"][:] = fields["sigma"][0]
        fields["vndf"][:] = fields["vndf"][0]
    bands = 3 if wavelengths is None else len(wavelengths)
    values = smooth(1 if isotropic else slices[0], slices[1], bands, 7, 7) * np.ones((slices[0], 1, 1, 1, 1), "float32")
    return fields | ({"rgb": values} if wavelengths is None else {"wavelengths": wavelengths, "spectra": values})


KINDS = {
    "isotropic": {},
    "isotropic, two azimuths": {"phi_i": (-np.pi, np.pi)},
    "without Jacobian": {"jacobian": 0},
    "anisotropic": {"phi_i": np.linspace(-np.pi, np.pi, 6)},
    "half a turn": {"phi_i": np.linspace(-np.pi, 0, 4)},
    "a quarter of a turn": {"phi_i": np.linspace(-np.pi, -np.pi / 2, 3)},
    "spectral": {"wavelengths": BANDS},
}


def written(tmp_path, fields):
    """A file with fields, which Mitsuba's reading of it shows to be one."""
    path = tmp_path / "material.bsdf"
    tensor_io.write(str(path), **fields)
    return path


def tried(count):
    """Pairs all over the hemisphere, a third of them near the mirror direction, and a third with wo at grazing."""
    (wi, wo), third = pairs(count, 1, 0.002), count // 3
    wo[:third] = wi[:third] * [-1, -1, 1] + np.random.default_rng(3).normal(0, 0.03, (third, 3))
    wo[third : 2 * third, 2] *= 0.05
    wo[:, 2] = np.maximum(wo[:, 2], 1e-3)
    return wi.astype(np.float32), (wo / np.linalg.norm(wo, axis=1, keepdims=True)).astype(np.float32)


def in_mitsuba(path, wi, wo):
    """f cosθo by Mitsuba's ``measured``."""
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    return numbers(bsdf.eval(context(), interaction(wi), vectors(wo), True))


def agrees(path, count=20000):
    """``Grid.evaluate`` and ``locate_scaled`` in both arithmetics against Mitsuba."""
    wi, wo = tried(count)
    grid, wavelengths = read(path).data, read(path).wavelengths
    expected = in_mitsuba(path, wi, wo)
    found = grid.evaluate(wi, wo) * wo[:, 2:]
    if wavelengths is not None:
        found = np.array([np.interp(WAVELENGTHS, wavelengths, values) for values in found])
    np.testing.assert_allclose(found, expected, rtol=2e-2, atol=1e-5 * expected.max())
    bright = expected > 1e-3 * np.median(expected)
    assert np.quantile(abs(found[bright] / expected[bright] - 1), 0.999) < 1e-3

    places, scale = grid.coordinates.locate_scaled(components(wi), components(wo), NUMPY)
    prepared, scale_prepared = grid.coordinates.prepared().locate_scaled(vectors(wi), vectors(wo), DRJIT)
    for place, there in zip(places, prepared, strict=True):
        turned = abs(place - numbers(there)[:, 0])
        assert np.mean(np.minimum(turned, abs(turned - 1)) > 2e-5) < 1e-4  # but at the seam of the azimuth
    np.testing.assert_allclose(numbers(scale_prepared)[:, 0], scale, rtol=2e-2, atol=1e-6 * np.quantile(scale, 0.99))


@pytest.mark.parametrize("kind", KINDS)
def test_reads_as_mitsuba_does(tmp_path, kind):
    fields = material(**KINDS[kind])
    path = written(tmp_path, fields)
    measurement = read(path)
    assert measurement.material == "Made up" and measurement.format == "RGL"
    assert measurement.data.anisotropic == (len(fields["phi_i"]) > 2)
    with mi.variant_context("llvm_ad_spectral" if "spectral" in kind else "llvm_ad_rgb"):
        agrees(path)


@pytest.mark.slow
def test_reads_real_files_as_mitsuba_does(llvm_rgb):
    """Negative channels, of colours outside sRGB, included."""
    for path in sorted(shared("rgl").glob("*.bsdf")):
        agrees(path)


@pytest.mark.parametrize("kind", KINDS)
def test_directions_are_where_they_are_located(tmp_path, kind):
    """Between the nodes, for normals that wi sees."""
    grid = read(written(tmp_path, material(**KINDS[kind]))).data
    middles = [(axis.nodes[1:] + axis.nodes[:-1]) / 2 for axis in grid.axes]
    places = np.array([place.ravel() for place in np.meshgrid(*middles, indexing="ij")])
    wi, wo = grid.coordinates.directions(*places)
    seen = wi.z + wo.z > 1e-3
    found = np.array(grid.coordinates.locate(wi, wo, NUMPY))
    assert seen.mean() > 0.6
    np.testing.assert_allclose(found[:, seen], places[:, seen], rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["isotropic", "anisotropic"])
def test_all_that_has_no_zero_is_seen(tmp_path, kind):
    """Though coordinates have a scale: where normals are many, places are close."""
    grid, directions = read(written(tmp_path, material(**KINDS[kind]))).data, tried(3000)
    assert (grid.values > 0).all()
    np.testing.assert_array_equal(grid.seen(*directions), grid.measured(*directions))


def test_two_azimuths_that_differ_are_interpolated(tmp_path):
    """Normals stay relative to wi: turning both directions about the normal changes the share of the two alone."""
    fields = material(phi_i=(-np.pi, np.pi))
    fields["rgb"][1] *= 3
    grid = read(written(tmp_path, fields)).data
    assert grid.coordinates.names == ("phi_i", "theta_i", "u1", "u2")
    wi, wo = tried(100)
    azimuth = np.arctan2(wi[:, 1], wi[:, 0])[:, None]
    found, turned = grid.evaluate(wi, wo), grid.evaluate(wi * [-1, -1, 1], wo * [-1, -1, 1])
    share = azimuth / (2 * np.pi) + 0.5
    others = share + np.where(share < 0.5, 0.5, -0.5)
    # The nodes are float32.
    np.testing.assert_allclose(found / (1 + 2 * share), turned / (1 + 2 * others), rtol=1e-5)


def test_at_the_poles(tmp_path, llvm_rgb):
    """Places, scales and their derivatives are finite for directions along the axes, also below the horizon."""
    axes = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0, 0.8], [-0.6, 0, 0.8], [1e-8, 0, 1], [0.8, 0.6, 1e-7]]])
    wi, wo = np.repeat(axes, len(axes), axis=0), np.tile(axes, (len(axes), 1))
    for kind in ("isotropic", "a quarter of a turn"):
        coordinates = read(written(tmp_path, material(**KINDS[kind]))).data.coordinates
        assert np.isfinite(np.array([*coordinates.locate_scaled(components(wi), components(wo), NUMPY)[0]])).all()
        for output in range(len(coordinates.names) + 1):
            given = vectors(wi), vectors(wo)
            dr.enable_grad(*given)
            places, scale = coordinates.prepared().locate_scaled(*given, DRJIT)
            dr.backward([*places, scale][output])
            assert np.isfinite([numbers(scale).T, *(numbers(place).T for place in places)]).all()
            assert np.isfinite([numbers(w.grad) for w in given]).all()
        with mi.variant_context("scalar_rgb"):
            places, scale = coordinates.prepared().locate_scaled(mi.Vector3f(wi[1]), mi.Vector3f(wo[1]), DRJIT)
            assert np.isfinite([*places, scale]).all()


def spoiled(name, change):
    """Fields, of which one is what ``change`` returns in place of the sound one, or left out if that is None."""
    fields = material()
    fields[name] = change(fields[name].copy())
    return {name: field for name, field in fields.items() if field is not None}


def with_value(value, index=0):
    def change(array):
        array.flat[index] = value
        return array

    return change


FIRST = 18 + 2 + len("description")
"""Where the number of dimensions of the first field stands."""
PATCHED = {
    "no magic": (0, b"tenser", "no known format"),
    "version": (12, b"\2", "at byte 12, the version is 2.0"),
    "long name": (18, b"\xff\xff", "at byte 20, 65,535 bytes of a field's name"),
    "65535 dimensions": (FIRST, b"\xff\xff", "524,280 bytes of the shape of 'description' should follow"),
    "type": (FIRST + 2, b"\x0c", "at byte 18, field 'description' is of the unknown type 12"),
    "offset": (FIRST + 3, struct.pack("<Q", 1 << 40), "should follow, but the file ends after 0"),
    "10 GB": (FIRST + 11, struct.pack("<Q", 10**10), "10,000,000,000 bytes of 'description' should follow"),
}
SPOILED = {
    "no vndf": ("vndf", lambda field: None, "without 'vndf'"),
    "two jacobians": ("jacobian", lambda field: np.repeat(field, 2), "'jacobian' is of shape (2,)"),
    "float64": ("rgb", lambda field: field.astype("float64"), "'rgb' is of type float64; it must be float32"),
    "fewer nodes": ("theta_i", lambda field: field[:3], "must be 1 × 3"),
    "NaN node": ("theta_i", with_value(np.nan, 2), "'theta_i' has the value nan"),
    "node beyond the horizon": ("theta_i", with_value(90, 3), "'theta_i' has the value 90"),
    "equal nodes": ("theta_i", with_value(0.5, 2), "'theta_i' must increase, but 0.5 follows 0.5"),
    "negative ndf": ("ndf", with_value(-1, 5), "'ndf' has the value -1"),
    "infinite sigma": ("sigma", with_value(np.inf), "'sigma' has the value inf"),
    "vndf of 0 at an angle": ("vndf", with_value(0, slice(240, 480)), "'vndf' is 0 everywhere"),
    "a column": ("rgb", lambda field: field[..., :1].copy(), "its last two dimensions must be at least 2"),
    "four channels": ("rgb", lambda field: field[:, :, [0, 1, 2, 2]], "must be 1 × 4 × 3"),
}


@pytest.mark.parametrize("case", [*PATCHED, *SPOILED, "cut off", "cut off in the contents"])
def test_malformed_files_are_refused_in_a_sentence(tmp_path, case):
    path = written(tmp_path, spoiled(*SPOILED[case][:2]) if case in SPOILED else material())
    data, words = path.read_bytes(), (PATCHED | SPOILED).get(case, [""])[-1]
    if case in PATCHED:
        offset, patch, _ = PATCHED[case]
        data = data[:offset] + patch + data[offset + len(patch) :]
    elif case not in SPOILED:
        data = data[: -1 if case == "cut off" else 100]
    path.write_bytes(data)
    text = refused(path)
    assert words in text, text
    offset = re.search(r"at byte (\d+), ", text)
    assert offset or case == "no magic"
    if case == "negative ndf":  # offsets are those of the values
        assert struct.unpack_from("<f", data, int(offset[1])) == (-1,)


def test_missing_values_are_kept(tmp_path):
    path = written(tmp_path, spoiled("rgb", with_value([np.nan, np.inf, -1], slice(3))))
    values = read(path).data.values
    assert np.isnan(values).sum() == 2 and (values < 0).sum() == 1
    wi, wo = tried(1000)
    assert np.isfinite(read(path).data.evaluate(wi, wo)).all()


# --- Writing --------------------------------------------------------------------------------------------------------

MODELS = {
    "walter, narrow": {"type": "walter", "alpha": 0.02},
    "ward": {"type": "ward", "alpha": 0.2},
    "walter, anisotropic": {"type": "walter", "alpha_u": 0.1, "alpha_v": 0.3},
    "walter, turned": {"type": "walter", "alpha_u": 0.1, "alpha_v": 0.3, "rotation": 0.1},
}


def source_of(bsdf):
    probe = BSDFProbe(mi.load_dict(bsdf))
    return Source(
        lambda wi, wo: probe.eval(probe.whole, np.float32(wi), np.float32(wo)) / wo[:, 2:],
        anisotropic="alpha_u" in bsdf,
        material=bsdf["type"],
    )


@pytest.mark.parametrize(
    "model", ["ward", *(pytest.param(name, marks=pytest.mark.slow) for name in MODELS if name != "ward")]
)
def test_written_files_are_their_source_in_mitsuba(model, tmp_path, llvm_rgb):
    """By its values at random pairs, and by its albedo from its own sampling, whose weights hardly vary."""
    path = tmp_path / "written.bsdf"
    rgl.write(path, source_of(MODELS[model]), 32 if "alpha_u" in MODELS[model] else None)
    measurement = read(path)
    assert measurement.material == MODELS[model]["type"]
    phi_i = measurement.data.axes[0].nodes if measurement.data.anisotropic else []
    assert len(phi_i) == {"walter, anisotropic": 10, "walter, turned": 19}.get(model, 0)

    wi, wo = tried(30000)
    steep = (wi[:, 2] > 0.17) & (wo[:, 2] > 0.17)
    original, copy = mi.load_dict(MODELS[model]), mi.load_dict({"type": "measured", "filename": str(path)})
    f, found = (numbers(it.eval(context(), interaction(wi), vectors(wo), True)) for it in (original, copy))
    error = abs(found - f)
    assert error[steep].max() < 0.012 * f[steep].max()
    assert error[steep].mean() < 0.006 * f[steep].mean()
    assert abs(np.mean(found - f)) < 0.003 * f.mean()
    np.testing.assert_allclose(measurement.data.evaluate(wi, wo) * wo[:, 2:], found, rtol=1e-3, atol=1e-5 * f.max())

    directions = np.array([direction(theta, 17) for theta in (5, 30, 60, 80)])
    weights = [
        luminance(BSDFProbe(it).weights(BSDFProbe(it).whole, directions, lattice(13, 1))) for it in (original, copy)
    ]
    np.testing.assert_allclose(weights[1].mean(axis=1), weights[0].mean(axis=1), rtol=3e-3)
    assert sampling_efficiency(weights[1]).min() > 0.98


@pytest.mark.slow
def test_spectra_are_written(tmp_path):
    wavelengths = np.array([400.0, 480, 560, 700])

    def f(wi, wo):
        h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
        return (wavelengths - 350) / 400 / np.pi + 3 * h[:, 2:] ** 40 * (wavelengths / 700)

    rgl.write(tmp_path / "written.bsdf", Source(f, wavelengths))
    measurement = read(tmp_path / "written.bsdf")
    np.testing.assert_array_equal(measurement.wavelengths, wavelengths)
    assert measurement.material == "written"
    wi, wo = tried(10000)
    expected = f(wi, wo) * wo[:, 2:]
    expected = np.array([np.interp(WAVELENGTHS, wavelengths, values) for values in expected])
    with mi.variant_context("llvm_ad_spectral"):
        agrees(tmp_path / "written.bsdf", 1000)
        found = in_mitsuba(tmp_path / "written.bsdf", wi, wo)
    steep = (wi[:, 2] > 0.17) & (wo[:, 2] > 0.17)
    assert abs(found - expected)[steep].max() < 0.012 * expected.max()


@pytest.mark.slow
def test_what_scatters_nothing_back_is_written_too(tmp_path):
    """Its distribution of normals cannot be found from that."""

    def forward(wi, wo):
        return np.repeat(np.sum((wi - wo)[:, :2] ** 2, axis=1, keepdims=True) / np.pi, 3, axis=1)

    rgl.write(tmp_path / "written.bsdf", Source(forward))
    wi, wo = tried(10000)
    wi, wo = (w[(wi[:, 2] > 0.17) & (wo[:, 2] > 0.17)] for w in (wi, wo))
    f = forward(wi, wo) * wo[:, 2:]
    error = abs(read(tmp_path / "written.bsdf").data.evaluate(wi, wo) * wo[:, 2:] - f)
    assert error.max() < 0.012 * f.max() and error.mean() < 0.006 * f.mean()


@pytest.mark.slow
def test_reading_takes_little_memory_beyond_the_result(tmp_path):
    path = tmp_path / "written.bsdf"
    rgl.write(path, Source(lambda wi, wo: np.full((len(wi), 3), 0.2)))
    measurement, kept, peak = traced(lambda: read(path))
    assert measurement.data.values.nbytes < kept
    assert peak - kept < 2 * path.stat().st_size


@pytest.mark.slow
def test_an_angle_that_is_black_spoils_none_beside_it_in_mitsuba(tmp_path, llvm_rgb):
    """Between 43.3° and 46.7° samples of either slice are drawn, in proportion to it; that of the latter is 0."""
    source = Source(lambda wi, wo: np.repeat(np.where(wi[:, 2:] > np.cos(np.pi / 4), 0.2, 0), 3, axis=1))
    rgl.write(tmp_path / "written.bsdf", source, 8)
    probe = BSDFProbe(mi.load_dict({"type": "measured", "filename": str(tmp_path / "written.bsdf")}))
    lit, between, dark = probe.weights(probe.whole, np.array([direction(it) for it in (40, 44, 50)]), lattice(8, 1))
    assert between.mean() == pytest.approx(0.8 * lit.mean(), rel=0.05) and not dark.any()
