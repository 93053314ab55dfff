"""What `mi-brdfs measured` says of a file, against values known in advance; what it draws, and how it fails."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from merl_tables import centres, lowest, write
from support import spherical, traced
from test_cli import invoke

from mi_brdfs import plot
from mi_brdfs.cli import measured
from mi_brdfs.measured import Axis, FileError, Grid, Measurement, Samples, read, summarize
from mi_brdfs.measured.coordinates import HalfDifference, SpecularPolar, Spherical
from mi_brdfs.measured.formats import FORMATS
from mi_brdfs.measured.report.albedo import albedos, hemisphere
from mi_brdfs.measured.report.reciprocity import reciprocity_error
from mi_brdfs.measured.scattered import as_grid
from mi_brdfs.observer import to_srgb
from mi_brdfs.parameters.messages import listed
from mi_brdfs.plot.measured import LitTable

DIMENSIONS = 30, 30, 60
REFLECTANCE = np.array([0.2, 0.5, 0.8])


@pytest.fixture(autouse=True)
def fewer_nodes(request, monkeypatch):
    """An eighth of the nodes of albedos: all are for lobes, whose tests have them."""
    if "lobe" not in request.node.name:
        monkeypatch.setattr("mi_brdfs.measured.report.albedo.RADII", 48)
        monkeypatch.setattr("mi_brdfs.measured.report.albedo.TURNS", 16)


@pytest.fixture
def lambert(tmp_path):
    return write(tmp_path / "lambert.binary", REFLECTANCE / np.pi, DIMENSIONS)


def goniometer(values=1 / np.pi, radial=60.0, anisotropic=False, stated=None, channels=1, turns=4):
    """Values at θi = 0, 30 and 60° within a cone about the mirror direction."""
    radii, azimuths = np.radians(np.linspace(0, radial, 13)), np.radians(np.arange(0, 181, 15))
    axes = [Axis(np.radians([0, 30, 60])), Axis(azimuths), Axis(radii)]
    if anisotropic:
        axes = [axes[0], Axis(np.radians(np.arange(0, 360, 15)), period=2 * np.pi), axes[2],
                Axis(np.arange(turns) * 2 * np.pi / turns, period=2 * np.pi)]  # fmt: skip
    shape = *(len(axis.nodes) for axis in axes), channels
    grid = Grid(SpecularPolar(not anisotropic, anisotropic), tuple(axes), np.broadcast_to(values, shape).copy())
    return Measurement(Path("paint.bsdf"), "Zemax", grid, wavelengths=np.array([650.0]), stated_albedos=stated or {})


def rows(measurement):
    return dict(summarize(measurement).rows())


# --- Albedos --------------------------------------------------------------------------------------------------------


class Lobe(Grid):
    """A Phong lobe about the mirror direction of wi, or about wi, without a table's interpolation."""

    exponent, retro = 20_000, False

    def integrated(self, wi, wo, weight, extrapolate="hold"):
        centre = wi if self.retro else wi * [-1, -1, 1]
        cos = np.maximum(np.sum(centre * wo, axis=-1), 0)
        return weight @ ((self.exponent + 2) / (2 * np.pi) * cos**self.exponent)[..., None]


@pytest.mark.parametrize("retro", [False, True])
@pytest.mark.parametrize("exponent", [2, 200, 20_000, 2_000_000])
def test_the_albedo_of_a_lobe_of_any_width(exponent, retro):
    """It is cosθi where the horizon cuts nothing off: 20,000 is as narrow as facets of alpha = .005 make it."""
    lobe = Lobe(HalfDifference(), (Axis(np.array([0.5])),) * 3, np.ones((1, 1, 1, 1)))
    lobe.exponent, lobe.retro = exponent, retro
    angles = np.radians({2: [0], 200: [0, 7, 30, 45]}.get(exponent, [0, 0.1, 3, 30, 60, 75, 80, 82]))
    found = albedos(lobe, angles, phi_i=0.7)
    np.testing.assert_allclose(found[:, 0], np.cos(angles), rtol=2e-3)


@pytest.mark.parametrize("extrapolate", ["hold", "zero"])
@pytest.mark.parametrize("anisotropic", [False, True])
def test_a_table_is_integrated_as_it_is_evaluated(anisotropic, extrapolate):
    grid = goniometer(np.random.default_rng(1).random((3, 24 if anisotropic else 13, 13, *[4] * anisotropic, 2)),
                      anisotropic=anisotropic, channels=2).data  # fmt: skip
    grid.values[1, 2:5] = np.nan
    wi, (wo, solid_angle) = spherical(*np.degrees([0.6, 0.4])), hemisphere(0.6, 0.4)
    expected = solid_angle @ grid.evaluate(wi, wo, extrapolate=extrapolate)
    np.testing.assert_allclose(grid.integrated(wi, wo, solid_angle, extrapolate), expected, rtol=1e-9)


