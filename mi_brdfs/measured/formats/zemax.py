"""Zemax .bsdf, the text tables of OpticStudio that goniometers and imaging spheres write."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..arrays import stacked
from ..coordinates import Coordinates, SpecularPolar, wrapped
from ..measurement import Axis, FileError, Grid, Measurement
from ..report.albedo import hemisphere
from ..rows import around
from ..source import Source
from ..text import TextFile, first_words, is_number, opening, shortened, whole

NAME = "Zemax"
DESCRIPTION = "text with the lines Symmetry, AngleOfIncidence, ScatterAzimuth, ScatterRadial, DataBegin"
WORDS = ("Source", "Symmetry", "SpectralContent", "ScatterType")
ANGLES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
CHANNELS = {
    "Monochrome": ["Monochrome"],
    "XYZ": ["TristimulusX", "TristimulusY", "TristimulusZ"],
    "RGB": ["Red", "Green", "Blue"],
}
"""The blocks of data that each SpectralContent has."""
XYZ_TO_SRGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""Linear sRGB of CIE XYZ (IEC 61966-2-1)."""
QUARTER = np.pi / 2
MOST_ANGLES = 4096
"""The most angles of a kind that a header is believed to mean."""


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(path)
    return is_table(lines) and not has_incidence_lines(lines)


def is_table(lines: list[str]) -> bool:
    """Return whether the first lines of a file are those of Zemax's or LightTools' tables."""
    return first_words(lines)[:1] in [[word.lower()] for word in (*WORDS, *ANGLES)]


def has_incidence_lines(lines: list[str]) -> bool:
    """Return whether the angle of incidence stands above each block of data, as in LightTools' tables."""
    return any(first_words([line])[:1] == ["aoi"] for line in lines)


def read(path: Path) -> Measurement:
    """Read a table in OpticStudio's tabular BSDF format (R. Rykowski, BSDF data interchange file format specification,
    Radiant Imaging and Zemax 2008).

    ScatterRadial is the angle from the mirror direction of the light, and ScatterAzimuth the angle about it,
    counter-clockwise from the side of the normal: just :class:`~mi_brdfs.measured.coordinates.SpecularPolar`.
    SampleRotation ψ is the angle from the normal of the plane of incidence, wi × n, to the x axis of the sample,
    counter-clockwise seen from above. So the light turns clockwise over the sample, and comes from φi = 90° - ψ.

    The grid reaches below the horizon, where files have 0: these count as missing. The TIS lines are kept as they are.
    They mean ∫ f cosθo dωo, but not every program that writes such files computes that.

    XYZ are taken as colours under D65, and become linear sRGB. A single channel has the wavelength that a comment on
    the light states, and an unknown one (NaN) if none does or several do.

    Raises:
        FileError: if the file holds no BRDF, or is not complete.
    """
    file = TextFile(path)
    rows = file.rows()
    header = Header.read(file, rows)
    angles = header.angles
    angles.setdefault("SampleRotation", np.zeros(1))
    content, symmetry = header.content(), header.symmetry(("PlaneSymmetrical", "ASymmetrical", "ASymmetrical4D"))
    values, stated = blocks(file, rows, CHANNELS[content], tuple(len(header.require(file, name)) for name in ANGLES))

    theta_i, i = ordered(header, "AngleOfIncidence", most=90)
    radial, r = ordered(header, "ScatterRadial", most=180)
    half = np.all((angles["ScatterAzimuth"] >= 0) & (angles["ScatterAzimuth"] <= 180))
    mirrored = bool(half) and not symmetry.startswith("ASym")
    azimuth, a = ordered(header, "ScatterAzimuth", most=180) if mirrored else turning(header, "ScatterAzimuth")
    phi_i, k = turning(header, "SampleRotation", start=90, sense=-1)
    axes: tuple[Axis, ...] = (theta_i, azimuth, radial, phi_i)
    values = np.moveaxis(values, (1, 2, 3, 0), (0, 1, 2, 3))[np.ix_(i, a, r, k)]
    stated = stated[np.ix_(k, i)][..., {"Monochrome": 0, "XYZ": 1, "RGB": 0}[content]]
    anisotropic = len(k) > 1
    if not anisotropic:
        axes, values = axes[:3], values[..., 0, :]
    coordinates = SpecularPolar(mirrored, anisotropic)
    values[unseen(coordinates, axes) & np.all(values == 0, axis=-1)] = np.nan
    if content == "XYZ":
        values = srgb_of(values)
    states = np.all(np.isfinite(stated)) and content != "RGB"
    return Measurement(
        path,
        NAME,
        Grid(coordinates, axes, values),
        np.array([header.wavelength]) if content == "Monochrome" else None,
        material=header.comment("sample", "model.*", "material"),
        stated_albedos=dict(zip(theta_i.nodes.tolist(), stated.T.tolist(), strict=True)) if states else {},
        notes=header.notes,
    )


