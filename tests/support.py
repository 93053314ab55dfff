"""What tests share: BSDFs called with arrays of directions, in any variant."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import subprocess
import sys
import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from html.parser import HTMLParser
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mitsuba.chi2 import ChiSquareTest, SphericalDomain

from mi_brdfs.measured import FileError, read
from mi_brdfs.mitsuba import llvm
from mi_brdfs.probe import directions
from mi_brdfs.probe.arrays import context as context
from mi_brdfs.probe.arrays import floats as floats
from mi_brdfs.probe.arrays import interaction as interaction
from mi_brdfs.probe.arrays import luminance
from mi_brdfs.probe.arrays import numbers as numbers
from mi_brdfs.probe.arrays import per_lane as per_lane
from mi_brdfs.probe.arrays import sample_arguments as sample_arguments
from mi_brdfs.probe.arrays import vectors as vectors
from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.probe.directions import direction as direction
from mi_brdfs.probe.variates import lattice, sampling_efficiency
from mi_brdfs.variants import is_scalar as is_scalar

ROOT = Path(__file__).parent.parent
LOFT = ROOT / "scenes" / "measured" / "AnoBlackEC1onAlum.bsdf"
"""A measured file of a paint, of the goniometer at Lund."""


def shared(*parts: str) -> Path:
    """A file with measured data that may not be shipped, in ``MI_BRDFS_DATA`` or ``../shared/data``."""
    path = (ROOT / os.environ.get("MI_BRDFS_DATA", "../shared/data")).joinpath(*parts)
    if not path.exists():
        pytest.skip(f"there is no {path}; set MI_BRDFS_DATA to a folder with {'/'.join(parts)}")
    return path


def rows(name: str) -> list[str]:
    """The rows of a table in ``rows``, without its comments."""
    text = (ROOT / "tests" / "rows" / name).read_text(encoding="utf-8")
    return [row for row in text.splitlines() if not row.startswith("# ")]


def hemisphere(count: int, seed: int, lowest: float = 0.02) -> np.ndarray:
    """Uniform directions with cosines of at least ``lowest``, shape (count, 3), float32."""
    return directions.hemisphere(count, seed, lowest)


def sphere(count: int, seed: int, lowest: float = 0.02) -> np.ndarray:
    """The same, every other one below the horizon."""
    w = hemisphere(count, seed, lowest)
    w[::2, 2] *= -1
    return w


def pairs(count: int, seed: int, lowest: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Independent uniform directions ``(wi, wo)``, float64."""
    return tuple(hemisphere(count, seed + k, lowest).astype(np.float64) for k in range(2))


def unit(w) -> np.ndarray:
    """Vectors made as long as one, float64."""
    w = np.asarray(w, np.float64)
    return w / np.linalg.norm(w, axis=-1, keepdims=True)


def near_mirror(wi: np.ndarray, wo: np.ndarray, spread: float) -> np.ndarray:
    """Directions ``wo``, every other one moved to near the mirror direction of ``wi``."""
    wo = wo.copy()
    wo[::2] = unit(wi[::2] * [-1, -1, 1] + spread * wo[::2])
    return wo


def environment(library: str | None = None) -> dict[str, str]:
    """Variables for a process that is to use an LLVM, or to choose one."""
    others = {name: value for name, value in os.environ.items() if name != llvm.VARIABLE}
    return others | ({llvm.VARIABLE: library} if library else {})


def python(code: str, **options) -> subprocess.CompletedProcess:
    """What became of some code in a fresh Python."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=900, **options)


def fresh_process():
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))


def spherical(theta, phi) -> np.ndarray:
    """The directions of polar angles and azimuths in degrees, shape (…, 3)."""
    theta, phi = np.broadcast_arrays(np.radians(theta), np.radians(phi))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def written(folder: Path, name: str, content: str | bytes) -> Path:
    """A new file."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def traced(function) -> tuple:
    """What a function returns, the bytes that are left of it, and those that it took at most."""
    tracemalloc.start()
    try:
        result = function()
        return result, *tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()


def refused(path: Path) -> str:
    """Return the sentence by which a measured file is refused, which begins with its name."""
    with pytest.raises(FileError) as caught:
        read(path)
    text = str(caught.value)
    assert text.startswith(str(path)) and text.endswith(".") and text.isprintable(), text
    return text


