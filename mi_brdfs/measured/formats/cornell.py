"""Cornell .brdf, the spectral goniometer measurements of the Program of Computer Graphics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..files import TextFile, first_words, is_number, opening, whole
from ..measurement import Measurement
from ..rows import measured

NAME = "Cornell"
DESCRIPTION = "text: the number of wavelengths, these in nm, then rows of θi, φi, θo, φo and a spectrum"


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(head)
    words = first_words(lines)
    named = path.suffix.lower() == ".brdf" or any("num wls" in line for line in lines)
    return named and len(words) == 1 and is_number(words[0])


def read(path: Path) -> Measurement:
    """Read rows of angles in radians, the mirror direction being at φo = φi + π, and f in 1/sr at each wavelength
    (S. C. Foo, A gonioreflectometer for measuring the bidirectional reflectance of material for use in illumination
    computation, Cornell University 1997).

    Raises:
        FileError: if the file is not complete, or has other columns.
    """
    file = TextFile(path)
    rows = file.rows()
    first = next(rows, [""])
    count = whole(first[0])
    if len(first) != 1 or not count:
        raise file.error("the number of wavelengths should stand alone")
    wavelengths = file.list_of(rows, count, "wavelengths", "a wavelength")
    if not np.all(np.diff(wavelengths) > 0) or not wavelengths[0] > 0:
        raise file.error(f"there should be {count} growing wavelengths")
    end = next((k for k, comment in enumerate(file.comments) if "wl" in comment.lower()), 0)
    material = " ".join(comment for comment in file.comments[:end] if "university" not in comment.lower())
    table = file.table(rows, 4 + count, f"four angles and {count} values")
    return measured(file, NAME, table[:, :4].T, table[:, 4:], wavelengths, material=material)