def srgb_of(xyz: np.ndarray) -> np.ndarray:
    """Return linear sRGB, in which what is infinite or missing in XYZ is so, too."""
    with np.errstate(invalid="ignore", over="ignore"):
        return xyz @ XYZ_TO_SRGB.T


def unseen(coordinates: Coordinates, axes: tuple[Axis, ...]) -> np.ndarray:
    """Return which nodes of a grid lie below the horizon, or on it."""
    _, wo = coordinates.directions(*np.meshgrid(*(axis.nodes for axis in axes), indexing="ij"))
    return np.asarray(wo.z < 1e-9)


def write(path: Path, source: Source) -> None:
    """Write values for AngleOfIncidence 0 to 85°, ScatterAzimuth every 5° up to 180° and 54 ScatterRadial, which are
    dense about the mirror direction, with the TIS of each; for anisotropic sources, SampleRotation and ScatterAzimuth
    every 15° up to 360°. Directions below the horizon have 0. Colours are written as XYZ under D65, and greys and
    single wavelengths as Monochrome.

    Raises:
        OSError: if the file cannot be written.
    """
    if source.wavelengths is not None and len(source.wavelengths) > 1:
        source = source.rgb()
    turn = np.arange(0, 361, 15.0)
    angles = (
        turn if source.anisotropic else np.zeros(1),
        np.arange(0, 86, 5.0),
        turn if source.anisotropic else np.arange(0, 181, 5.0),
        np.concatenate([np.arange(0, 5, 0.5), np.arange(5, 10, 1.0), np.arange(10, 30, 2.5), np.arange(30, 181, 5.0)]),
    )
    rotations, theta_i, azimuths, radials = (np.radians(each) for each in angles)
    coordinates = SpecularPolar(mirrored=False, anisotropic=True)
    tables, stated = [], []
    for rotation in rotations:
        for theta in theta_i:
            phi_i = QUARTER - rotation
            wi, wo = map(stacked, coordinates.directions(theta, *np.meshgrid(azimuths, radials, indexing="ij"), phi_i))
            seen = wo[..., 2] > 1e-9
            around, solid_angle = hemisphere(theta, phi_i)
            each = np.concatenate([wo[seen], around])
            f = source.evaluate(np.broadcast_to(wi, each.shape), each)
            table = np.zeros((*seen.shape, f.shape[-1]))
            table[seen] = f[: -len(around)]
            tables.append(table)
            stated.append((solid_angle * around[:, 2]) @ f[-len(around) :])
    values, albedos = np.array(tables), np.array(stated)
    content = "XYZ" if np.any(np.ptp(values, axis=-1)) else "Monochrome"
    if content == "XYZ":
        values, albedos = (each @ np.linalg.inv(XYZ_TO_SRGB).T for each in (values, albedos))
    with path.open("w", encoding="utf-8") as file:
        if source.material:
            file.write(f"# Material: {' '.join(source.material.split())}\n")
        if source.wavelengths is not None and np.isfinite(source.wavelengths[0]):
            file.write(f"# Wavelength: {source.wavelengths[0]:g} nm\n")
        file.write(f"Source\tMeasured\nSymmetry\t{'ASymmetrical4D' if source.anisotropic else 'PlaneSymmetrical'}\n")
        file.write(f"SpectralContent\t{content}\nScatterType\tBRDF\n")
        for name, each in zip(ANGLES, angles, strict=True):
            file.write(f"{name}\t{len(each)}\n" + "\t".join(f"{angle:g}" for angle in each) + "\n")
        for k, channel in enumerate(CHANNELS[content]):
            file.write(f"\n{channel}\nDataBegin\n")
            for table, albedo in zip(values[..., k], albedos[:, k], strict=True):
                file.write(f"TIS\t{albedo:.6e}\n")
                file.writelines("\t".join(f"{value:.6e}" for value in row) + "\n" for row in table)
            file.write("DataEnd\n")


