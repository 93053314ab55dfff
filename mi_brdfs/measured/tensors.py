"""Mitsuba's tensor files: named arrays behind a table of contents."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .files import BinaryFile
from .text import decoded, shortened

MAGIC = b"tensor_file\0"
VERSION = 1, 0
TYPES = dict(enumerate(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"), start=1))
MOST_DIMENSIONS = 16
MOST_FIELDS = 1024


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


def write(path: Path, fields: dict[str, np.ndarray]) -> None:
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
