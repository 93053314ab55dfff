"""RGL .bsdf, the tensor files of Dupuy and Jakob 2018, which Mitsuba's ``measured`` renders."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...parameters.messages import brief
from ..adaptation import LAST, adapted, brightness, turned
from ..adaptive import Adaptive
from ..arrays import NUMPY, components, stacked
from ..files import BinaryFile
from ..measurement import Axis, FileError, Grid, Measurement
from ..source import Source
from ..text import decoded, shortened

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
MOST_DIMENSIONS = 16
MOST_FIELDS = 1024


def recognizes(path: Path, head: bytes) -> bool:
    return head.startswith(MAGIC)


def read(path: Path) -> Measurement:
    return _File(path).measurement()


def write(path: Path, source: Source, resolution: int | None = None) -> None:
    """Write ``resolution`` x ``resolution`` values for each of 32 angles θi, by default 64, and 48 for each of the φi
    too if the source is anisotropic: 3 MB and more in rgb.

    Mitsuba's ``measured`` renders rgb files in its rgb variants, and others in its spectral ones. What is of one
    wavelength that nobody stated is written as grey. Where anisotropic files have a symmetry, ``measured`` looks the
    wrong slice up for a wi with exactly y = 0; ``tabulated`` does not.

    Raises:
        ValueError: if there are more than 512 MiB.
        OSError: if the file cannot be written.
    """
    if source.wavelengths is not None and np.isnan(source.wavelengths).any():
        source = source.rgb()
    span = turned(source)
    resolution = resolution or (RESOLUTION_ANISOTROPIC if span else RESOLUTION)
    # As Mitsuba has it, the whole turn, the lower half and the third quadrant.
    phi_i = np.linspace(-np.pi, span - np.pi, round(span / STEP_PHI_I) + 1) if span else np.zeros(1)
    source.check_size(len(phi_i) * len(THETA_I) * resolution**2, MOST_VALUES)
    ndf, sigma, vndf = adapted(source, phi_i, THETA_I, resolution)
    coordinates = Adaptive(phi_i, THETA_I, ndf, sigma, vndf)
    u = np.linspace(0, 1, resolution)
    slices: list[tuple[np.ndarray, ...]] = []
    for azimuth in phi_i:
        for theta in np.minimum(THETA_I, LAST):
            places = np.meshgrid(*([azimuth, theta, u, u] if span else [theta, u, u]), indexing="ij")
            slices.append(_slices(source, coordinates, [place.reshape(1, *place.shape[-2:]) for place in places]))
    values, luminance, valid = (
        np.concatenate(fields).reshape(len(phi_i), -1, *fields[0].shape[1:]) for fields in zip(*slices, strict=True)
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


def _slices(source: Source, coordinates: Adaptive, places: list[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return ``(values, density, valid)`` at places, shapes (θi, channels, u2, u1), and (θi, u2, u1) twice: the table's
    values, what directions are to be drawn in proportion to, and which of them are above the horizon."""
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
    return values.transpose(0, 3, 2, 1), density.transpose(0, 2, 1), above.transpose(0, 2, 1)


