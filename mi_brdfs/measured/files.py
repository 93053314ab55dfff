"""Files as bytes: what is read is checked against the file's size first, and every complaint names file and offset."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np

from ..parameters.messages import printable


class FileError(ValueError):
    """A file that cannot be read. The message is one sentence that names the file and, where there is one, the offset
    or the line, without what would control a terminal in the file's name or its text."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def checked(path: str | Path) -> Path:
    """Return the path of a file, in the folder of the environment variable MI_BRDFS_MERL_DIR if only that has it. Raise
    a FileError if it cannot be read, is no file or has nothing in it."""
    path, folder = Path(path), os.environ.get("MI_BRDFS_MERL_DIR")
    if folder and not path.exists() and (Path(folder) / path).is_file():
        path = Path(folder) / path
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: {reason(error)}.") from None
    if stat.S_ISDIR(status.st_mode):
        raise FileError(f"{path} is a directory; give a file in it.")
    if not stat.S_ISREG(status.st_mode):
        raise FileError(f"{path} is not a regular file.")
    if not os.access(path, os.R_OK):
        raise FileError(f"{path}: Permission denied.")
    if not status.st_size:
        raise FileError(f"{path} is empty.")
    return path


def content_hash(path: str | Path) -> str:
    """Return the SHA-256 of a file, as another content may have the same size and time, or raise a FileError."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise FileError(f"{named(path)}: {reason(error)}.") from None


def named(path: str | Path) -> str:
    """Return a path as it can be shown, without what would control a terminal or is not in UTF-8."""
    return printable(str(path))


def reason(error: Exception) -> str:
    """Return why the system refused a file."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


class BinaryFile:
    """Reads a little-endian binary file from its start on."""

    def __init__(self, path: Path) -> None:
        self.path, self.size, self.offset = path, path.stat().st_size, 0

    @property
    def left(self) -> int:
        """The bytes behind the offset."""
        return max(self.size - self.offset, 0)

    def error(self, problem: str, offset: int | None = None) -> FileError:
        return FileError(f"{self.path}: at byte {self.offset if offset is None else offset}, {problem}.")

    def take(self, dtype: Any, count: int, what: str) -> np.ndarray:
        """Return the next ``count`` numbers, and move behind them. Raise a FileError if the file ends before; ``what``
        says in plural what is missing."""
        dtype = np.dtype(dtype).newbyteorder("<")
        needed = int(count) * dtype.itemsize
        if needed > self.left:
            raise self.error(
                f"{needed:,} bytes of {what} should follow, but the file ends after {self.left:,}; "
                "it is truncated, or of another format"
            )
        values = np.fromfile(self.path, dtype=dtype, count=int(count), offset=self.offset)
        if len(values) < count:
            raise self.error(f"{what} are missing; the file became shorter while it was read")
        self.offset += needed
        return values
