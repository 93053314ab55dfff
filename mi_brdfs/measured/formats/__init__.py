"""The file formats: a module each, which recognizes its files by what they contain and reads them."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import get_args

from ..files import FileError, checked, shortened
from ..measurement import Measurement, Quantity, representable
from . import alta, cornell, csv, lighttools, mbsdf, merl, rgl, utia, zemax

FORMATS: list[ModuleType] = [merl, rgl, mbsdf, zemax, lighttools, alta, cornell, csv, utia]
"""Modules with ``NAME``, ``DESCRIPTION`` (what its files look like, in one sentence), ``recognizes(path, head)``, where
``head`` are the first bytes, and ``read(path)``; the first that recognizes a file reads it. Those that can be written
(``ENDINGS``) have ``write(path, source)``."""
UNSTATED = alta, csv, utia
"""Those whose files need not state whether they hold f or f cosθo: ``read(path, quantity)`` is told."""
ENDINGS = {".binary": [merl], ".bsdf": [rgl, zemax], ".csv": [csv]}
"""Of files that are written, with their formats: the first one by default."""

HEAD = 1 << 16
"""The bytes by which formats are told apart: as many as a long comment may take, and the first line behind it."""


def read(path: str | Path, quantity: Quantity = "stated") -> Measurement:
    """Read a file with a measured BRDF, whose format is found from what it contains.

    ``quantity`` says whether it holds ``f`` or ``f cos``, f cosθo, where it does not state that itself, as ALTA's and
    CSV files need not and UTIA's cannot.

    Raises:
        FileError: if it cannot be read; the message is one sentence with the file's name and the offset or line.
        ValueError: if there is no such quantity.
    """
    if quantity not in get_args(Quantity):
        raise ValueError(f"the quantity {shortened(quantity)} is none of {', '.join(get_args(Quantity))}")
    path = checked(path)
    with path.open("rb") as file:
        head = file.read(HEAD)
    for format in FORMATS:
        if format.recognizes(path, head):
            measurement = format.read(path, quantity) if format in UNSTATED else format.read(path)
            if quantity not in ("stated", measurement.quantity):
                states = f"{path} holds {measurement.quantity}, as it or its format states"
                raise FileError(f"{states}, and not {quantity}; leave the quantity out.")
            return representable(measurement)
    known = "; ".join(f"{format.NAME}: {format.DESCRIPTION}" for format in FORMATS)
    raise FileError(f"{path} is of no known format. Known are {known}.")
