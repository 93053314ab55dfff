"""LightTools .bsdf: like Zemax's, but with directions from the normal, and a head above each block of data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..coordinates import Spherical
from ..measurement import FileError, Grid, Measurement
from ..text import TextFile, is_number, opening, shortened
from .zemax import Header, has_incidence_lines, is_table, ordered, srgb_of, turning

NAME = "LightTools"
DESCRIPTION = "as Zemax, with the lines AOI, POI, Side above each block of data"
TRISTIMULUS = ("trisx", "trisy", "trisz")


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(path)
    return is_table(lines) and has_incidence_lines(lines)


def read(path: Path) -> Measurement:
    """Read a table as LightTools has them.

    ScatterRadial is the angle from the normal, and ScatterAzimuth the angle about it, in which the light comes from
    90°: Δφ = ScatterAzimuth - 90°, in both as Kimura Ryo's libbsdf reads them. Only the BRDF of the front side is read,
    for one plane of incidence (POI); blocks of several wavelengths become channels, and XYZ become linear sRGB.

    Raises:
        FileError: if the file has no such BRDF, or not all of it.
    """
    file = TextFile(path)
    rows = file.rows()
    header = Header.read(file, rows)
    content = header.content()
    symmetry = header.symmetry(("PlaneSymmetrical", "Asymmetric", "Asymmetrical"))
    radials, azimuths = (header.require(file, name) for name in ("ScatterRadial", "ScatterAzimuth"))
    found = list(blocks(file, rows, len(radials) * len(azimuths)))
    front = [block for block in found if block.side == "front" and block.scatter == "brdf"]
    if not front:
        raise FileError(f"{path} has no block with Side Front and ScatterType BRDF.")
    if len({block.plane for block in front}) > 1:
        raise FileError(f"{path} has several planes of incidence (POI); only tables of one can be read.")
    channels = sorted({block.channel for block in front})
    if content != "Monochrome" and [tristimulus for tristimulus, _ in channels] != [0, 1, 2]:
        raise FileError(f"{path}: its SpectralContent needs the blocks TrisX, TrisY and TrisZ.")
    header.angles["AOI"] = np.unique([block.incidence for block in front])
    table = {(block.incidence, block.channel): block for block in front}
    if len(table) < len(front) or len(table) < len(header.angles["AOI"]) * len(channels):
        raise FileError(f"{path}: not every AOI has just one block for each wavelength or tristimulus value.")
    (theta_i, i), (theta_o, o) = ordered(header, "AOI", most=90), ordered(header, "ScatterRadial", most=90)

    turned = (azimuths + 90) % 360 - 180  # Δφ in [-180°, 180°)
    one_side = np.all(turned <= 0) or np.all((turned >= 0) | (turned == -180))
    mirrored = bool(one_side) and symmetry == "PlaneSymmetrical"
    header.angles["ScatterAzimuth"] = abs(turned) if mirrored else turned
    delta, d = ordered(header, "ScatterAzimuth", most=180) if mirrored else turning(header, "ScatterAzimuth")

    each = [[table[incidence, channel].values for channel in channels] for incidence in header.angles["AOI"]]
    values = np.array(each).reshape(len(each), len(channels), len(azimuths), len(radials)).transpose(0, 3, 2, 1)
    values = values[np.ix_(i, o, d)]
    luminance = channels[1 if content == "XYZ" else 0]
    stated = [table[incidence, luminance].tis for incidence in header.angles["AOI"]]
    wavelengths = np.array([wavelength or np.nan for _, wavelength in channels])
    if content == "XYZ":
        values = srgb_of(values)
    return Measurement(
        path,
        NAME,
        Grid(Spherical(mirrored), (theta_i, theta_o, delta), values),
        None if content == "XYZ" else np.where(np.isnan(wavelengths), header.wavelength, wavelengths),
        material=header.comment("sample", "model.*", "material"),
        stated_albedos={
            float(theta): [tis] for theta, tis in zip(theta_i.nodes, stated, strict=True) if np.isfinite(tis)
        },
        notes=header.notes,
    )


@dataclass(frozen=True)
class Block:
    """The values for one angle of incidence and channel."""

    incidence: float
    plane: float
    side: str
    scatter: str
    channel: tuple[int, float]
    """The tristimulus value, 0 to 2, and the wavelength in nm, 0 where there is none."""
    tis: float
    values: np.ndarray


KEYWORDS = ("aoi", "poi", "side", "scattertype", "tristimulusvalue", "wavelength", "tis")


def blocks(file: TextFile, rows: Iterator[list[str]], size: int) -> Iterator[Block]:
    """Read the blocks: lines ``keyword value``, of which a block repeats what has changed, and ``size`` values."""
    file.expect(size, "values in a block")
    head: dict[str, str] = {}
    values, filled = np.empty(size), 0
    for words in rows:
        word = words[0].lower()
        if word in ("databegin", "dataend", "monochrome"):
            continue
        if word[0].isalpha() and not is_number(word):
            if filled:
                raise file.error(f"{shortened(words[0])} stands after {filled} values of a block, which has {size}")
            if word not in KEYWORDS or len(words) < 2:
                raise file.error(f"{shortened(' '.join(words))} is no keyword of a block with its value")
            head[word] = words[1].lower()
            continue
        row = file.numbers(words, "a value")
        if filled + len(row) > size:
            raise file.error(f"there are more than the {size} values of a block")
        values[filled : filled + len(row)] = row
        filled += len(row)
        if filled == size:
            incidence, plane, wavelength = (number(file, head, name, "0") for name in ("aoi", "poi", "wavelength"))
            tristimulus = head.get("tristimulusvalue", TRISTIMULUS[0])
            if tristimulus not in TRISTIMULUS:
                raise file.error(f"TristimulusValue {shortened(tristimulus)} is none of TrisX, TrisY and TrisZ")
            yield Block(
                incidence,
                plane,
                head.get("side", "front"),
                head.get("scattertype", "brdf"),
                (TRISTIMULUS.index(tristimulus), wavelength),
                number(file, head, "tis", "nan"),
                values,
            )
            head.pop("tis", None)
            values, filled = np.empty(size), 0
    if filled:
        raise file.error(f"the file ends after {filled} of {size} values of a block")


def number(file: TextFile, head: dict[str, str], name: str, default: str) -> float:
    return float(file.numbers([head.get(name, default)], f"the number of {name.upper()}")[0])
