"""Zemax and LightTools files: their values at the right directions, their albedos, and what is wrong with damaged
ones."""

from pathlib import Path

import numpy as np
import pytest
from support import spherical

from mi_brdfs.measured import read
from mi_brdfs.measured.report.summary import summarize

LOFT = Path(__file__).parents[1] / "scenes" / "measured"


class Table:
    """A Zemax file by the shortest reader that can be: lists of angles in degrees, and blocks below TIS."""

    def __init__(self, path):
        lines = [line.split() for line in path.read_text().splitlines() if line.strip() and line[0] != "#"]
        names = "SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"
        self.rotations, self.incidences, self.azimuths, self.radials = (
            np.array(lines[k + 1], dtype=float) for name in names for k, line in enumerate(lines) if line[0] == name
        )
        shape = len(self.rotations), len(self.incidences)
        self.tis = np.array([float(line[1]) for line in lines if line[0] == "TIS"]).reshape(shape)
        rows = lines[lines.index(["DataBegin"]) + 1 : lines.index(["DataEnd"])]
        rows = [row for row in rows if row[0] != "TIS"]
        self.values = np.array(rows, dtype=float).reshape(*shape, len(self.azimuths), len(self.radials))


def turned(w, axis, angle):
    """Directions turned counter-clockwise about an axis (Rodrigues)."""
    axis = np.broadcast_to(axis, np.shape(w))
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return w * cos + np.cross(axis, w) * sin + axis * (np.sum(axis * w, axis=-1, keepdims=True) * (1 - cos))


def directions(rotation, incidence, azimuth, radial):
    """``(wi, wo)`` in the sample's frame for Zemax's angles in degrees, from their definition: in the laboratory, the
    light comes from the y axis, wi × n = x is the normal of the plane of incidence, and the sample is turned from there
    by ``rotation``."""
    rotation, incidence, azimuth, radial = np.broadcast_arrays(*map(np.radians, (rotation, incidence, azimuth, radial)))
    x, z = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    up = np.broadcast_to(z, (*incidence.shape, 3))
    wi, mirror = turned(up, x, -incidence), turned(up, x, incidence)
    wo = turned(turned(mirror, x, -radial), mirror, azimuth)
    return turned(wi, z, -rotation), turned(wo, z, -rotation)


@pytest.mark.parametrize("name", ["AnoBlackEC1onAlum", "aeroglaze_z307"])
def test_zemax_values_are_at_their_directions(name):
    measurement, table = read(LOFT / f"{name}.bsdf"), Table(LOFT / f"{name}.bsdf")
    azimuth, radial = np.meshgrid(table.azimuths, table.radials, indexing="ij")
    for i, incidence in enumerate(table.incidences):
        found = measurement.data.evaluate(*directions(0, incidence, azimuth, radial), "nearest")[..., 0]
        expected = table.values[0, i].copy()
        if name != "aeroglaze_z307":  # whose two azimuths differ at the pole, where the grid has their mean
            assert np.ptp(expected[:, 0]) == 0
        np.testing.assert_allclose(found[:, 1:], expected[:, 1:], rtol=1e-6, atol=0)
        assert measurement.stated_albedos[np.radians(incidence)] == [table.tis[0, i]]
    assert measurement.data.coordinates.mirrored
    assert not measurement.data.anisotropic


def test_stated_tis_of_aeroglaze_is_twice_that_of_its_plane():
    """The script of this file turns the plane of incidence by 2π, which covers the hemisphere twice. That angles are
    those from the mirror direction shows, too: from the normal, the sums would be off by up to a factor of two."""
    measurement, table = read(LOFT / "aeroglaze_z307.bsdf"), Table(LOFT / "aeroglaze_z307.bsdf")
    theta = np.radians(np.arange(-80, 81))
    w = np.stack([0 * theta, -np.sin(theta), np.cos(theta)], axis=-1)
    for i, incidence in enumerate(table.incidences):
        wi, _ = directions(0, incidence, 0, 0)
        f = measurement.data.evaluate(np.broadcast_to(wi, w.shape), w)[:, 0]
        total = 2 * np.pi * np.trapezoid(f * abs(np.sin(theta)) * np.cos(theta), theta)
        assert total == pytest.approx(table.tis[0, i], rel=0.01)


def zemax_text(symmetry="PlaneSymmetrical", rotations=(0,), azimuths=(0, 180), content="Monochrome", comment=""):
    """A file with two angles of incidence in falling order and three radial angles, whose values count."""
    channels = ["TristimulusX", "TristimulusY", "TristimulusZ"] if content == "XYZ" else [content]
    lines = [comment, f"Symmetry {symmetry}", f"SpectralContent {content}", "ScatterType BRDF"]
    lists = {"SampleRotation": rotations, "AngleOfIncidence": (40, 10), "ScatterAzimuth": azimuths}
    for name, angles in (lists | {"ScatterRadial": (0, 10, 20)}).items():
        lines += [f"{name} {len(angles)}", " ".join(map(str, angles))]
    value = 0
    for channel in channels:
        lines += ["", channel, "DataBegin"]
        for _ in range(2 * len(rotations)):
            lines.append(f"TIS {len(lines)}")
            for _ in azimuths:
                lines.append(f"{value + 1} {value + 2} {value + 3}")
                value += 3
        lines.append("DataEnd")
    return "\n".join(lines)


def zemax(folder, **choices):
    path = folder / "x.bsdf"
    path.write_text(zemax_text(**choices))
    return read(path), Table(path)


