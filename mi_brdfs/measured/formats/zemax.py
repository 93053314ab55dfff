"""Zemax .bsdf, the text tables of OpticStudio that goniometers and imaging spheres write."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...parameters.messages import listed
from ..arrays import stacked
from ..axis import Axis
from ..coordinates import TWO_PI, SpecularPolar, wrapped
from ..files import FileError
from ..grid import Grid
from ..measurement import Measurement
from ..report.albedo import hemisphere
from ..rows import sector_start, warn_of_a_sector
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
CHANNEL_NAMES = {name.lower() for names in CHANNELS.values() for name in names}
KEYWORDS = {"aoi", "poi", "side", "scattertype", "tristimulusvalue", "wavelength", "tis"}
"""What can stand above a block of data, in LightTools' files; in Zemax's only the last."""
LIGHT = re.compile(r"(?i)wave|light|laser|led\b|hene|source|lambda|λ")


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(head)
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
    header = Header(file, rows)
    header.angles.setdefault("SampleRotation", np.zeros(1))
    content = header.content(*CHANNELS)
    symmetry = header.setting("Symmetry", "PlaneSymmetrical", "ASymmetrical", "ASymmetrical4D")
    shape = [len(header.require(name)) for name in ANGLES]
    count, channels = shape[0] * shape[1], [name.lower() for name in CHANNELS[content]]
    found: dict[str, list[tuple[np.ndarray, float]]] = {name: [] for name in channels}
    for head, block in blocks(file, rows, shape[2] * shape[3]):
        of = found[head["channel"] if head.get("channel") in found else channels[0]]
        of.append((block, head["tis"]))
        if len(of) > count:
            raise file.error(f"there are more than the {count} blocks of values that the header announces")
    for name, of in zip(CHANNELS[content], found.values(), strict=True):
        if len(of) < count:
            raise file.error(f"the file ends after {len(of)} of {count} blocks of {name}")
    values = np.array([[block for block, _ in found[name]] for name in channels]).reshape(-1, *shape)
    stated = np.array([tis for _, tis in found[channels[content == "XYZ"]]]).reshape(shape[:2])

    theta_i, i = header.ordered("AngleOfIncidence", most=90)
    radial, r = header.ordered("ScatterRadial", most=180)
    half = np.all((header.angles["ScatterAzimuth"] >= 0) & (header.angles["ScatterAzimuth"] <= 180))
    mirrored = bool(half) and not symmetry.startswith("ASym")
    azimuth, a = header.ordered("ScatterAzimuth", most=180) if mirrored else header.turning("ScatterAzimuth")
    phi_i, k = header.turning("SampleRotation", zero=90, sense=-1)
    axes: tuple[Axis, ...] = (theta_i, azimuth, radial, phi_i)
    values = values.transpose(2, 3, 4, 1, 0)[np.ix_(i, a, r, k)]
    anisotropic = len(k) > 1
    if anisotropic:
        warn_of_a_sector(np.sort(phi_i.nodes % TWO_PI))
    if not anisotropic:
        axes, values = axes[:3], values[..., 0, :]
    coordinates = SpecularPolar(mirrored, anisotropic)
    # What lies below the horizon or on it.
    _, wo = coordinates.directions(*np.meshgrid(*(axis.nodes for axis in axes), indexing="ij"))
    values[(wo.z < 1e-9) & np.all(values == 0, axis=-1)] = np.nan
    if content == "XYZ":
        values = srgb_of(values)
    states = np.all(np.isfinite(stated)) and content != "RGB"
    return Measurement(
        path,
        NAME,
        Grid(coordinates, axes, values),
        np.array([header.wavelength]) if content == "Monochrome" else None,
        material=header.material,
        stated_albedos=dict(zip(theta_i.nodes.tolist(), stated[np.ix_(k, i)].T.tolist(), strict=True))
        if states
        else {},
        notes=header.notes,
    )


def srgb_of(xyz: np.ndarray) -> np.ndarray:
    """Return linear sRGB, in which what is infinite or missing in XYZ is so, too."""
    with np.errstate(invalid="ignore", over="ignore"):
        return xyz @ XYZ_TO_SRGB.T


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
    channels = 3 if source.wavelengths is None else 1
    tables, stated = [], []
    for rotation, theta in itertools.product(rotations, theta_i):
        phi_i = np.pi / 2 - rotation
        wi, wo = map(stacked, coordinates.directions(theta, *np.meshgrid(azimuths, radials, indexing="ij"), phi_i))
        seen = wo[..., 2] > 1e-9
        every, solid_angle = hemisphere(theta, phi_i)
        table = np.zeros((*seen.shape, channels))
        table[seen] = source.evaluate(np.broadcast_to(wi, wo[seen].shape), wo[seen])
        tables.append(table)
        stated.append((solid_angle * every[:, 2]) @ source.evaluate(np.broadcast_to(wi, every.shape), every))
    values, albedos = np.array(tables), np.array(stated)
    content = "XYZ" if np.any(np.ptp(values, axis=-1)) else "Monochrome"
    if content == "XYZ":
        values, albedos = (each @ np.linalg.inv(XYZ_TO_SRGB).T for each in (values, albedos))
    with path.open("w", encoding="utf-8") as file:
        if source.material:
            file.write(f"# Material: {' '.join(source.material.split())}\n")
        if source.wavelengths is not None:
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


class Header:
    """What stands above the data, up to the line DataBegin: settings, angles in degrees as in the file, and comments. A
    FileError says that there is something else."""

    def __init__(self, file: TextFile, rows: Iterator[list[str]]) -> None:
        self.file = file
        self.settings: dict[str, str] = {}
        self.angles: dict[str, np.ndarray] = {}
        for words in rows:
            word = next((name for name in (*WORDS, *ANGLES) if name.lower() == words[0].lower()), words[0])
            if word.lower() == "databegin":
                return
            if word in ANGLES:
                self.angles[word] = self._announced(rows, word, words[1:])
            elif word.isalpha():
                self.settings[word] = " ".join(words[1:])
            else:
                raise file.error(f"{shortened(words[0])} is no keyword of the header")
        raise file.error("the file ends before the line DataBegin")

    def _announced(self, rows: Iterator[list[str]], name: str, words: list[str]) -> np.ndarray:
        """Read ``count`` and as many angles, from this line and those that follow."""
        count = whole(words[0]) if words else 0
        if not count:
            raise self.file.error(f"{name} must be followed by the number of its angles")
        each = f"an angle: {count} of {name} were announced in line {self.file.line}"
        return self.file.list_of(itertools.chain([words[1:]], rows), count, f"angles of {name}", each)

    def require(self, name: str) -> np.ndarray:
        if name not in self.angles:
            raise self.file.error(f"the data begin, but no {name} was given")
        return self.angles[name]

    def content(self, *known: str) -> str:
        """Return the SpectralContent, having refused what is no BRDF, and what is none of those that are known."""
        self.setting("ScatterType", "BRDF")
        return self.setting("SpectralContent", *known)

    def setting(self, name: str, *known: str) -> str:
        given = self.settings.get(name, known[0])
        for word in known:
            if word.lower() == given.lower():
                return word
        problem = f"{self.file.path}: its {name} is {shortened(given)}, which cannot be read"
        raise FileError(f"{problem}; export it as {listed(known)}.")

    def ordered(self, name: str, most: float) -> tuple[Axis, np.ndarray]:
        """Return angles as an increasing axis in radians, and where its nodes are in the file."""
        angles = self.angles[name]
        if not np.all((angles >= 0) & (angles <= most)):
            raise FileError(f"{self.file.path}: {name} must lie between 0 and {most} degrees.")
        if len(np.unique(angles)) < len(angles):
            raise FileError(f"{self.file.path}: {name} lists an angle twice.")
        order = np.argsort(angles)
        return Axis(np.radians(angles[order])), order

    def turning(self, name: str, zero: float = 0, sense: int = 1) -> tuple[Axis, np.ndarray]:
        """Return the same as an axis that goes round, measured where the angles are. Of angles that a turn makes equal,
        as 0 and 360, the first counts."""
        angles = self.angles[name]
        if not np.all(np.isfinite(angles)):
            raise FileError(f"{self.file.path}: {name} must be numbers.")
        nodes, order = np.unique(np.round(wrapped(zero + sense * angles, 360.0), 6), return_index=True)
        nodes = np.radians(nodes)
        if (start := sector_start(nodes)) is None:
            return Axis(nodes, TWO_PI), order
        nodes = np.append(nodes[start:], nodes[:start] + TWO_PI)
        return Axis(nodes, TWO_PI, low=nodes[0], high=nodes[-1]), np.roll(order, -start)

    @property
    def wavelength(self) -> float:
        """The wavelength in nm that the comments on the light state, NaN if there is not just one."""
        lights = [text for text in self.file.comments if LIGHT.search(text)]
        found = set()
        for number, unit in re.findall(r"(?<!\d)(\d{1,9}(?:\.\d{1,9})?)\s?(nm|µm|μm|um)\b", "\n".join(lights)):
            found.add(round(float(number) * (1 if unit == "nm" else 1000), 6))
        return found.pop() if len(found) == 1 else np.nan

    @property
    def material(self) -> str:
        return self.file.stated("sample", "model[^:]*", "material")

    @property
    def notes(self) -> dict[str, str]:
        pairs = [
            (name.rstrip(), said.strip()) for name, _, said in (text.partition(":") for text in self.file.comments)
        ]
        return {name: said for name, said in pairs if said and re.fullmatch(r"[A-Z][\w ()#']*", name)}


def blocks(file: TextFile, rows: Iterator[list[str]], size: int) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Read the data: blocks of ``size`` values, above which lines ``keyword value`` say what has changed. Yield what is
    said of a block, by keywords in small letters, with its number ``tis``, NaN if there is none, and its values."""
    head: dict[str, Any] = {"tis": np.nan}
    values: list[float] = []
    for words in rows:
        word = words[0].lower()
        if word in CHANNEL_NAMES or word in KEYWORDS:
            if values:
                raise file.error(
                    f"{shortened(words[0])} stands after {len(values)} values of a block, which has {size}"
                )
            said = " ".join(words[1:2]).lower()
            head |= {"channel": word} if word in CHANNEL_NAMES else {word: said}
            if word == "tis":
                head["tis"] = float(said) if is_number(said) else np.nan
        elif word not in ("databegin", "dataend"):
            values += file.numbers(words, "a value, or a keyword of a block").tolist()
            whole_blocks = len(values) // size * size
            for start in range(0, whole_blocks, size):
                yield dict(head), np.array(values[start : start + size])
                head["tis"] = np.nan
            del values[:whole_blocks]
    if values:
        raise file.error(f"the file ends after {len(values)} of {size} values of a block")