CHANNELS = 1000
FEW = Grid(Spherical(False), tuple(Axis(np.arange(1.0, n)) for n in (2, 3, 3)), np.ones((1, 2, 2, CHANNELS)))
SCATTERED = Samples(*(spherical(*np.random.default_rng(k).random((2, 20)) * 60) for k in (1, 2)),
                    np.ones((20, CHANNELS)), False)  # fmt: skip


@pytest.mark.parametrize(
    "function, megabytes",
    [
        (lambda: albedos(FEW, np.array([0.5])), 30),
        (lambda: as_grid(SCATTERED), 400),
        (lambda: LitTable(Measurement(Path("x"), "test", SCATTERED, np.linspace(300, 1300, CHANNELS))), 30),
        (lambda: to_srgb(np.linspace(300, 4300, 4001)), 10),
    ],
)
def test_many_wavelengths_take_little_memory(function, megabytes):
    assert traced(function)[2] < megabytes * 1e6


def test_directions_that_are_none_are_refused():
    grid, up = goniometer().data, np.array([[0, 0, 1.0]])
    for direction in [(0, 0, 0), (0, np.nan, 1), (0, 0, 2), (0, 0, np.inf), (0, 0, 1.01), (0, 1)]:
        for pair in ((up, np.array([direction])), (np.array([direction]), up)):
            for function in (grid.evaluate, grid.measured):
                with pytest.raises(ValueError, match=r"^directions must (have the length 1, not|be arrays of shape)"):
                    function(*pair)


# --- The summary ----------------------------------------------------------------------------------------------------


def test_counts_are_exact(tmp_path):
    """Negative, missing and zero values above the horizon, and those below it, are those that were planted."""
    rng = np.random.default_rng(1)
    above = np.broadcast_to((lowest(*centres(DIMENSIONS)) > 0)[..., None], (*DIMENSIONS, 3))
    f = rng.uniform(0.1, 1, above.shape)
    f[0, 0, 0] = 4
    kind = rng.choice(5, above.shape, p=[0.9, 0.04, 0.03, 0.02, 0.01])
    kind[0, 0, 0] = 0
    for k, value in enumerate((-0.2, np.nan, 0, np.inf), start=1):
        f[kind == k] = value
    f[1, 1, 1, 2], kind[1, 1, 1, 2] = -0.68, 1
    found = summarize(read(write(tmp_path / "dirty.binary", f, DIMENSIONS)))
    for counts, where in ((found.above, above), (found.below, ~above)):
        expected = [(kind[where] == k).sum() for k in (1, 2, 3, 4)]
        assert counts.values == where.sum()
        assert [counts.negative, counts.missing, counts.zero] == [expected[0], expected[1] + expected[3], expected[2]]
    assert found.most_negative == pytest.approx(-0.68 / 4, rel=1e-5)
    assert found.above.negative > 100 and found.below.negative > 100
    words = dict(found.rows())
    assert f"{found.above.negative:,}" in words["negative"] and "-17 % of the largest" in words["negative"]


def test_reciprocity_is_by_how_much_the_halves_differ(tmp_path):
    """Exchanging the directions turns φd by half a turn: a whole turn of φd can say that they differ."""
    f = np.where(np.arange(60)[:, None] < 30, 0.3, 0.4)
    dimensions = 30, 20, 60
    found = summarize(read(write(tmp_path / "one-way.binary", f, dimensions)))
    assert not found.reciprocal
    assert found.reciprocity.median == pytest.approx(0.25, rel=1e-5)
    assert found.reciprocity.percentile95 == pytest.approx(0.25, rel=1e-5)


def test_reciprocity_of_scattered_samples():
    """Only of those with a partner: 0.2 and 0.3 differ by a third, however an isotropic sample is turned."""
    theta_i, phi_i, theta_o, phi_o = np.transpose([[20, 0, 50, 90], [50, 10, 20, -80], [50, 0, 20, 40], [30, 0, 70, 0]])
    wi, wo = spherical(theta_i, phi_i), spherical(theta_o, phi_o)
    samples = Samples(wi, wo, np.array([[0.2], [0.3], [9.0], [9.0]]), anisotropic=False)
    found = reciprocity_error(samples)
    assert found.pairs == 2
    assert found.median == found.percentile95 == pytest.approx(1 / 3)
    assert reciprocity_error(dataclasses.replace(samples, anisotropic=True)) is None


