"""RGL's tensor files: read as Mitsuba's ``measured`` reads them, refused in a sentence if broken, and written."""

from __future__ import annotations

import struct

import mitsuba as mi
import numpy as np
import pytest

from mi_brdfs.measure.arrays import WAVELENGTHS, vectors
from mi_brdfs.measured import FileError, read
from mi_brdfs.measured.arrays import DRJIT, NUMPY, components

from support import context, hemisphere, interaction, numbers


TYPES = {"uint8": 1, "int32": 6, "uint32": 5, "float16": 9, "float32": 10, "float64": 11}
BANDS = np.array([400, 500, 550, 700], dtype=np.float32)


def tensor_file(fields, overlap=0):
    """The bytes of a tensor file, each field at a multiple of 8, or so many bytes before it."""
    size = 18 + sum(13 + len(name) + 8 * array.ndim for name, array in fields.items())
    head, body = b"tensor_file\0\1\0" + struct.pack("<I", len(fields)), b""
    for name, array in fields.items():
        body += b"\0" * (-(size + len(body)) % 8)
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", array.ndim, TYPES[str(array.dtype)], size + len(body) - overlap)
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += array.tobytes()
    assert len(head) == size
    return head + body


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
    path = tmp_path / "material.bsdf"
    path.write_bytes(fields if isinstance(fields, bytes) else tensor_file(fields))
    return path


def pairs(count):
    """Pairs all over the hemisphere, a third of them near the mirror direction, and a third with wo at grazing."""
    wi, wo = hemisphere(count, 1, 0.002), hemisphere(count, 2, 0.002)
    third = count // 3
    wo[:third] = wi[:third] * [-1, -1, 1] + np.random.default_rng(3).normal(0, 0.03, (third, 3))
    wo[third : 2 * third, 2] *= 0.05
    wo[:, 2] = np.maximum(wo[:, 2], 1e-3)
    return wi, (wo / np.linalg.norm(wo, axis=1, keepdims=True)).astype(np.float32)


def in_mitsuba(path, wi, wo):
    """f cosθo by Mitsuba's ``measured``."""
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    return numbers(bsdf.eval(context(), interaction(wi), vectors(wo), True))


def agrees(path, count=20000):
    """``Grid.evaluate`` and ``locate_scaled`` in both arithmetics against Mitsuba."""
    wi, wo = pairs(count)
    grid, wavelengths = read(path).data, read(path).wavelengths
    expected = in_mitsuba(path, wi, wo)
    found = grid.evaluate(wi, wo) * wo[:, 2:]
    if wavelengths is not None:
        found = np.array([np.interp(WAVELENGTHS, wavelengths, values) for values in found])
    np.testing.assert_allclose(found, expected, rtol=2e-2, atol=1e-5 * expected.max())
    assert np.quantile(abs(found / expected - 1)[expected > 1e-3 * np.median(expected)], 0.999) < 1e-3

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
