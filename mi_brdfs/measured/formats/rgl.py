"""RGL .bsdf, the tensor files of Dupuy and Jakob 2018, which Mitsuba's ``measured`` renders."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...parameters.messages import brief
from ..adaptation import LAST, adapted, brightness, turned
from ..adaptive import Adaptive
from ..arrays import NUMPY, components, stacked
from ..files import BinaryFile, FileError, decoded, shortened
from ..grid import Axis, Grid
from ..measurement import Measurement
from ..source import Source

NAME = "RGL"
DESCRIPTION = "the words 'tensor_file', then named arrays"
THETA_I = np.radians([*np.linspace(0, 80, 25), 82, 84, 86, 87, 88, 89, 90])
"""The angles that are written. RGL's own files have 8, and 32 x 32 values at each."""
STEP_PHI_I = np.radians(10)
RESOLUTION, RESOLUTION_ANISOTROPIC = 64, 48
MOST_VALUES = 1 << 27
"""Those of a file of 512 MiB."""
MAGIC = b"tensor_file\0"
VERSION = 1, 0
TYPES = dict(enumerate(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"), start=1))
HEAD = [("dimensions", "<u2"), ("type", "u1"), ("offset", "<u8")]
"""What follows a field's name, before its shape."""


def recognizes(path: Path, head: bytes) -> bool:
    return head.startswith(MAGIC)


def read(path: Path) -> Measurement:
    file = TensorFile(path)
    phi_i, theta_i = file.nodes("phi_i"), file.nodes("theta_i", 0, np.pi / 2)
    wavelengths = file.nodes("wavelengths", 0, np.inf) if "wavelengths" in file.fields else None
    name, channels = ("rgb", 3) if wavelengths is None else ("spectra", len(wavelengths))
    slices = len(phi_i), len(theta_i)
    ndf, sigma, vndf = file.density("ndf"), file.density("sigma"), file.density("vndf", *slices)
    values = file.on_square(name, *slices, channels).transpose(0, 1, 4, 3, 2)
    if len(phi_i) == 2 and _equal(vndf) and _equal(values):
        phi_i, vndf, values = phi_i[:1], vndf[:1], values[:1]
    coordinates = Adaptive(phi_i, theta_i, ndf, sigma, vndf, bool(file.array("jacobian", "u1", 1)[0]))
    axes = [Axis(phi_i), Axis(theta_i), *(Axis(np.linspace(0, 1, n)) for n in values.shape[2:4])]
    if not coordinates.anisotropic:
        axes, values = axes[1:], values[0]
    description, field = "", file.fields.get("description")
    if field and (field.dtype, len(field.shape)) == ("u1", 1) and field.count:
        description = decoded(file.array("description", "u1", None).tobytes()).replace("\0", " ").strip()
    return Measurement(
        path,
        NAME,
        Grid(coordinates, tuple(axes), values, signed=wavelengths is None),
        wavelengths=wavelengths,
        material=description or path.stem,
        quantity="f cos",
    )


def write(path: Path, source: Source, resolution: int | None = None) -> None:
    """Write ``resolution`` x ``resolution`` values for each of 32 angles θi, by default 64, and 48 for each of the φi
    too if the source is anisotropic: 3 MB and more in rgb.

    Mitsuba's ``measured`` renders rgb files in its rgb variants, and others in its spectral ones. Where anisotropic
    files have a symmetry, ``measured`` looks the wrong slice up for a wi with exactly y = 0; ``tabulated`` does not.

    Raises:
        ValueError: if there are more than 512 MiB.
        OSError: if the file cannot be written.
    """
    span = turned(source)
    resolution = resolution or (RESOLUTION_ANISOTROPIC if span else RESOLUTION)
    # As Mitsuba has it, the whole turn, the lower half and the third quadrant.
    phi_i = np.linspace(-np.pi, span - np.pi, round(span / STEP_PHI_I) + 1) if span else np.zeros(1)
    source.check_size(len(phi_i) * len(THETA_I) * resolution**2, MOST_VALUES)
    ndf, sigma, vndf = adapted(source, phi_i, THETA_I, resolution)
    coordinates = Adaptive(phi_i, THETA_I, ndf, sigma, vndf)
    u = np.linspace(0, 1, resolution)
    slices = []
    for azimuth, theta in itertools.product(phi_i, np.minimum(THETA_I, LAST)):
        places = *([azimuth] if span else []), theta, *np.meshgrid(u, u, indexing="ij")
        slices.append(_slice(source, coordinates, np.broadcast_arrays(*places)))
    values, luminance, valid = (
        np.array(each).reshape(len(phi_i), len(THETA_I), *each[0].shape) for each in zip(*slices, strict=True)
    )
    dark = ~luminance.any(axis=(-2, -1), keepdims=True)
    channels = {"rgb": values}
    if source.wavelengths is not None:
        channels = {"wavelengths": source.wavelengths.astype(np.float32), "spectra": values}
    fields: dict[str, np.ndarray] = {
        "version": np.array([1, 0], dtype=np.uint32),
        "description": np.frombuffer(source.material.encode(), dtype=np.uint8),
        "phi_i": phi_i.astype(np.float32),
        "theta_i": THETA_I.astype(np.float32),
        "sigma": sigma,
        "ndf": ndf,
        "vndf": vndf,
        "luminance": np.where(dark, 1, luminance).astype(np.float32),
        **channels,
        "jacobian": np.ones(1, dtype=np.uint8),
        "valid": np.packbits(valid),
    }
    write_tensors(path, fields)


def _slice(source: Source, coordinates: Adaptive, places: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return ``(values, density, valid)`` at places, shapes (channels, u2, u1), and (u2, u1) twice: the table's values,
    what directions are to be drawn in proportion to, and which of them are above the horizon."""
    wi, wo = coordinates.directions(*places)
    above = wo.z > 1e-6
    given, taken = stacked(wi)[above], stacked(wo)[above]
    f = source.evaluate(given, taken)
    f = np.where(np.isfinite(f), f, 0)
    _, scale = coordinates.locate_scaled(components(given), components(taken), NUMPY)
    values = np.zeros((*above.shape, f.shape[-1]), dtype=np.float32)
    values[above] = f / scale[:, None]
    density = np.zeros(above.shape)
    density[above] = brightness(f) * wo.z[above] * coordinates.solid_angle(*places)[above]
    return values.transpose(2, 1, 0), density.T, above.T


def _equal(array: np.ndarray) -> bool:
    return bool(np.array_equal(array[0], array[1], equal_nan=True))


# --- Mitsuba's tensor files: named arrays behind a table of contents -------------------------------------------------


@dataclass(frozen=True)
class Field:
    """An array of a file: numpy's name of the type, the first byte, and the shape."""

    dtype: str
    offset: int
    shape: tuple[int, ...]

    @property
    def count(self) -> int:
        return math.prod(self.shape)


class TensorFile:
    """A file of named arrays."""

    def __init__(self, path: Path) -> None:
        self.file = file = BinaryFile(path)
        self.fields: dict[str, Field] = {}
        file.take("u1", len(MAGIC), "the words 'tensor_file'")
        version = tuple(int(n) for n in file.take("u1", 2, "version numbers"))
        if version != VERSION:
            raise file.error(f"the version is {version[0]}.{version[1]}; only 1.0 is known", file.offset - 2)
        for _ in range(int(file.take("u4", 1, "the number of fields")[0])):
            start = file.offset
            length = int(file.take("u2", 1, "the length of a field's name")[0])
            name = decoded(file.take("u1", length, "a field's name").tobytes())
            (head,) = file.take(np.dtype(HEAD), 1, f"the type and place of {shortened(name)}")
            dimensions, type, offset = (int(n) for n in head)
            if type not in TYPES:
                raise file.error(f"field {shortened(name)} is of the unknown type {type}", start)
            shape = tuple(int(n) for n in file.take("u8", dimensions, f"the shape of {shortened(name)}"))
            self.fields[name] = Field(TYPES[type], offset, shape)

    def error(self, name: str, problem: str, index: int = 0) -> FileError:
        """Return an error at a value of a field."""
        field = self.fields[name]
        return self.file.error(f"{name!r} {problem}", field.offset + index * np.dtype(field.dtype).itemsize)

    def array(self, name: str, dtype: str, *shape: int | None) -> np.ndarray:
        """Return a field that must be there as a whole, of a type and a shape, in which None stands for any number but
        0."""
        if name not in self.fields:
            raise self.file.error(
                f"the table of contents ends without {name!r}; it has {brief(', '.join(self.fields))}"
            )
        field = self.fields[name]
        if field.dtype != dtype:
            raise self.error(name, f"is of type {np.dtype(field.dtype)}; it must be {np.dtype(dtype)}")
        wanted = [n or given for n, given in zip(shape, field.shape, strict=False)]
        if len(field.shape) != len(shape) or list(field.shape) != wanted or not field.count:
            words = " × ".join("n" if n is None else str(n) for n in shape)
            raise self.error(name, f"is of shape {field.shape}; by the other fields it must be {words}")
        self.file.offset = field.offset
        return self.file.take(dtype, field.count, f"{name!r}").reshape(field.shape)

    def on_square(self, name: str, *shape: int | None) -> np.ndarray:
        """Return a field whose last two axes are those of the unit square."""
        values = self.array(name, "f4", *shape, None, None)
        if min(values.shape[-2:]) < 2:
            raise self.error(name, f"is of shape {values.shape}; its last two dimensions must be at least 2")
        return values

    def density(self, name: str, *shape: int | None) -> np.ndarray:
        """Return maps on the unit square that are nowhere negative, and not 0 everywhere."""
        values = self.on_square(name, *shape)
        for k in np.flatnonzero(~((values >= 0) & (values < np.inf))):
            raise self.error(name, f"has the value {values.flat[k]:g}", int(k))
        for k in np.flatnonzero(~np.any(values, axis=(-2, -1))):
            raise self.error(name, "is 0 everywhere", int(k) * values.shape[-2] * values.shape[-1])
        return values

    def nodes(self, name: str, low: float = -np.inf, high: float = np.inf) -> np.ndarray:
        """Return increasing numbers."""
        nodes = self.array(name, "f4", None).astype(np.float64)
        for k in np.flatnonzero(~((nodes >= low - 1e-4) & (nodes <= high + 1e-4) & np.isfinite(nodes))):
            raise self.error(name, f"has the value {nodes[k]:g}", int(k))
        for k in np.flatnonzero(np.diff(nodes) <= 0):
            raise self.error(name, f"must increase, but {nodes[k + 1]:g} follows {nodes[k]:g}", int(k) + 1)
        return nodes


def write_tensors(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Write arrays, each from a multiple of 8 bytes on. (Mitsuba's own writer does not say why a disk refuses.)"""
    head = struct.pack("<12sBBI", MAGIC, *VERSION, len(fields))
    offset = len(head) + sum(13 + len(name.encode()) + 8 * field.ndim for name, field in fields.items())
    types = {dtype: number for number, dtype in TYPES.items()}
    for name, field in fields.items():
        offset += -offset % 8
        head += struct.pack("<H", len(name.encode())) + name.encode()
        head += struct.pack(f"<HBQ{field.ndim}Q", field.ndim, types[field.dtype.str[1:]], offset, *field.shape)
        offset += field.nbytes
    with path.open("wb") as file:
        file.write(head)
        for field in fields.values():
            file.write(bytes(-file.tell() % 8))
            file.write(field.tobytes())