def test_scattered_samples(tmp_path):
    """Are counted as they are, and drawn in one piece within the angles that were measured, also from one at the end of
    their range: a grey of albedo .3, less what lies beyond 70°, of which the albedo has up to a cell of their grid."""
    angles = np.meshgrid([10, 40], np.arange(0, 71, 10), np.arange(0, 181, 15))
    theta_i, theta_o, phi = np.reshape(angles, (3, -1))
    f = np.full((len(phi), 1), 0.3 / np.pi)
    samples = Samples(spherical(theta_i, 0 * phi), spherical(theta_o, phi), f, anisotropic=False)
    measurement = Measurement(tmp_path / "felt.csv", "CSV", samples, wavelengths=np.array([550.0]))
    words = rows(measurement)
    assert words["values"] == "208, of 208 pairs of directions"
    assert words["measured"].startswith("θi 10 to 40°, θo 0 to 70°; ")
    albedo = summarize(measurement).largest_albedo
    assert 0.3 * np.sin(np.radians(70)) ** 2 < albedo.value < 0.3 * np.sin(np.radians(82)) ** 2
    _, first, _, second, *nodes = lines(plot.measured(measurement).axes[1])
    for curve in (first, second, *nodes):
        seen = np.isfinite(curve[1])
        np.testing.assert_allclose(curve[1][seen], 0.3 / np.pi, rtol=1e-4)
        assert abs(curve[0][seen]).max() == pytest.approx(70, abs=0.6)  # curves have a point every half degree
        assert (np.diff(np.flatnonzero(seen)) == 1).all()
    assert all(set(range(-70, 71, 10)) <= set(theta.round()) for theta, _ in nodes)


def test_nothing_was_measured_both_ways():
    """Where θi is 60° only and θo at most 30°."""
    axes = Axis(np.radians([60.0])), Axis(np.radians([0, 30])), Axis(np.array([0, np.pi]))
    grid = Grid(Spherical(True), axes, np.ones((1, 2, 2, 1)))
    words = rows(Measurement(Path("a.csv"), "CSV", grid, wavelengths=np.array([np.nan])))
    assert words["reciprocity"] == "unknown: no pair of directions was measured both ways"
    assert words["wavelengths"] == "1, not stated" and words["largest albedo"].endswith("θi = 60°")
    assert words["measured"].startswith("θi 60 to 60°, θo 0 to 30°; ")


def test_what_a_table_is_in_words(lambert):
    words = rows(read(lambert))
    assert words["values"] == "162,000, of 30 θh × 30 θd × 60 φd × 3 channels"
    assert words["largest albedo"].startswith("0.8 at ") and words["largest albedo"].endswith(", blue")
    assert words["negative"] == words["missing"] == words["zero"] == "none"
    words = rows(goniometer(anisotropic=True))
    assert words["symmetry"] == "anisotropic" and "φi = 0°" in words["largest albedo"]
    spectral = goniometer(np.linspace(0.1, 0.2, 31), channels=31)
    words = rows(dataclasses.replace(spectral, wavelengths=np.arange(400.0, 701, 10)))
    assert words["wavelengths"] == "31 from 400 to 700 nm" and words["largest albedo"].endswith(", 700 nm")


def test_the_range_of_a_goniometer():
    """A cone of 60° about the normal is half of the hemisphere, and nothing beyond it counts in its scatter: the
    integral of cosθ/π over it is sin²60°."""
    found = summarize(goniometer(stated={0.0: [0.75], np.pi / 6: [0.5]}))
    assert found.theta_i == (0, 60) and found.theta_o[0] == 0 and found.theta_o[1] == pytest.approx(85, abs=5)
    assert found.coverage[1] == pytest.approx(0.5, abs=0.01)
    first, second = found.scatter
    assert (first.stated, first.theta_i, second.theta_i) == (0.75, 0, 30)
    assert first.integrated == pytest.approx(0.75, rel=0.01)
    assert second.integrated == pytest.approx(0.75 * np.cos(np.pi / 6), rel=0.01)  # the horizon cuts nothing off
    assert dict(found.rows())["stated TIS"].startswith("0.5 at θi = 30°; the values' albedo is 0.6")


def test_each_rotation_has_its_stated_albedo():
    values = np.array([1, 2, 3, 4])[:, None] / (10 * np.pi)
    measurement = goniometer(values, radial=150, anisotropic=True, stated={0.0: [0.1, 0.2, 0.3, 0.5]})
    found = summarize(measurement)
    assert [it.phi_i for it in found.scatter] == [0, 90, 180, 270]
    np.testing.assert_allclose([it.integrated for it in found.scatter], [0.1, 0.2, 0.3, 0.4], rtol=1e-3)
    assert (found.largest_albedo.value, found.largest_albedo.phi_i) == (pytest.approx(0.4, rel=1e-3), 270)