class Page(HTMLParser):
    """What a browser would make of a page, whose elements have ends."""

    def __init__(self, text: str):
        super().__init__()
        self.open, self.elements, self.text = [], [], ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.handle_startendtag(tag, attributes)
        if tag not in ("br", "hr", "img", "input", "link", "meta", "source", "wbr"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        assert len(dict(attributes)) == len(attributes), "an attribute is given twice"

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def attributes(self, name: str) -> list[str]:
        return [attributes[name] for _, attributes in self.elements if name in attributes]

    def pictures(self) -> list[str]:
        """The descriptions of all pictures."""
        return [attributes["aria-label"] for tag, attributes in self.elements if attributes.get("role") == "img"]


def von_mises_fisher(axis: np.ndarray, width: float, count: int):
    """Samples of a lobe on the whole sphere about an axis, and their density."""
    axis, kappa, rng = np.float64(axis), width**-2, np.random.default_rng(1)
    versine = -np.log1p(rng.random(count) * np.expm1(-2 * kappa)) / kappa
    phi, sin = rng.uniform(0, 2 * np.pi, count), np.sqrt(versine * (2 - versine))
    across = np.cross(axis, [0, 0, 1])
    across /= np.linalg.norm(across)
    w = np.stack([sin * np.cos(phi), sin * np.sin(phi), 1 - versine], axis=-1) @ [across, np.cross(axis, across), axis]

    def pdf(wo):
        return np.exp(-kappa * 0.5 * ((wo - axis) ** 2).sum(axis=1)) * kappa / (2 * np.pi * -np.expm1(-2 * kappa))

    return w, pdf


def observed() -> tuple[np.ndarray, np.ndarray]:
    """``(wavelengths, weights)``: each quarter of a nm, and the linear sRGB that a reflectance there has under D65 for
    the CIE 1931 observer, of white 1 in each channel."""
    scalar = importlib.import_module("mitsuba.scalar_rgb")
    wavelengths = np.arange(360, 830.1, 0.25)
    xyz = np.array([np.array(scalar.cie1931_xyz(w)).ravel() * float(scalar.cie_d65(w)) for w in wavelengths])
    to_srgb = [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.969266, 1.8760108, 0.041556],
        [0.0556434, -0.2040259, 1.0572252],
    ]
    weights = xyz @ np.transpose(to_srgb)
    return wavelengths, weights / weights.sum(axis=0)


def call(method, ctx, wi, *arrays):
    """``method(ctx, si, …)`` of a BSDF for arrays of inputs, each of shape (N, k): a list of (N, channels) arrays, one
    for each value that it returns. Scalar variants get one call for each row."""
    types = {3: mi.Vector3f, 2: mi.Point2f, 1: mi.Float}

    def given_as(array):
        columns = array.T if is_scalar() or array.ndim == 1 else [*map(floats, array.T)]
        return types[array.shape[-1]](*columns)

    def once(wi, arrays):
        given = [*map(given_as, arrays)]
        result = method(ctx, interaction(wi), *given, True)
        result = result if isinstance(result, tuple) else (result,)
        dr.eval(result)  # in one kernel
        flat = []
        for value in result:
            flat += [value.wo, value.pdf] if isinstance(value, mi.BSDFSample3f) else [value]
        return [numbers(value) for value in flat]

    if not is_scalar():
        return once(wi, arrays)
    rows = [once(w, [array[k] for array in arrays]) for k, w in enumerate(wi)]
    return [np.concatenate(column) for column in zip(*rows, strict=True)]


def chi_square(bsdf, ctx, wi, *, seed, **resolution) -> ChiSquareTest:
    """Mitsuba's χ² test of a sampler. The sphere's poles are laid into the horizon, as cells at a pole are too long for
    a narrow lobe, and the horizon onto cell borders, as densities may jump there. Samples count by pdf > 0: where f = 0
    the weight is 0 though the sample was drawn."""
    si = interaction(wi)
    si.wi = dr.normalize(si.wi)

    def sample(u):
        bs, _ = bsdf.sample(ctx, si, u[0], mi.Point2f(u[1], u[2]), True)
        return mi.Vector3f(bs.wo.x, bs.wo.z, bs.wo.y), dr.select(bs.pdf > 0, 1.0, 0.0)

    def pdf(w):
        return bsdf.pdf(ctx, si, mi.Vector3f(w.x, w.z, w.y), True)

    seed = dr.opaque(mi.UInt32, seed)  # all seeds have one kernel
    return ChiSquareTest(SphericalDomain(), sample, pdf, sample_dim=3, seed=seed, **{"ires": 16} | resolution)


def efficiencies(bsdf: dict, angles) -> np.ndarray:
    """η = E[w]²/E[w²] of the luminance of the sampling weight at each angle of incidence, good to 0.001."""
    probe = BSDFProbe(mi.load_dict(bsdf))
    wi = np.array([direction(theta) for theta in angles])
    return sampling_efficiency(luminance(probe.weights(probe.whole, wi, lattice(13, 1))))


def small_picture(scene, size=32, spp=16):
    """A small rendering of a scene, free of NaN, infinite and negative pixels, and neither black nor blown out.

    Few samples may put a spectral pixel outside the sRGB gamut, where a channel is negative; its luminance never is.
    """
    params = mi.traverse(scene)
    params[next(key for key in params.keys() if key.endswith("film.size"))] = [size, size]
    params.update()
    image = np.array(mi.render(scene, spp=1 if is_scalar() else spp))
    assert np.isfinite(image).all()
    assert ((image @ [0.2126, 0.7152, 0.0722] if mi.is_spectral else image) >= 0).all()
    assert 0.02 < np.median(image) < 0.9
    assert (image > 2).mean() < 0.1
    return image