class _File:
    """A tensor file whose fields are those of a material."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = BinaryFile(path)
        self.tensors = contents(self.file)

    def measurement(self) -> Measurement:
        spectral = "wavelengths" in self.tensors
        name = "spectra" if spectral else "rgb"
        phi_i, theta_i = self.nodes("phi_i"), self.nodes("theta_i", 0, np.pi / 2)
        wavelengths = self.nodes("wavelengths", 0, np.inf) if spectral else None
        channels = 3 if wavelengths is None else len(wavelengths)
        given = self.fitting(name, {0: len(phi_i), 1: len(theta_i), 2: channels}, 5)
        jacobian = self.field("jacobian", "u1", 1)
        if jacobian.count != 1:
            raise self.problem("jacobian", f"has {jacobian.count} values; it is one")
        ndf, sigma = self.density("ndf", {}, 2), self.density("sigma", {}, 2)
        vndf = self.density("vndf", {0: len(phi_i), 1: len(theta_i)}, 4)
        values = array(self.file, given, name).transpose(0, 1, 4, 3, 2)
        if len(phi_i) == 2 and all(np.array_equal(a[0], a[1], equal_nan=True) for a in (vndf, values)):
            phi_i, vndf, values = phi_i[:1], vndf[:1], values[:1]
        coordinates = Adaptive(phi_i, theta_i, ndf, sigma, vndf, bool(array(self.file, jacobian, "jacobian")[0]))
        axes = [Axis(phi_i), Axis(theta_i), *(Axis(np.linspace(0, 1, n)) for n in values.shape[2:4])]
        if not coordinates.anisotropic:
            axes, values = axes[1:], values[0]
        return Measurement(
            self.path,
            NAME,
            Grid(coordinates, tuple(axes), values, signed=not spectral),
            wavelengths=wavelengths,
            material=self.description() or self.path.stem,
            quantity="f cos",
        )

    def problem(self, name: str, problem: str, index: int = 0) -> FileError:
        """Return an error at a value of a field."""
        tensor = self.tensors[name]
        return self.file.error(f"{name!r} {problem}", tensor.offset + index * np.dtype(tensor.dtype).itemsize)

    def field(self, name: str, dtype: str, dimensions: int) -> Tensor:
        """Return a field that must be there, with so many dimensions."""
        if name not in self.tensors:
            raise self.file.error(
                f"the table of contents ends without {name!r}; it has {brief(', '.join(self.tensors))}"
            )
        tensor = self.tensors[name]
        if tensor.dtype != dtype:
            raise self.problem(name, f"is of type {np.dtype(tensor.dtype)}; it must be {np.dtype(dtype)}")
        if len(tensor.shape) != dimensions or not tensor.count:
            raise self.problem(
                name, f"is of shape {tensor.shape}; it must have {dimensions} dimensions, none of them 0"
            )
        return tensor

    def fitting(self, name: str, sizes: dict[int, int], dimensions: int) -> Tensor:
        """Return a field whose last two axes are those of the unit square, and whose others have these sizes."""
        tensor = self.field(name, "f4", dimensions)
        if any(tensor.shape[axis] != size for axis, size in sizes.items()):
            raise self.problem(
                name, f"is of shape {tensor.shape}; by the other fields it must start with {tuple(sizes.values())}"
            )
        if min(tensor.shape[-2:]) < 2:
            raise self.problem(name, f"is of shape {tensor.shape}; its last two dimensions must be at least 2")
        return tensor

    def nodes(self, name: str, low: float = -np.inf, high: float = np.inf) -> np.ndarray:
        """Return increasing numbers."""
        with np.errstate(invalid="ignore"):
            nodes = array(self.file, self.field(name, "f4", 1), name).astype(np.float64)
        for k, wrong in enumerate(~((nodes >= low - 1e-4) & (nodes <= high + 1e-4) & np.isfinite(nodes))):
            if wrong:
                raise self.problem(name, f"has the value {nodes[k]:g}", k)
        for index in np.flatnonzero(np.diff(nodes) <= 0):
            raise self.problem(
                name, f"must increase, but {nodes[index + 1]:g} follows {nodes[index]:g}", int(index) + 1
            )
        return nodes

    def density(self, name: str, sizes: dict[int, int], dimensions: int) -> np.ndarray:
        """Return maps on the unit square that are nowhere negative, and not 0 everywhere."""
        values = array(self.file, self.fitting(name, sizes, dimensions), name)
        wrong = np.flatnonzero(~((values >= 0) & (values < np.inf)))
        if len(wrong):
            raise self.problem(name, f"has the value {values.flat[wrong[0]]:g}", int(wrong[0]))
        empty = np.flatnonzero(~np.any(values, axis=(-2, -1)))
        if len(empty):
            raise self.problem(name, "is 0 everywhere", int(empty[0]) * values.shape[-2] * values.shape[-1])
        return values

    def description(self) -> str:
        """Return what the file says it is, if anything."""
        tensor = self.tensors.get("description")
        if tensor is None or tensor.dtype != "u1":
            return ""
        return decoded(array(self.file, tensor, "description").tobytes()).replace("\0", " ").strip()


# --- Mitsuba's tensor files: named arrays behind a table of contents -------------------------------------------------


@dataclass(frozen=True)
class Tensor:
    """An array of a file: numpy's name of the type, the first byte, and the shape."""

    dtype: str
    offset: int
    shape: tuple[int, ...]

    @property
    def count(self) -> int:
        return math.prod(self.shape)

    @property
    def end(self) -> int:
        return self.offset + self.count * np.dtype(self.dtype).itemsize