@pytest.mark.parametrize(
    "choices",
    [
        {},
        {"symmetry": "asymmetrical", "azimuths": (0, 90, 180, 270, 360)},
        {"symmetry": "ASymmetrical", "azimuths": (-90, 0, 90, 180)},
        {"symmetry": "Asymmetrical4D", "rotations": (0, 45, 90), "azimuths": (0, 120, 240, 360)},
        {"symmetry": "ASymmetrical4D", "rotations": (270, 180, 90, 0), "azimuths": (0, 120, 240)},
        {"symmetry": "PlaneSymmetrical", "rotations": (0, 90), "azimuths": (0, 90, 180)},
        {"symmetry": "ASymmetrical4D", "rotations": (120, 90, 60), "azimuths": (0, 120, 240)},
    ],
)
def test_zemax_symmetries_and_orders(tmp_path, choices):
    measurement, table = zemax(tmp_path, **choices)
    azimuth, radial = np.meshgrid(table.azimuths % 360, table.radials, indexing="ij")
    kept = np.unique(table.azimuths % 360, return_index=True)[1]  # of 0 and 360, the first
    rotations = np.degrees(measurement.data.axes[3].nodes) if len(table.rotations) > 1 else np.array([90])
    for k, rotation in enumerate(table.rotations):
        (node,) = np.flatnonzero(np.isclose(rotations % 360, (90 - rotation) % 360))
        for i, incidence in enumerate(table.incidences):
            found = measurement.data.evaluate(*directions(rotation, incidence, azimuth, radial), "nearest")
            np.testing.assert_array_equal(found[kept, 1:, 0], table.values[k, i][kept, 1:])
            assert measurement.stated_albedos[np.radians(incidence)][node] == table.tis[k, i]


def test_zemax_part_of_a_turn(tmp_path):
    """Light from 30°, 0 and -30°: what lies between is measured, also beyond 0, and the rest passes from end to end."""
    with pytest.warns(UserWarning, match="Light from φi = 330° to 30° was measured"):
        measurement, table = zemax(tmp_path, symmetry="ASymmetrical4D", rotations=(60, 90, 120), azimuths=(0, 120, 240))
    mirror = [directions(rotation, 40, 0, 10) for rotation in (60, 75, 90, 120, 119.9, 121, 270, 59)]
    wi, wo = (np.array([np.ravel(pair[k]) for pair in mirror]) for k in (0, 1))
    np.testing.assert_array_equal(measurement.data.measured(wi, wo), [1, 1, 1, 1, 1, 0, 0, 0])
    first, middle, last = table.values[:, list(table.incidences).index(40), 0, 1]
    expected = np.interp((60, 75, 90, 120, 119.9, -239, -90, 59), (-240, 60, 90, 120), (last, first, middle, last))
    np.testing.assert_allclose(measurement.data.evaluate(wi, wo)[:, 0], expected, rtol=1e-6)
    assert "3 φi from 330 to 390°" in summarize(measurement).grid


def test_zemax_xyz_is_a_colour(tmp_path):
    path = tmp_path / "x.bsdf"
    path.write_text(zemax_text(content="XYZ"))
    measurement = read(path)
    assert measurement.wavelengths is None
    xyz = np.array([2, 14, 26])  # at the first angle of incidence and azimuth, 10° from the mirror direction
    found = measurement.data.evaluate(*directions(0, 40, 0, 10), "nearest")
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    inverse = np.linalg.inv(to_xyz) @ xyz
    np.testing.assert_allclose(found[inverse > 0], inverse[inverse > 0], rtol=2e-3)
    stated = [float(line.split()[1]) for line in path.read_text().splitlines() if line.startswith("TIS")]
    assert measurement.stated_albedos[np.radians(40)] == [stated[2]]  # of Y


@pytest.mark.parametrize(
    "comment, wavelength",
    [
        ("# Light source: red laser (650 nm, 3.5 mm)", 650),
        ("# Wavelength = 0.633 um", 633),
        ("# Laser 532 nm\n# laser line at 532 nm", 532),
        ("# Lasers: 532 nm and 650 nm", np.nan),
        ("# Coating 550 nm thick", np.nan),
        ("", np.nan),
    ],
)
def test_wavelength_in_a_comment(tmp_path, comment, wavelength):
    measurement, _ = zemax(tmp_path, comment=comment)
    np.testing.assert_array_equal(measurement.wavelengths, [wavelength])


def test_lighttools(tmp_path):
    """Azimuths begin at x, and the light comes from y."""
    lines = ["Symmetry PlaneSymmetrical", "SpectralContent Monochrome", "ScatterAzimuth 3", "-90 0 90"]
    lines += ["ScatterRadial 2", "20 60", "DataBegin"]
    for incidence, wavelength in ((30, 450), (30, 650), (0, 450), (0, 650)):
        lines += [f"AOI {incidence}", "POI 0", "Side Front", f"Wavelength {wavelength}", "ScatterType BRDF", "TIS 0.5"]
        for azimuth in (-90, 0, 90):
            lines.append(" ".join(str(wavelength + incidence / 100 + azimuth / 1e5 + o / 1e7) for o in (20, 60)))
    lines += ["Side Back", "TIS 0.5", "9 9 9 9 9 9", "DataEnd"]
    path = tmp_path / "x.bsdf"
    path.write_text("\n".join(lines))
    measurement = read(path)
    assert measurement.format == "LightTools"
    np.testing.assert_array_equal(measurement.wavelengths, [450, 650])
    assert measurement.stated_albedos[np.radians(30)] == [0.5]

    for azimuth in (-90, 0, 90, 180):  # 180° mirrors 0°
        found = measurement.data.evaluate(spherical(30, 90), spherical(60, azimuth), "nearest")
        np.testing.assert_allclose(
            found, np.array([450, 650]) + 0.3 + {-90: -90, 0: 0, 90: 90, 180: 0}[azimuth] / 1e5 + 6e-6
        )
