"""Zemax and LightTools files: their values at the right directions, their albedos, and what is wrong with damaged
ones."""

from pathlib import Path

import numpy as np
import pytest
from support import shared

from mi_brdfs.measured import read

LOFT = Path(__file__).parents[1] / "scenes" / "measured"
SMALL = ["AnoBlackEC1onAlum", "AnoBlackEC2onAlum", "AnoBlackNiTEonINVAR", "aeroglaze_z307"]


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


def looked_up(measurement, table, k, i):
    """A measurement at all places of a block of its file, with 0 where there is no value."""
    azimuth, radial = np.meshgrid(table.azimuths, table.radials, indexing="ij")
    wi, wo = directions(table.rotations[k], table.incidences[i], azimuth, radial)
    return measurement.data.evaluate(wi, wo, "nearest")[..., 0]


def solid_angles(table):
    """Weights of the nodes for LOFT's sum over the sphere: means of f, and of the sine, over the corners of cells."""

    def halves(steps):
        return np.append(steps, 0) / 2 + np.append(0, steps) / 2

    azimuth, radial = np.radians(table.azimuths), np.radians(table.radials)
    sine = np.sin(radial)
    return np.outer(halves(np.diff(azimuth)), halves(np.diff(radial) * (sine[1:] + sine[:-1]) / 2))


@pytest.mark.parametrize("name", SMALL)
def test_zemax_values_are_at_their_directions(name):
    measurement, table = read(LOFT / f"{name}.bsdf"), Table(LOFT / f"{name}.bsdf")
    for i in range(len(table.incidences)):
        found = looked_up(measurement, table, 0, i)
        expected = table.values[0, i].copy()
        if name != "aeroglaze_z307":  # whose two azimuths differ at the pole, where the grid has their mean
            assert np.ptp(expected[:, 0]) == 0
        np.testing.assert_allclose(found[:, 1:], expected[:, 1:], rtol=1e-6, atol=0)
    assert measurement.data.coordinates.mirrored
    assert not measurement.data.anisotropic


@pytest.mark.parametrize("name", [*SMALL[:3], "IMX455"])
def test_stated_tis_is_lofts_sum_over_what_was_read(name):
    """LOFT's scripts sum f over the azimuths that the file has, without the cosine, less a bit for the beam. Of
    isotropic samples these are half of all: the sum is the albedo of a Lambertian surface, but of no other."""
    path = LOFT / f"{name}.bsdf" if name in SMALL else shared("loft", f"{name}.bsdf")
    measurement, table = read(path), Table(path)
    anisotropic = measurement.data.anisotropic
    phi_i = np.degrees(measurement.data.axes[3].nodes) if anisotropic else np.array([90.0])
    beam = np.arcsin(3.5 / 2 / 82)
    for k, rotation in enumerate(table.rotations[: len(phi_i)]):
        node = np.argmin(abs(phi_i - (90 - rotation) % 360))
        for i, theta in enumerate(table.incidences):
            f = looked_up(measurement, table, k, i)
            total = np.sum(f * solid_angles(table)) - f[0, 0] * (1 - np.cos(beam)) * beam * np.pi
            stated = measurement.stated_albedos[np.radians(theta)][node]
            assert stated == table.tis[k, i]
            assert total == pytest.approx(stated, rel=5e-4)


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


def test_zemax_rotations_turn_the_sample():
    path = shared("loft", "IMX455.bsdf")
    measurement, table = read(path), Table(path)
    assert measurement.data.anisotropic
    for k in range(0, 36, 5):
        for i in range(4):
            np.testing.assert_allclose(
                looked_up(measurement, table, k, i)[:, 1:], table.values[k, i][:, 1:], rtol=1e-5, atol=0
            )


def test_imx455_diffracts_as_its_rotations_say():
    """A lenslet array diffracts towards wo with wi + wo, in the plane of the sample, on a lattice. In the sample's
    frame, measurements at different rotations explain each other better than if the sample were turned the other
    way."""
    table = Table(shared("loft", "IMX455.bsdf"))
    k = np.arange(10)  # what was measured; further rotations are copies
    rotation, azimuth, radial = np.meshgrid(table.rotations[k], table.azimuths[:-1], table.radials[1:], indexing="ij")

    def explained(i, sense):
        wi, wo = directions(sense * rotation, table.incidences[i], azimuth, radial)
        f = table.values[k, i, :-1, 1:]
        used = (wo[..., 2] > 0.2) & (f > 0)
        _, cell, counts = np.unique(
            np.round((wi + wo)[used][:, :2] / 0.08), axis=0, return_inverse=True, return_counts=True
        )
        log_f = np.log(f[used])
        rest = log_f - (np.bincount(cell, log_f) / counts)[cell]
        return 1 - np.var(rest) / np.var(log_f)

    for i in range(4):
        assert explained(i, 1) > explained(i, -1)
