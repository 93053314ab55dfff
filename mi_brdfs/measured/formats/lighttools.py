"""LightTools .bsdf: like Zemax's, but with directions from the normal, and a head above each block of data."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..coordinates import Spherical
from ..files import FileError, opening
from ..grid import Grid
from ..measurement import Measurement
from .tabular import Table, has_incidence_lines, is_table, srgb_of

NAME = "LightTools"
DESCRIPTION = "as Zemax, with the lines AOI, POI, Side above each block of data"
TRISTIMULUS = ["trisx", "trisy", "trisz"]
Channel = tuple[str, float]
"""The tristimulus value, and the wavelength in nm, 0 where there is none."""


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(head)
    return is_table(lines) and has_incidence_lines(lines)


def read(path: Path) -> Measurement:
    """Read a table as LightTools has them.

    ScatterRadial is the angle from the normal, and ScatterAzimuth the angle about it, in which the light comes from
    90°: Δφ = ScatterAzimuth - 90°, in both as Kimura Ryo's libbsdf reads them. Only the BRDF of the front side is read,
    for one plane of incidence (POI); blocks of several wavelengths become channels, and XYZ become linear sRGB.

    Raises:
        FileError: if the file has no such BRDF, or not all of it.
    """
    file = Table(path)
    content = file.setting("SpectralContent", "Monochrome", "XYZ")
    symmetry = file.setting("Symmetry", "PlaneSymmetrical", "Asymmetric", "Asymmetrical")
    radials, azimuths = (file.require(name) for name in ("ScatterRadial", "ScatterAzimuth"))
    table = _front(file, len(radials) * len(azimuths))
    channels = sorted({channel for _, channel in table})
    if content != "Monochrome" and [tristimulus for tristimulus, _ in channels] != TRISTIMULUS:
        raise FileError(f"{path}: its SpectralContent needs the blocks TrisX, TrisY and TrisZ.")
    incidences = file.angles["AOI"] = np.unique([incidence for incidence, _ in table])
    if len(table) < len(incidences) * len(channels):
        raise FileError(f"{path}: not every AOI has a block for each wavelength or tristimulus value.")
    (theta_i, i), (theta_o, o) = file.ordered("AOI", most=90), file.ordered("ScatterRadial", most=90)

    turned = (azimuths + 90) % 360 - 180  # Δφ in [-180°, 180°)
    one_side = np.all(turned <= 0) or np.all((turned >= 0) | (turned == -180))
    mirrored = bool(one_side) and symmetry == "PlaneSymmetrical"
    file.angles["ScatterAzimuth"] = abs(turned) if mirrored else turned
    delta, d = file.ordered("ScatterAzimuth", most=180) if mirrored else file.turning("ScatterAzimuth")

    found = np.array([[table[incidence, channel][0] for channel in channels] for incidence in incidences])
    found = found.reshape(*found.shape[:2], len(azimuths), len(radials)).transpose(0, 3, 2, 1)[np.ix_(i, o, d)]
    luminance = channels[1 if content == "XYZ" else 0]
    stated = [table[incidence, luminance][1] for incidence in incidences]
    wavelengths = np.array([wavelength or np.nan for _, wavelength in channels])
    return Measurement(
        path,
        NAME,
        Grid(Spherical(mirrored), (theta_i, theta_o, delta), srgb_of(found) if content == "XYZ" else found),
        None if content == "XYZ" else np.where(np.isnan(wavelengths), file.wavelength, wavelengths),
        material=file.material,
        stated_albedos={
            float(theta): [tis] for theta, tis in zip(theta_i.nodes, stated, strict=True) if np.isfinite(tis)
        },
        notes=file.notes,
    )


def _front(file: Table, size: int) -> dict[tuple[float, Channel], tuple[np.ndarray, float]]:
    """Return the blocks of the front side and their TIS, by the angle of incidence and the channel."""
    table: dict[tuple[float, Channel], tuple[np.ndarray, float]] = {}
    planes = set()
    for head, values in file.blocks(size):
        if head.get("side", "front") != "front" or head.get("scattertype", "brdf") != "brdf":
            continue
        incidence, plane, wavelength = (
            file.numbers([head.get(name, "0")], f"the number of {name.upper()}")[0]
            for name in ("aoi", "poi", "wavelength")
        )
        planes.add(plane)
        key = incidence, (head.get("tristimulusvalue", ""), wavelength)
        if key in table:
            raise file.error(f"a second block has the AOI {incidence:g} and the same wavelength or tristimulus value")
        table[key] = values, head["tis"]
    if not table:
        raise FileError(f"{file.path} has no block with Side Front and ScatterType BRDF.")
    if len(planes) > 1:
        raise FileError(f"{file.path} has several planes of incidence (POI); only tables of one can be read.")
    return table
