"""Zemax .bsdf, the text tables of OpticStudio that goniometers and imaging spheres write."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from ..arrays import stacked
from ..coordinates import TWO_PI, SpecularPolar
from ..files import opening
from ..grid import Axis, Grid
from ..measurement import Measurement
from ..report.albedo import hemisphere
from ..rows import warn_of_a_sector
from ..source import Source
from .tabular import ANGLES, CHANNELS, XYZ_TO_SRGB, Table, has_incidence_lines, is_table, srgb_of

NAME = "Zemax"
DESCRIPTION = "text with the lines Symmetry, AngleOfIncidence, ScatterAzimuth, ScatterRadial, DataBegin"


def recognizes(path: Path, head: bytes) -> bool:
    lines = opening(head)
    return is_table(lines) and not has_incidence_lines(lines)


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
    file = Table(path)
    file.angles.setdefault("SampleRotation", np.zeros(1))
    content = file.setting("SpectralContent", *CHANNELS)
    symmetry = file.setting("Symmetry", "PlaneSymmetrical", "ASymmetrical", "ASymmetrical4D")
    shape = [len(file.require(name)) for name in ANGLES]
    count, channels = shape[0] * shape[1], CHANNELS[content]
    found: dict[str, list[tuple[np.ndarray, float]]] = {name: [] for name in channels}
    for head, block in file.blocks(shape[2] * shape[3]):
        found.get(head["channel"], found[channels[0]]).append((block, head["tis"]))
    for name, of in found.items():
        if len(of) != count:
            raise file.error(f"the file ends after {len(of)} blocks of {name}, but should have {count}")
    values = np.array([[block for block, _ in of] for of in found.values()]).reshape(-1, *shape)
    stated = np.array([tis for _, tis in found[channels[content == "XYZ"]]]).reshape(shape[:2])

    theta_i, i = file.ordered("AngleOfIncidence", most=90)
    radial, r = file.ordered("ScatterRadial", most=180)
    half = np.all((file.angles["ScatterAzimuth"] >= 0) & (file.angles["ScatterAzimuth"] <= 180))
    mirrored = bool(half) and not symmetry.startswith("ASym")
    azimuth, a = file.ordered("ScatterAzimuth", most=180) if mirrored else file.turning("ScatterAzimuth")
    phi_i, k = file.turning("SampleRotation", zero=90, sense=-1)
    axes: tuple[Axis, ...] = (theta_i, azimuth, radial, phi_i)
    values = values.transpose(2, 3, 4, 1, 0)[np.ix_(i, a, r, k)]
    anisotropic = len(k) > 1
    if anisotropic:
        warn_of_a_sector(np.sort(phi_i.nodes % TWO_PI))
    else:
        axes, values = axes[:3], values[..., 0, :]
    coordinates = SpecularPolar(mirrored, anisotropic)
    # What lies below the horizon or on it.
    _, wo = coordinates.directions(*np.meshgrid(*(axis.nodes for axis in axes), indexing="ij"))
    values[(wo.z < 1e-9) & np.all(values == 0, axis=-1)] = np.nan
    if content == "XYZ":
        values = srgb_of(values)
    albedos = stated[np.ix_(k, i)].T.tolist()
    states = np.all(np.isfinite(stated)) and content != "RGB"
    return Measurement(
        path,
        NAME,
        Grid(coordinates, axes, values),
        np.array([file.wavelength]) if content == "Monochrome" else None,
        material=file.material,
        stated_albedos=dict(zip(theta_i.nodes.tolist(), albedos, strict=True)) if states else {},
        notes=file.notes,
    )


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