def test_the_largest_albedo_may_be_at_any_azimuth():
    """Also at one of 12 that the first look leaves out."""
    values = 0.1 + 0.01 * np.maximum(3 - abs(np.arange(12) - 5), 0)
    found = summarize(goniometer(values[:, None] / np.pi, radial=150, anisotropic=True, turns=12)).largest_albedo
    assert (found.value, found.phi_i) == (pytest.approx(0.13, rel=1e-3), 150)


def test_a_file_without_numbers_above_the_horizon(tmp_path):
    below = lowest(*centres(DIMENSIONS)) < 0
    path = write(tmp_path / "empty.binary", np.where(below, 1, np.nan)[..., None], DIMENSIONS)
    with pytest.raises(FileError, match=r"empty\.binary: no value above the horizon is a number"):
        summarize(read(path))


# --- The command ----------------------------------------------------------------------------------------------------


def test_the_command_tells_of_each_file_and_goes_on_after_a_bad_one(lambert, tmp_path):
    done = invoke("measured", lambert, tmp_path, lambert, "--json", tmp_path / "a.json", "--plot", tmp_path / "a.png")
    assert done.exit_code == 1
    assert done.stderr == f"mi-brdfs: {tmp_path} is a directory; give a file in it.\n"
    assert done.stdout.count("162,000, of 30 θh × 30 θd × 60 φd × 3 channels") == 2
    assert done.stdout.count(str(lambert)) == 2 and done.stdout.endswith("a.png\n")
    one, other = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert one == other == json.loads(json.dumps(summarize(read(lambert)).to_dict()))
    assert one["above"]["values"] + one["below"]["values"] == 162_000
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_the_help_names_the_formats():
    assert listed([format.NAME for format in FORMATS]) == measured.FORMATS


# --- The pictures ---------------------------------------------------------------------------------------------------


def lines(ax):
    """The curves and points of a panel that have data."""
    return [np.array(line.get_data(), dtype=float) for line in ax.lines]


def test_the_slice_has_the_colours_of_the_material(lambert):
    """Lambert's is even: of the luminance at the end of the scale, with the display's values of the hue."""
    (image,) = plot.measured(lambert).axes[0].images
    shown = image.get_array()
    assert shown.shape == (256, 256, 4) and (shown[..., 3] == 1).all()
    expected = np.tile((REFLECTANCE / 0.8) ** (1 / 2.2), (256, 256, 1))
    np.testing.assert_allclose(shown[..., :3] / shown[..., 2:3], expected, rtol=1e-4)


def test_the_slice_shows_what_was_measured():
    """Up to θi = 60°, and up to an angle of 60° between wo and the mirror direction."""
    figure = plot.measured(goniometer())
    seen = figure.axes[0].images[0].get_array()[..., 3]
    middles = (np.arange(256) + 0.5) / 256 * np.pi / 2
    theta_h, theta_d = np.meshgrid(middles, middles)
    wi = np.stack([np.cos(theta_d) * np.sin(theta_h), np.sin(theta_d), np.cos(theta_d) * np.cos(theta_h)], axis=-1)
    wo = wi * [1, -1, 1]
    cone = np.sum(wi * [-1, -1, 1] * wo, axis=-1) >= 0.5
    assert (seen != (cone & (wi[..., 2] >= 0.5))).mean() < 1e-4
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["not measured"]
    assert 0.1 < seen.mean() < 0.9


def test_lobes_pass_through_the_nodes():
    """A lobe that falls off with the radial angle: each curve is it, each node lies on it, none beyond the cone."""
    radial = np.linspace(0, 60, 13)
    figure = plot.measured(goniometer(np.exp(-radial / 20)[:, None]))
    panel = lines(figure.axes[1])
    for theta_i, curve, nodes in zip((0, 30, 60), panel[1:6:2], panel[6:], strict=True):
        for theta, value in (curve[:, np.isfinite(curve[1])], nodes):
            expected = np.interp(abs(theta - theta_i), radial, np.exp(-radial / 20))
            np.testing.assert_allclose(value, expected, rtol=0.01)
            assert theta.min() == pytest.approx(theta_i - 60, abs=0.5)
            assert theta.max() == pytest.approx(min(theta_i + 60, 90), abs=5.5)
        assert len(nodes[0]) > 15


def test_albedos_are_drawn_beside_those_that_are_stated(lambert):
    red, green, blue, one = lines(plot.measured(lambert).axes[2])
    for curve, albedo in zip((red, green, blue), REFLECTANCE, strict=True):
        np.testing.assert_allclose(curve[1], albedo, rtol=1e-3)
    assert list(one[1]) == [1, 1]
    curve, stated, _ = lines(plot.measured(goniometer(stated={0.0: [0.7], np.pi / 3: [0.3]})).axes[2])
    assert curve[1][0] == pytest.approx(0.75, rel=0.01) and curve[0][-1] == 60
    np.testing.assert_allclose(stated, [[0, 60], [0.7, 0.3]])
