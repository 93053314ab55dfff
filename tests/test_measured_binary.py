"""MERL, UTIA and MBSDF files: their values in the right places, and what is wrong with damaged ones."""

import struct
import time
import timeit

import merl_tables
import numpy as np
import pytest
from merl_tables import SCALE
from support import pairs, refused, spherical, traced, written

from mi_brdfs.measured import FileError, read
from mi_brdfs.measured.formats import merl
from mi_brdfs.measured.source import Source

RNG = np.random.default_rng(1)


def merl_bytes(dimensions=(6, 5, 10), planes=None):
    planes = np.random.default_rng(2).uniform(0, 100, (3, *dimensions)) if planes is None else planes
    return struct.pack("<3i", *dimensions) + planes.astype("<f8").tobytes()


def utia_bytes(theta=3, phi=24, dtype="<f8"):
    return np.random.default_rng(3).uniform(0, 1, (3, theta, phi, theta, phi)).astype(dtype).tobytes()


def mbsdf_bytes(theta=4, phi=6, kind=1, header=b'name="a \\"red\\" paint"\n', block=b"MBSDF_DATA_REFLECTION="):
    values = np.random.default_rng(4).uniform(-0.1, 1, theta * theta * phi * (1, 3)[kind]).astype("<f4")
    return b"NVIDIA ARC MBSDF V1\n" + header + block + b"\n" + struct.pack("<3I", kind, theta, phi) + values.tobytes()


# --- MERL -----------------------------------------------------------------------------------------------------------


def looked_up(planes, wi, wo):
    """f by MERL's own rule: the cell that an index rounds down to, and whether it is safely inside that cell."""
    n_h, n_d, n_phi = planes.shape[1:]
    turn = np.pi if n_phi == 2 * n_d else 2 * np.pi
    theta_h, theta_d, phi_d = merl_tables.angles(wi, wo)
    degrees = np.degrees(theta_h)
    places = (
        np.sqrt(degrees / 90 * n_h * n_h),
        theta_d / (np.pi / 2) * n_d,
        np.where(phi_d < 0, phi_d + turn, phi_d) / turn * n_phi,
    )
    index = tuple(np.clip(np.floor(p).astype(int), 0, n - 1) for p, n in zip(places, (n_h, n_d, n_phi), strict=True))
    safe = np.all([abs(p - np.round(p)) > 1e-6 for p in places], axis=0)
    return np.stack([planes[c][index] * SCALE[c] for c in range(3)], axis=-1), safe


@pytest.mark.parametrize("dimensions", [(30, 20, 40), (7, 9, 36)])
def test_nearest_is_merls_own_look_up(tmp_path, dimensions):
    planes = np.random.default_rng(5).uniform(0, 100, (3, *dimensions))
    grid = read(written(tmp_path, "x.binary", merl_bytes(dimensions, planes))).data
    assert grid.coordinates.reciprocal == (dimensions[2] == 2 * dimensions[1])
    wi, wo = pairs(20000, 6)
    expected, safe = looked_up(planes, wi, wo)
    assert safe.mean() > 0.99
    np.testing.assert_allclose(grid.evaluate(wi, wo, "nearest")[safe], expected[safe], rtol=1e-6)


def test_minus_one_is_missing_and_other_negatives_stay(tmp_path):
    planes = np.full((3, 6, 5, 10), 30.0)
    planes[:, 0, 0, 0] = -1
    planes[:, 0, 0, 1] = -1 / SCALE
    planes[:, 0, 0, 2] = -0.5
    values = read(written(tmp_path, "x.binary", merl_bytes(planes=planes))).data.values
    assert np.isnan(values[0, 0, :2]).all() and np.isnan(values).sum() == 6
    np.testing.assert_allclose(values[0, 0, 2], -0.5 * SCALE, rtol=1e-6)


def test_what_was_measured_holds_next_to_what_was_not(tmp_path):
    planes = np.full((3, 6, 5, 10), 30.0)
    planes[:, ::2, ::2] = planes[:, :, 3:, 5] = -1
    grid = read(written(tmp_path, "x.binary", merl_bytes(planes=planes))).data
    np.testing.assert_allclose(grid.evaluate(*pairs(5000, 9)) / SCALE, 30, rtol=1e-5)
    planes[:, :, 1:] = -1
    f = read(written(tmp_path, "x.binary", merl_bytes(planes=planes))).data.evaluate(*pairs(5000, 9))
    assert 0.1 < (f == 0).mean() < 0.9 and f.max() < 30 * SCALE[2] * 1.001


