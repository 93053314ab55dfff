"""BSDFs and measured files in another format: as exact as the format allows, or refused in a sentence."""

import numpy as np
import pytest
from support import pairs
from test_cli import invoke
from test_measured_rows import tabulated

from mi_brdfs.measured import Grid, Measurement, Samples, convert, read
from mi_brdfs.measured.coordinates import Spherical
from mi_brdfs.measured.grid import Axis
from mi_brdfs.probe.bsdf import BSDFProbe

import mitsuba as mi  # isort: skip

pytestmark = pytest.mark.usefixtures("llvm_rgb")


def test_a_baked_bsdf_is_itself_to_one_percent_of_its_peak(tmp_path):
    red = {"type": "rgb", "value": [0.8, 0.2, 0.1]}
    bsdf = {"type": "ward", "alpha": 0.05, "diffuse_reflectance": 0.05, "specular_reflectance": red}
    result = convert(bsdf, tmp_path / "x.binary")
    assert result.format == "MERL" and result.losses == ()
    assert result.rms < 0.001 and result.largest < 0.01
    # What the file holds, found without the code that judged it.
    wi, wo = pairs(4000, 1, 0.3)
    found = read(tmp_path / "x.binary").data.evaluate(wi, wo)
    probe = BSDFProbe(mi.load_dict(bsdf))
    f = probe.eval(probe.whole, wi, wo) / wo[:, 2:]
    assert abs(found - f).max() < 0.01 * f.max() and np.median(abs(found / f - 1)) < 0.005


def test_it_says_what_is_lost(tmp_path):
    lacquer = {"type": "plastic", "diffuse_reflectance": {"type": "checkerboard"}}
    bsdf = {"type": "blendbsdf", "weight": 0.5, "lacquer": lacquer, "glass": {"type": "roughdielectric"}}
    losses = convert(bsdf, tmp_path / "x.binary").losses
    for loss, word in zip(losses, ("delta functions", "transmits", "varies over the surface"), strict=True):
        assert word in loss


def test_it_says_what_was_not_measured(tmp_path):
    file, rows = tmp_path / "x.csv", []
    for i, o, d in np.ndindex(3, 8, 7):
        f = "nan" if d == 3 and o == 2 else -0.5 if o == 1 else 0.5
        rows.append(f"{20 + 10 * i},{12 * o},{30 * d},{f}")
    file.write_text("\n".join(["theta_i_deg,theta_o_deg,delta_phi_deg,f", *rows]))
    assert convert(file, tmp_path / "y.csv").losses == (
        "12 % of its values were negative and became 0.",
        "1.8 % of its values were missing; they are filled in from those around them, with 0 where there are none.",
        "It was measured for θi 20 to 40°; what lies beyond has the values at the border.",
        "What was measured at one wavelength became grey.",
    )


@pytest.mark.parametrize(("azimuths", "share"), [(range(150, 181, 10), "17 %"), (range(0, 181, 10), "")])
def test_it_says_how_much_was_not_measured_between_azimuths(tmp_path, azimuths, share):
    """A sector of 30° of half a turn is a sixth of it."""
    given = tabulated(tmp_path, range(0, 90, 5), range(0, 90, 5), azimuths)
    told = [loss for loss in convert(given, tmp_path / "y.csv").losses if "measured; the others" in loss]
    assert told == [f"Of all directions {share} were measured; the others have the values at the border."] * bool(share)


def test_it_says_what_has_no_value(tmp_path):
    """Outside its highlight this BSDF is negative."""
    dark = {"type": "diffuse", "reflectance": {"type": "uniform", "value": -0.5}}
    told = convert({"type": "blendbsdf", "weight": 0.2, "a": dark, "b": {"type": "ward"}}, tmp_path / "x.csv").losses
    assert any("of its values are negative or not finite, and became 0." in it for it in told), told


def measurement(f, channels, wavelengths=None):
    """Values at the nodes of a coarse grid of polar angles."""
    polar, azimuth = Axis(np.radians(np.arange(5, 90, 10))), Axis(np.radians(np.arange(0, 181, 20)))
    places = np.meshgrid(polar.nodes, polar.nodes, azimuth.nodes, indexing="ij")
    values = np.repeat(f(*places)[..., None], channels, axis=-1)
    return Measurement("some file", "test", Grid(Spherical(True), (polar, polar, azimuth), values), wavelengths)


