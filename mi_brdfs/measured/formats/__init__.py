"""The file formats: a module each, which recognizes its files by what they contain and reads them."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from ..files import checked
from ..measurement import FileError, Measurement
from . import alta, cornell, csv, lighttools, mbsdf, merl, rgl, utia, zemax

FORMATS: list[ModuleType] = [merl, rgl, mbsdf, zemax, lighttools, alta, cornell, csv, utia]
"""Modules with ``NAME``, ``DESCRIPTION`` (what its files look like, in one sentence), ``recognizes(path, head)``, where
``head`` is the first kilobyte, and ``read(path)``; the first that recognizes a file reads it. Those that can be written
have ``write(path, source)``."""
ENDINGS = {".binary": ["MERL"], ".bsdf": ["RGL", "Zemax"], ".csv": ["CSV"]}
"""Of files that are written, with the names of the formats: the first one by default."""

HEAD = 1024


def read(path: str | Path) -> Measurement:
    """Read a file with a measured BRDF, whose format is found from what it contains.

    Raises:
        FileError: if it cannot be read; the message is one sentence with the file's name and the offset or line.
    """
    path = checked(path)
    with path.open("rb") as file:
        head = file.read(HEAD)
    for format in FORMATS:
        if format.recognizes(path, head):
            return format.read(path)
    known = "; ".join(f"{format.NAME}: {format.DESCRIPTION}" for format in FORMATS)
    raise FileError(f"{path} is of no known format. Known are {known}.")