def test_merl_is_read_at_once_and_in_little_memory(tmp_path):
    path = written(tmp_path, "x.binary", merl_bytes((90, 90, 180)))
    times = [timeit.timeit(lambda: read(path), number=1, timer=time.process_time) for _ in range(3)]
    assert min(times) < 0.25
    assert traced(lambda: read(path))[2] < 2 * path.stat().st_size


@pytest.mark.parametrize("dimensions", [(30, 20, 40), (20, 15, 60)])
def test_merl_is_written_as_it_is_read(tmp_path, dimensions):
    def f(wi, wo):
        return (0.2 + wi[:, 2:] * wo[:, 2:]) * [1, 2, 3]

    path = tmp_path / "x.binary"
    merl.write(path, Source(f), dimensions)
    assert path.stat().st_size == 12 + 24 * np.prod(dimensions)
    wi, wo, values = read(path).data.pairs()
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    assert 0.3 < above.mean() < 0.9 and np.isnan(values[~above]).all()
    np.testing.assert_allclose(values[above], f(wi[above], wo[above]), rtol=1e-6)


def test_merl_shows_spectra_in_rgb(tmp_path):
    path = tmp_path / "x.binary"
    merl.write(path, Source(lambda wi, wo: np.full((len(wi), 3), [0, 0, 0.5]), np.array([450.0, 550, 650])), (6, 5, 10))
    red = read(path).data.evaluate(*pairs(9, 1))
    assert (red[:, 0] > 5 * red[:, 1]).all() and (red[:, 2] == 0).all()


# --- UTIA -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theta, phi, dtype", [(3, 24, "<f8"), (4, 32, "<f4")])
def test_utia_values_lie_where_the_index_says(tmp_path, theta, phi, dtype):
    data = utia_bytes(theta, phi, dtype)
    grid = read(written(tmp_path, "m001.bin", data)).data
    plane = np.frombuffer(data, dtype).reshape(3, -1)
    i, v = RNG.integers(theta, size=(2, 500))
    p, q = RNG.integers(phi, size=(2, 500))
    index = ((i * phi + p) * theta + v) * phi + q

    def direction(polar, azimuth):
        return spherical(polar * 90 / theta, azimuth * 360 / phi)

    at_pole = (i == 0) | (v == 0)  # there the azimuths are of no direction
    assert grid.anisotropic and (~at_pole).sum() > 100
    f = grid.evaluate(direction(i, p), direction(v, q))
    np.testing.assert_allclose(f[~at_pole], plane[:, index[~at_pole]].T, rtol=1e-5)
    # All of its values are there, once each.
    np.testing.assert_allclose(np.sort(grid.values, axis=None), np.sort(np.float32(plane), axis=None))
    # Beyond the last angle it holds.
    low = direction(np.full(500, theta - 0.5), p)
    np.testing.assert_allclose(
        grid.evaluate(low, direction(v, q))[v > 0],
        plane[:, index + (theta - 1 - i) * theta * phi**2].T[v > 0],
        rtol=1e-5,
    )


# --- MBSDF ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind, block", [(0, b"MBSDF_DATA="), (1, b"MBSDF_DATA_REFLECTION=")])
def test_mbsdf_values_lie_where_the_index_says(tmp_path, kind, block):
    data = mbsdf_bytes(4, 6, kind, block=block)
    measurement = read(written(tmp_path, "x.mbsdf", data))
    assert measurement.material == 'a "red" paint'
    channels = (1, 3)[kind]
    values = np.frombuffer(data[-4 * 4 * 4 * 6 * channels :], "<f4").reshape(-1, channels)
    i, o = RNG.integers(4, size=(2, 200))
    k = RNG.integers(6, size=200)
    start = RNG.uniform(0, 360, 200)
    for side in (1, -1):
        wi, wo = spherical((i + 0.5) * 22.5, start), spherical((o + 0.5) * 22.5, start + side * (k + 0.5) * 30)
        expected = np.maximum(values[(i * 4 + o) * 6 + k], 0) * np.ones(3)
        np.testing.assert_allclose(measurement.data.evaluate(wi, wo), expected, atol=1e-5)
    assert (measurement.data.values < 0).any()


