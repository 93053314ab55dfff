"""CSV with a header that says what its columns are, and in which units."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np

from ...parameters.messages import brief
from ..arrays import stacked
from ..coordinates import spherical
from ..files import TextFile, is_number, opening, shortened
from ..measurement import Measurement, Quantity
from ..rows import measured
from ..source import Source

NAME = "CSV"
DESCRIPTION = "a header with theta_i_deg, theta_o_deg, phi_o_deg (or _rad) and f, or r, g, b, or wavelengths in nm"
ANGLE = re.compile(
    r"(theta|phi|delta_?phi|dphi)(?:_?(incident|incoming|in|i|light|l|outgoing|out|o|reflected|r|scattered|s|view|v))?"
    r"[\s_]*[(\[]?(degrees|deg|°|radians|rad)?[)\]]?"
)
INCIDENT = ("incident", "incoming", "in", "i", "light", "l")
VALUE = re.compile(
    r"(?:(red|green|blue|r|g|b)|(f|f_r|brdf)|(?:(?:f|brdf)[\s_]*)?(\d+(?:\.\d+)?)[\s_]*(?:nm)?)([\s_*·]*cos)?"
    r"\s*(?:[(\[]1/sr[)\]])?"
)
UNITS = {"deg": np.pi / 180, "degree": np.pi / 180, "°": np.pi / 180, "rad": 1.0, "radian": 1.0}
"""Radians in a unit."""
MOST_VALUES = 1 << 25
"""Those of a file of 400 MB."""


def recognizes(path: Path, head: bytes) -> bool:
    first = next((line for line in opening(head) if line and not line.startswith("#")), "")
    return path.suffix.lower() == ".csv" or any(ANGLE.fullmatch(name) for name in split(first, separator(first)))


def read(path: Path, quantity: Quantity) -> Measurement:
    """Read rows of angles and values below a header line, which may be a comment.

    The columns are ``theta_i``, ``phi_i`` (0 if missing), ``theta_o`` and ``phi_o``, or ``delta_phi`` for φo - φi, in
    any order, each with its unit: ``theta_i_deg``, ``theta_i_rad``, ``theta_i [deg]``; or a comment says it for all:
    ``# angles: degrees``. ``in``, ``l`` and ``light`` mean ``i``, and ``out``, ``r``, ``s``, ``v`` and ``view`` ``o``.
    The other columns are ``r``, ``g``, ``b`` in linear sRGB, wavelengths in nm (``450``, ``450nm``), or a single ``f``,
    whose wavelength a comment can give: ``# wavelength: 650``. Names with ``_cos`` behind them, or a comment
    ``# quantity: f cos``, mean f cosθo, and ``# quantity: f`` means f; without these the ``quantity`` asked for counts,
    which is f by default. An empty field is a missing value. Semicolons or tabs (with decimal points or commas),
    commas or white space separate.

    Rows that cross all angles become a grid, others samples: see :func:`mi_brdfs.measured.rows.arranged`.

    Raises:
        FileError: if a column or a unit is missing, ambiguous or unknown, or a row is not of such numbers.
    """
    file = TextFile(path)
    rows = fields(file)
    names = next(rows, [])
    if file.comments and all(map(is_number, names)):  # numpy.savetxt makes the header a comment
        above = split(file.comments[-1], separator(file.comments[-1]))
        if len(above) == len(names):
            names, rows = above, chain([names], rows)
    columns = Columns(file, names, quantity)
    table = file.table(rows, columns.count, "as many as the header has")
    angles = {name: table[:, k] * unit for name, (k, unit) in columns.angles.items()}
    phi_i = angles.get("phi_i", np.zeros(len(table)))
    phi_o = angles["phi_o"] if "phi_o" in angles else phi_i + angles["delta_phi"]
    theta_i, theta_o = angles["theta_i"], angles["theta_o"]
    if columns.angles["theta_i"][1] != 1 and 0 < np.abs([theta_i, theta_o]).max(initial=0) <= np.radians(np.pi / 2):
        warnings.warn(f"{path}: θ is at most 1.57°; if these are radians, call the columns _rad.", stacklevel=2)
    values, said = table[:, columns.values], {"material": file.stated("material"), "quantity": columns.quantity}
    del table
    return measured(file, NAME, (theta_i, phi_i, theta_o, phi_o), values, columns.wavelengths, **said)


def write(path: Path, source: Source) -> None:
    """Write a row for each θi of 0 to 85° and 89°, θo every 2.5°, and Δφ every 10°, every 2.5° about the mirror
    direction; for anisotropic sources, with θ every 5°, Δφ every 10° and φi every 15°. The columns are r, g, b, or
    wavelengths in nm.

    Raises:
        ValueError: if there are more values than ``MOST_VALUES``.
        OSError: if the file cannot be written.
    """
    theta = np.append(np.arange(0, 90, 5.0), 89)
    if source.anisotropic:
        angles = theta, theta, np.arange(0, 360, 10.0), np.arange(0, 360, 15.0)
    else:
        fine = np.append(np.arange(0, 90, 2.5), 89)
        angles = theta, fine, np.append(np.arange(0, 140, 10.0), np.arange(140, 181, 2.5)), np.zeros(1)
    source.check_size(math.prod(map(len, angles)), MOST_VALUES)
    names = "rgb" if source.wavelengths is None else [f"{w:.10g}nm" for w in source.wavelengths]
    with path.open("w", encoding="utf-8") as file:
        file.write("# quantity: f\n")
        if source.material:
            file.write(f"# material: {' '.join(source.material.split())}\n")
        file.write(",".join(["theta_i_deg", "theta_o_deg", "delta_phi_deg", "phi_i_deg", *names]) + "\n")
        for theta_i in angles[0]:
            rows = np.stack(np.meshgrid([theta_i], *angles[1:], indexing="ij"), axis=-1).reshape(-1, 4)
            i, o, delta, phi_i = np.radians(rows).T
            f = source.evaluate(stacked(spherical(i, phi_i)), stacked(spherical(o, phi_i + delta)))
            for row, values in zip(rows, f, strict=True):
                file.write(",".join([*(f"{angle:g}" for angle in row), *(f"{value:.7g}" for value in values)]) + "\n")


class Columns:
    """What a header and the comments above it say of the columns."""

    def __init__(self, file: TextFile, names: list[str], quantity: Quantity) -> None:
        self.file, self.count = file, len(names)
        self.angles: dict[str, tuple[int, float]] = {}
        """The column of an angle and its unit in radians, by its name: ``theta_i``, ``phi_o``, ``delta_phi`` …"""
        found: dict[str, int] = {}
        cosines = set()
        for k, name in enumerate(names):
            word = " ".join(name.lower().split())
            if word == "nan":
                raise file.error(f"column {k + 1} of the header has no name")
            if match := ANGLE.fullmatch(word):
                self._add_angle(k, name, *match.groups())
            elif match := VALUE.fullmatch(word):
                colour, grey, wavelength, cos = match.groups()
                kind = (colour or "")[:1] or (grey and "f") or f"{float(wavelength):.17g}"
                if wavelength and not float(wavelength):
                    raise file.error(f"the wavelength {shortened(wavelength)} is none")
                if kind in found:
                    raise file.error(f"the header has two columns of the same values, {shortened(name)} the second")
                found[kind] = k
                cosines.add(bool(cos))
            else:
                others = "no angle such as theta_i_deg or delta_phi_deg, no wavelength, and none of f, r, g, b"
                raise file.error(f"the column {shortened(name)} is {others}")
        for name in ("theta_i", "theta_o"):
            if name not in self.angles:
                raise file.error(f"the header has no column {name}, as theta_i_deg, theta_o_deg, phi_o_deg, f")
        if ("phi_o" in self.angles) == ("delta_phi" in self.angles):
            raise file.error("the header should have just one of the columns phi_o and delta_phi")
        self.wavelengths: np.ndarray | None = None
        if found.keys() == set("rgb"):
            self.values = [found[kind] for kind in "rgb"]
        elif found.keys() == {"f"}:
            stated = re.match(r"(\d+(?:\.\d+)?)\s*(nm)?$", text := file.stated("wavelength"))
            if text[:1].isdigit() and not stated:
                raise file.error(f"the wavelength {shortened(text)} is no number of nm, such as 650 or 650 nm")
            self.values, self.wavelengths = [found["f"]], np.array([float(stated[1]) if stated else np.nan])
        elif found and not found.keys() & set("rgbf"):
            kinds = sorted(found, key=float)
            self.values, self.wavelengths = [found[kind] for kind in kinds], np.array(kinds, dtype=np.float64)
        else:
            raise file.error(
                f"the columns of values, {brief(', '.join(found) or 'none')}, should be f, or r, g and b, or "
                "wavelengths in nm"
            )
        self.quantity = self._quantity(cosines, quantity)

    def _add_angle(self, k: int, name: str, kind: str, of: str | None, unit: str | None) -> None:
        unit = (unit or self.file.stated("angles", "units")).strip().lower().removesuffix("s")
        if unit not in UNITS:
            raise self.file.error(f"the column {shortened(name)} has no unit: call it {name.strip()}_deg or _rad")
        key = f"{kind}_{'i' if of in INCIDENT else 'o'}" if kind in ("theta", "phi") else "delta_phi"
        if (kind in ("theta", "phi")) == (of is None) or key in self.angles:
            raise self.file.error(
                f"the column {shortened(name)} is ambiguous: angles are theta_i, phi_i, theta_o, phi_o"
            )
        self.angles[key] = k, UNITS[unit]

    def _quantity(self, cosines: set[bool], unstated: Quantity) -> Literal["f", "f cos"]:
        stated = re.sub(r"[\s_*·]+", " ", self.file.stated("quantity").lower())
        if stated not in ("", "f", "brdf", "f cos", "brdf cos"):
            raise self.file.error(f"the quantity {shortened(stated)} is neither f nor f cos")
        if len(cosines) > 1 or (True in cosines and stated in ("f", "brdf")):
            raise self.file.error("some values are f cos, and others are f")
        return "f cos" if True in cosines or (stated or unstated).endswith("cos") else "f"


def fields(file: TextFile) -> Iterator[list[str]]:
    """Yield the fields of rows, with ``nan`` for empty ones."""
    mark: str | None = ""
    for text in file.content():
        mark = separator(text) if mark == "" else mark
        row = split(text, mark)
        yield [field.replace(",", ".") for field in row] if mark in (";", "\t") else row


def separator(text: str) -> str | None:
    """Return what separates the fields of a line: semicolons, tabs, commas, or white space (None)."""
    return next((mark for mark in ";\t," if mark in text), None)


def split(text: str, mark: str | None) -> list[str]:
    return [field.strip().strip('"') or "nan" for field in text.split(mark)]