@pytest.mark.parametrize(
    "name, format", [("x.csv", "CSV"), ("x.bsdf", "Zemax"), ("x.bsdf", "RGL"), ("x.binary", "MERL")]
)
def test_every_format_keeps_a_smooth_measurement(tmp_path, name, format):
    bands = None if format in ("Zemax", "MERL") else np.array([450.0, 500, 550, 600])
    given = measurement(lambda i, o, d: 1 + np.cos(i) * np.cos(o), 4 if bands is not None else 3, bands)
    result = convert(given, tmp_path / name, format.lower())
    assert result.format == format and result.losses == () and result.rms < 0.002 and result.largest < 0.02
    if bands is not None:
        np.testing.assert_allclose(read(tmp_path / name).wavelengths, bands)


@pytest.mark.slow
def test_scattered_samples_are_put_on_a_grid(tmp_path):
    wi, wo = pairs(400, 5, 0.2)
    samples = Samples(wi, wo, np.full((400, 3), 0.25), anisotropic=False)
    result = convert(Measurement("some file", "test", samples), tmp_path / "x.csv")
    (loss,) = result.losses
    assert "θi 1.865 to 78.46° and θo 4.601 to 78.21°" in loss and result.largest < 1e-6


@pytest.mark.slow
def test_spectra_become_rgb_and_both_orders_their_mean(tmp_path):
    path = tmp_path / "x.binary"
    (loss,) = convert(measurement(lambda i, o, d: 1 + 0 * i, 1, np.array([650.0])), path).losses
    assert "grey" in loss
    spectral = measurement(lambda i, o, d: 1 + np.cos(i), 4, np.array([450.0, 500, 550, 600]))
    one, other = convert(spectral, path).losses
    assert "4 wavelengths" in one and "reciprocal" in other
    wi, wo = pairs(100, 3, 0.5)
    mean = 1 + (wi[:, 2] + wo[:, 2]) / 2
    np.testing.assert_allclose(read(path).data.evaluate(wi, wo)[:, 0], mean, rtol=0.02)


def test_what_cannot_be_is_refused(tmp_path):
    for given, name, words in [
        ({"type": "dielectric"}, "x.binary", "single directions only"),
        ({"type": "diffuse", "reflectance": 0}, "x.binary", "reflects nothing"),
        ({"type": "ward", "alpha_u": 0.1, "alpha_v": 0.3}, "x.binary", "anisotropic"),
        ({"type": "constant"}, "x.binary", "not a BSDF"),
        ({"type": "ward"}, "x.exr", "no way to write .*x.exr; .* .binary"),
        (measurement(lambda i, o, d: -1 + 0 * i, 3), "x.binary", "no positive value"),
        (measurement(lambda i, o, d: 1 + 0 * i, 1025, np.arange(1025.0)), "x.bsdf", "1,025 wave.* at most 1,024 of"),
        ("nowhere.binary", "x.binary", "No such file"),
    ]:
        with pytest.raises(ValueError, match=words):
            convert(given, tmp_path / name)
        assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=f"There is no folder: '{tmp_path}/none'$"):
        convert({"type": "lambert"}, tmp_path / "none" / "x.binary")


def test_a_file_is_not_converted_onto_itself_and_stays_whole_when_writing_fails(tmp_path, monkeypatch):
    path = tmp_path / "x.csv"
    convert({"type": "lambert"}, path)
    before = path.read_bytes()
    for given in (path, {"type": "tabulated", "filename": str(path)}):
        with pytest.raises(ValueError, match="onto itself"):
            convert(given, path)

    def full(path, source):
        path.write_bytes(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mi_brdfs.measured.formats.csv.write", full)
    with pytest.raises(OSError):
        convert({"type": "ward"}, path)
    assert path.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_a_bsdf_is_written_in_rgb(tmp_path):
    with mi.variant_context("llvm_ad_spectral"), pytest.raises(ValueError, match="vectorized rgb variant"):
        convert({"type": "ward"}, tmp_path / "x.csv")


def test_the_command(tmp_path):
    path = tmp_path / "x.csv"
    done = invoke("convert", "phong", path, "-D", "exponent=20")
    assert done.exit_code == 0 and "CSV" in done.output and "% of its peak" in " ".join(done.output.split())
    assert invoke("convert", path, tmp_path / "z.csv").exit_code == 0