def test_mbsdf_with_transmission_is_read_for_its_reflection(tmp_path):
    first = mbsdf_bytes()
    data = first + mbsdf_bytes(2, 3, 0, b"", b"MBSDF_DATA_TRANSMISSION=")[len(b"NVIDIA ARC MBSDF V1\n") :]
    measurement = read(written(tmp_path, "x.mbsdf", data))
    np.testing.assert_array_equal(measurement.data.values, read(written(tmp_path, "y.mbsdf", first)).data.values)
    assert "transmission" in measurement.notes


# --- Damaged files --------------------------------------------------------------------------------------------------


def replaced(data, offset, part):
    return data[:offset] + part + data[offset + len(part) :]


M, U, B = merl_bytes(), utia_bytes(), mbsdf_bytes()
FILES = {"x.binary": M, "x.bin": U, "x.mbsdf": B}
HEAD = len(B) - 4 * 4 * 4 * 6 * 3 - 12
NOISE = np.random.default_rng(7).bytes(5000)
NUMBER = {"x.binary": ("<f8", 12), "x.bin": ("<f8", 0), "x.mbsdf": ("<f4", HEAD + 12)}
"""The type of the values, and where they begin."""


def filled(name, value, part):
    """Return a file whose last values, one of ``part``, are replaced."""
    (dtype, start), data = NUMBER[name], FILES[name]
    rest = np.full((len(data) - start) // np.dtype(dtype).itemsize // part, value, dtype).tobytes()
    return data[: -len(rest)] + rest


def damaged(data):
    """What any format must refuse, or read as it is."""
    return {
        **{f"the first {n} bytes": data[:n] for n in (1, 12, 40)},
        "without its last byte": data[:-1],
        "twice": data + data,
        "a byte too much": data + b"\1",
        "noise": NOISE,
        "zeros": bytes(len(data) - 8),
        "text": b"Once upon a time\n" * 300,
    }


REFUSED = {
    **{(name, k): v for name, data in FILES.items() for k, v in damaged(data).items()},
    ("x.binary", "-6 cells"): replaced(M, 0, struct.pack("<i", -6)),
    ("x.binary", "big-endian"): replaced(M, 0, struct.pack(">3i", 6, 5, 10)),
    ("x.binary", "float32"): M[:12] + np.frombuffer(M[12:], "<f8").astype("<f4").tobytes(),
    ("x.bin", "four planes"): U + U[: len(U) // 3],
    ("x.bin", "a header"): b"UTIA" + U,
    ("x.bin", "7 × 48"): bytes(3 * 8 * (7 * 48) ** 2),
    ("x.mbsdf", "version 2"): B.replace(b"V1", b"V2"),
    ("x.mbsdf", "type 2"): replaced(B, HEAD, struct.pack("<I", 2)),
    ("x.mbsdf", "no θ"): replaced(B, HEAD + 4, struct.pack("<I", 0)),
    ("x.mbsdf", "10 GB"): replaced(B, HEAD + 4, struct.pack("<2I", 2000, 200)),
    ("x.mbsdf", "no data"): B[:HEAD].replace(b"MBSDF_DATA_REFLECTION=", b'other="1"'),
    ("x.mbsdf", "transmission only"): mbsdf_bytes(block=b"MBSDF_DATA_TRANSMISSION="),
    ("x.mbsdf", "two reflections"): B + B[HEAD - 23 :],
    ("x.mbsdf", "an endless line"): B[:20] + b"k" * 200000,
}
ODD = [
    *((name, value) for name in NUMBER for value in (np.nan, np.inf, -2)),
    *(("x.binary", value) for value in (1e300, 1e43, -1e43)),
]


@pytest.mark.parametrize("case", REFUSED, ids=" ".join)
def test_a_damaged_file_is_refused_in_a_sentence(tmp_path, case):
    path = written(tmp_path, case[0], REFUSED[case])
    assert refused(path).startswith(f"{path}: at byte ")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name, value", ODD)
def test_odd_values_count_as_none(tmp_path, name, value):
    """Also those that float32 does not hold. Where there are no others, there is nothing to read."""
    path = written(tmp_path, name, filled(name, value, 2))
    grid = read(path).data
    f = grid.evaluate(*pairs(100, 10))
    assert np.isfinite(f).all() and (f >= 0).all() and (f < 1e9).all()
    assert ((grid.values < 0) if value == -2 else np.isnan(grid.values)).mean() >= 0.5
    path.write_bytes(filled(name, value, 1))
    with pytest.raises(FileError, match="no value is positive"):
        read(path)
