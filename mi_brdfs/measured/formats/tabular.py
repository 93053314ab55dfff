"""What the text tables of Zemax and LightTools have in common: settings, lists of angles, and blocks of values."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...parameters.messages import listed
from ..coordinates import TWO_PI, wrapped
from ..files import FileError, TextFile, first_words, is_number, shortened, whole
from ..grid import Axis
from ..rows import sector_start

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
CHANNEL_NAMES = {name.lower(): name for names in CHANNELS.values() for name in names}
KEYWORDS = {"aoi", "poi", "side", "scattertype", "tristimulusvalue", "wavelength", "tis"}
"""What can stand above a block of data, in LightTools' files; in Zemax's only the last."""
LIGHT = re.compile(r"(?i)wave|light|laser|led\b|hene|source|lambda|λ")


def is_table(lines: list[str]) -> bool:
    """Return whether the first lines of a file are those of Zemax's or LightTools' tables."""
    return first_words(lines)[:1] in [[word.lower()] for word in (*WORDS, *ANGLES)]


def has_incidence_lines(lines: list[str]) -> bool:
    """Return whether the angle of incidence stands above each block of data, as in LightTools' tables."""
    return any(first_words([line])[:1] == ["aoi"] for line in lines)


def srgb_of(xyz: np.ndarray) -> np.ndarray:
    """Return linear sRGB, in which what is infinite or missing in XYZ is so, too."""
    with np.errstate(invalid="ignore", over="ignore"):
        return xyz @ XYZ_TO_SRGB.T


class Table(TextFile):
    """A file: what stands above its data, up to the line DataBegin, and the data. There are settings, angles in degrees
    as in the file, and comments; a FileError says that there is something else."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._rows = self.rows()
        self.settings: dict[str, str] = {}
        self.angles: dict[str, np.ndarray] = {}
        for words in self._rows:
            word = next((name for name in (*WORDS, *ANGLES) if name.lower() == words[0].lower()), words[0])
            if word.lower() == "databegin":
                self.setting("ScatterType", "BRDF")
                return
            if word in ANGLES:
                self.angles[word] = self._announced(word, words[1:])
            elif word.isalpha():
                self.settings[word] = " ".join(words[1:])
            else:
                raise self.error(f"{shortened(words[0])} is no keyword of the header")
        raise self.error("the file ends before the line DataBegin")

    def _announced(self, name: str, words: list[str]) -> np.ndarray:
        """Read ``count`` and as many angles, from this line and those that follow."""
        count = whole(words[0]) if words else 0
        if not count:
            raise self.error(f"{name} must be followed by the number of its angles")
        each = f"an angle: {count} of {name} were announced in line {self.line}"
        return self.list_of(itertools.chain([words[1:]], self._rows), count, f"angles of {name}", each)

    def require(self, name: str) -> np.ndarray:
        if name not in self.angles:
            raise self.error(f"the data begin, but no {name} was given")
        return self.angles[name]

    def setting(self, name: str, *known: str) -> str:
        given = self.settings.get(name, known[0])
        for word in known:
            if word.lower() == given.lower():
                return word
        problem = f"{self.path}: its {name} is {shortened(given)}, which cannot be read"
        raise FileError(f"{problem}; export it as {listed(known)}.")

    def ordered(self, name: str, most: float) -> tuple[Axis, np.ndarray]:
        """Return angles as an increasing axis in radians, and where its nodes are in the file."""
        angles = self.angles[name]
        order = np.argsort(angles)
        if not np.all((angles >= 0) & (angles <= most)) or np.any(np.diff(angles[order]) == 0):
            raise FileError(f"{self.path}: the angles of {name} must differ, and lie between 0 and {most} degrees.")
        return Axis(np.radians(angles[order])), order

    def turning(self, name: str, zero: float = 0, sense: int = 1) -> tuple[Axis, np.ndarray]:
        """Return the same as an axis that goes round, measured where the angles are. Of angles that a turn makes equal,
        as 0 and 360, the first counts."""
        angles = self.angles[name]
        if not np.all(np.isfinite(angles)):
            raise FileError(f"{self.path}: {name} must be numbers.")
        nodes, order = np.unique(np.round(wrapped(zero + sense * angles, 360.0), 6), return_index=True)
        nodes = np.radians(nodes)
        if (start := sector_start(nodes)) is None:
            return Axis(nodes, TWO_PI), order
        nodes = np.append(nodes[start:], nodes[:start] + TWO_PI)
        return Axis(nodes, TWO_PI, low=nodes[0], high=nodes[-1]), np.roll(order, -start)

    @property
    def wavelength(self) -> float:
        """The wavelength in nm that the comments on the light state, NaN if there is not just one."""
        lights = [text for text in self.comments if LIGHT.search(text)]
        found = set()
        for number, unit in re.findall(r"(?<!\d)(\d{1,9}(?:\.\d{1,9})?)\s?(nm|µm|μm|um)\b", "\n".join(lights)):
            found.add(round(float(number) * (1 if unit == "nm" else 1000), 6))
        return found.pop() if len(found) == 1 else np.nan

    @property
    def material(self) -> str:
        return self.stated("sample", "model[^:]*", "material")

    @property
    def notes(self) -> dict[str, str]:
        pairs = [(name.rstrip(), said.strip()) for name, _, said in (text.partition(":") for text in self.comments)]
        return {name: said for name, said in pairs if said and re.fullmatch(r"[A-Z][\w ()#']*", name)}

    def blocks(self, size: int) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
        """Yield the blocks of ``size`` values, behind what lines ``keyword value`` say of each, by keywords in small
        letters, and its number ``tis``, NaN if there is none."""
        head: dict[str, Any] = {"tis": np.nan, "channel": ""}
        values: list[float] = []
        for words in self._rows:
            word = words[0].lower()
            if word in CHANNEL_NAMES or word in KEYWORDS:
                if values:
                    raise self.error(
                        f"{shortened(words[0])} stands after {len(values)} values of a block, which has {size}"
                    )
                said = " ".join(words[1:2]).lower()
                head |= {"channel": CHANNEL_NAMES[word]} if word in CHANNEL_NAMES else {word: said}
                if word == "tis":
                    head["tis"] = float(said) if is_number(said) else np.nan
            elif word not in ("databegin", "dataend"):
                values += self.numbers(words, "a value, or a keyword of a block")
                whole_blocks = len(values) // size * size
                for start in range(0, whole_blocks, size):
                    yield dict(head), np.array(values[start : start + size])
                    head["tis"] = np.nan
                del values[:whole_blocks]
        if values:
            raise self.error(f"the file ends after {len(values)} of {size} values of a block")