@dataclass
class Header:
    """What stands above the data."""

    path: Path
    settings: dict[str, str] = field(default_factory=dict)
    angles: dict[str, np.ndarray] = field(default_factory=dict)
    """In degrees, as in the file."""
    comments: list[str] = field(default_factory=list)

    @classmethod
    def read(cls, file: TextFile, rows: Iterator[list[str]]) -> Header:
        """Read up to the line DataBegin."""
        header = cls(file.path, comments=file.comments)
        for words in rows:
            word = next((name for name in (*WORDS, *ANGLES) if name.lower() == words[0].lower()), words[0])
            if word.lower() == "databegin":
                return header
            if word in ANGLES:
                header.angles[word] = announced(file, rows, words)
            elif word.isalpha():
                header.settings[word] = " ".join(words[1:])
            else:
                raise file.error(f"{shortened(words[0])} is no keyword of the header")
        raise file.error("the file ends before the line DataBegin")

    def require(self, file: TextFile, name: str) -> np.ndarray:
        if name not in self.angles:
            raise file.error(f"the data begin, but no {name} was given")
        return self.angles[name]

    def symmetry(self, known: tuple[str, ...]) -> str:
        return self._setting("Symmetry", known)

    def content(self) -> str:
        """Return the SpectralContent, having refused what is no BRDF."""
        self._setting("ScatterType", ("BRDF",))
        return self._setting("SpectralContent", tuple(CHANNELS))

    def _setting(self, name: str, known: tuple[str, ...]) -> str:
        given = self.settings.get(name, known[0])
        for word in known:
            if word.lower() == given.lower():
                return word
        raise FileError(f"{self.path}: its {name} is {shortened(given)}; only {', '.join(known)} can be read.")

    @property
    def wavelength(self) -> float:
        """The wavelength in nm that the comments on the light state, NaN if there is not just one."""
        lights = [text for text in self.comments if re.search(r"(?i)wave|light|laser|led\b|hene|source|lambda|λ", text)]
        found = set()
        for number, unit in re.findall(r"(?<!\d)(\d{1,9}(?:\.\d{1,9})?)\s?(nm|µm|μm|um)\b", "\n".join(lights)):
            found.add(round(float(number) * (1 if unit == "nm" else 1000), 6))
        return found.pop() if len(found) == 1 else np.nan

    def comment(self, *names: str) -> str:
        """Return what a comment ``name: …`` says, of the first of the names that has one."""
        for name in names:
            for text in self.comments:
                if match := re.match(rf"(?i){name}\s*:\s*(\S.*)", text):
                    return match.group(1)
        return ""

    @property
    def notes(self) -> dict[str, str]:
        pairs = [(name.rstrip(), said.strip()) for name, _, said in (text.partition(":") for text in self.comments)]
        return {name: said for name, said in pairs if said and re.fullmatch(r"[A-Z][\w ()#']*", name)}


def ordered(header: Header, name: str, most: float) -> tuple[Axis, np.ndarray]:
    """Return angles of a header, which are in degrees, as an increasing axis, and where its nodes are in the file."""
    angles = header.angles[name]
    if not np.all((angles >= 0) & (angles <= most)):
        raise FileError(f"{header.path}: {name} must lie between 0 and {most} degrees.")
    if len(np.unique(angles)) < len(angles):
        raise FileError(f"{header.path}: {name} lists an angle twice.")
    order = np.argsort(angles)
    return Axis(np.radians(angles[order])), order


def turning(header: Header, name: str, start: float = 0, sense: int = 1) -> tuple[Axis, np.ndarray]:
    """Return the same as an axis that goes round, if the angles do. Of angles that a turn makes equal, as 0 and 360,
    the first counts."""
    angles = header.angles[name]
    if not np.all(np.isfinite(angles)):
        raise FileError(f"{header.path}: {name} must be numbers.")
    nodes, order = np.unique(np.round(wrapped(start + sense * angles, 360.0), 6), return_index=True)
    return around(np.radians(nodes)), order


def announced(file: TextFile, rows: Iterator[list[str]], words: list[str]) -> np.ndarray:
    """Read ``name count`` and as many angles, from this line and those that follow."""
    name, line = words[0], file.line
    count = whole(words[1]) if len(words) > 1 else 0
    if not 0 < count <= MOST_ANGLES:
        raise file.error(f"{name} must be followed by the number of its angles, from 1 to {MOST_ANGLES}")
    rows = itertools.chain([words[2:]], rows)
    return file.list_of(rows, count, f"angles of {name}", f"an angle: {count} of {name} were announced in line {line}")


def blocks(
    file: TextFile, rows: Iterator[list[str]], channels: list[str], shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Read the data: for each channel, rotation and incidence a line ``TIS number``, which may be missing, and values.
    Return these, shape (\\*shape, channels), and the stated TIS, shape (rotations, incidences, channels)."""
    size, block = int(np.prod(shape)), int(np.prod(shape[2:]))
    file.expect(size * len(channels), "values")
    values, stated = np.empty((len(channels), size)), np.full((len(channels), size // block), np.nan)
    filled, channel, names = [0] * len(channels), 0, [name.lower() for name in channels]
    for words in rows:
        word = words[0].lower()
        if word in names:
            channel = names.index(word)
        elif word == "tis":
            index, rest = divmod(filled[channel], block)
            if rest or index == stated.shape[1]:
                raise file.error(f"TIS stands after {rest} values of a block, which has {block}")
            stated[channel, index] = float(words[1]) if len(words) > 1 and is_number(words[1]) else np.nan
        elif word not in ("databegin", "dataend"):
            row = file.numbers(words, "a value")
            end = filled[channel] + len(row)
            if end > size:
                raise file.error(f"there are more than the {size} values that the header announces")
            values[channel, filled[channel] : end] = row
            filled[channel] = end
    for name, count in zip(channels, filled, strict=True):
        if count < size:
            raise file.error(f"the file ends after {count} of {size} values of {name}")
    return np.moveaxis(values.reshape(-1, *shape), 0, -1), np.moveaxis(stated.reshape(-1, *shape[:2]), 0, -1)