def contents(file: BinaryFile) -> dict[str, Tensor]:
    """Return which arrays a file has, by name.

    Raises:
        FileError: if it is none, or an array is not in it as a whole, or shares bytes with another.
    """
    if file.take("u1", len(MAGIC), "the words 'tensor_file'").tobytes() != MAGIC:
        raise file.error("the words 'tensor_file' should stand", 0)
    version = tuple(int(n) for n in file.take("u1", 2, "version numbers"))
    if version != VERSION:
        raise file.error(f"the version is {version[0]}.{version[1]}; only 1.0 is known", file.offset - 2)
    count = int(file.take("u4", 1, "the number of fields")[0])
    if count > MOST_FIELDS:
        raise file.error(f"{count:,} fields are announced", file.offset - 4)
    tensors: dict[str, Tensor] = {}
    for _ in range(count):
        start = file.offset
        length = int(file.take("u2", 1, "the length of a field's name")[0])
        name = decoded(file.take("u1", length, "a field's name").tobytes())
        shown = shortened(name)
        dimensions = int(file.take("u2", 1, f"the number of dimensions of {shown}")[0])
        type = int(file.take("u1", 1, f"the type of {shown}")[0])
        offset = int(file.take("u8", 1, f"the offset of {shown}")[0])
        if name in tensors:
            raise file.error(f"a second field {shown} follows", start)
        if type not in TYPES:
            raise file.error(f"field {shown} is of the unknown type {type}", start)
        if dimensions > MOST_DIMENSIONS:
            raise file.error(f"field {shown} has {dimensions:,} dimensions", start)
        shape = tuple(int(n) for n in file.take("u8", dimensions, f"the shape of {shown}"))
        tensor = tensors[name] = Tensor(TYPES[type], offset, shape)
        if tensor.end > file.size:
            raise file.error(
                f"field {shown} should lie from byte {offset:,} to {tensor.end:,}, but the file ends at {file.size:,}",
                start,
            )
    by_place = sorted((tensor.offset, tensor.end, shortened(name)) for name, tensor in tensors.items() if tensor.count)
    end, before = file.offset, "the table of contents"
    for start, stop, name in by_place:
        if start < end:
            raise file.error(f"field {name} starts, but {before} reaches to byte {end:,}", start)
        end, before = stop, f"field {name}"
    return tensors


def array(file: BinaryFile, tensor: Tensor, name: str) -> np.ndarray:
    """Return an array of a file."""
    file.offset = tensor.offset
    return file.take(tensor.dtype, tensor.count, f"{name!r}").reshape(tensor.shape)


def write_tensors(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Write arrays, each from a multiple of 8 bytes on.

    Raises:
        OSError: if the file cannot be written.
    """
    arrays = {name: np.ascontiguousarray(field, field.dtype.newbyteorder("<")) for name, field in fields.items()}
    head = struct.pack("<12sBBI", MAGIC, *VERSION, len(fields))
    offset = len(head) + sum(13 + len(name.encode()) + 8 * field.ndim for name, field in arrays.items())
    types = {dtype: number for number, dtype in TYPES.items()}
    for name, field in arrays.items():
        offset += -offset % 8
        head += struct.pack("<H", len(name.encode())) + name.encode()
        head += struct.pack(f"<HBQ{field.ndim}Q", field.ndim, types[field.dtype.str[1:]], offset, *field.shape)
        offset += field.nbytes
    with path.open("wb") as file:
        file.write(head)
        for field in arrays.values():
            file.write(bytes(-file.tell() % 8))
            file.write(field.tobytes())
