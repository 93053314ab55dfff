"""Text data of the ALTA library: rows in one of its parametrisations of pairs of directions."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Literal

import numpy as np

from ..arrays import vector
from ..coordinates import HalfDifference, SpecularPolar, polar_angle, spherical
from ..files import FileError, TextFile, opening, shortened, whole
from ..measurement import Measurement, Quantity
from ..rows import SAME, measured
from .tabular import srgb_of

NAME = "ALTA"
DESCRIPTION = "text with the lines #DIM, #PARAM_IN and #PARAM_OUT"
OUTPUTS: dict[str, Literal["f", "f cos"] | None] = {
    "INV_STERADIAN": "f", "INV_STERADIAN_COSINE_FACTOR": "f cos", "RGB_COLOR": None, "XYZ_COLOR": None,
    "UNKNOWN": None, "UNKNOWN_OUTPUT": None,
}  # fmt: skip
"""ALTA's names of what a BRDF's columns can hold, None where they leave the cosine open."""
KEYWORDS = ("DIM", "PARAM_IN", "PARAM_OUT", "VS", "TYPE", "FORMAT")
Pair = tuple[SimpleNamespace, SimpleNamespace]


def recognizes(path: Path, head: bytes) -> bool:
    return any(line.startswith(("#dim ", "#dim\t", "#param_in", "#alta ")) for line in opening(head))


def read(path: Path, quantity: Quantity) -> Measurement:
    """Read rows of input and output columns (L. Belcour, P. Barla, R. Pacanowski, ALTA: a BRDF analysis library,
    Eurographics Workshop on Material Appearance Modeling 2014, doi:10.2312/mam.20141298). The light L is wi, and the
    view V is wo; both point away from the surface, and Δφ = 0 is where they coincide. Columns of uncertainty (#VS) are
    left out, and so are rows below the horizon, which grids of half and difference angles have.
    ``INV_STERADIAN_COSINE_FACTOR`` is divided by cosθo. Files without #PARAM_OUT are, for ALTA, of an unknown output:
    ``quantity`` says what they hold. Colours are taken as f if it does not.

    Raises:
        FileError: if the file is no text, not complete, of a fitted function, or in a parametrisation in which no BRDF
            is known everywhere, as along a cut, or if nothing says what it holds.
    """
    file = TextFile(path)
    rows = file.rows()
    first = next(rows, [])
    settings, notes = _header(file)
    name, output, outputs = _stated(path, settings, quantity)
    inputs, directions, anisotropic = PARAMETRISATIONS[name]
    uncertain = any(word not in ("0", "0.0") for word in settings.get("VS", []))
    what = f"{inputs} of #PARAM_IN and {outputs} of #PARAM_OUT"
    table = file.table(itertools.chain([first], rows), inputs + outputs, what, more=uncertain)
    with np.errstate(invalid="ignore"):
        light, view = directions(*table[:, :inputs].T)
    unknown = np.isnan(sum(w.x + w.y + w.z for w in (light, view)))
    if np.any(unknown):
        raise file.error(
            "a coordinate is infinite or missing, or a direction is the zero vector",
            file.row_lines[int(np.argmax(unknown))],
        )
    if name.startswith("RUSIN"):  # whose grids reach below the horizon
        table = _above_horizon(path, table, np.minimum(light.z, view.z))
        light, view = directions(*table[:, :inputs].T)
    if name == SPHERICAL:  # whose azimuths count at the normal, too, where they fill a grid
        theta_i, phi_i, theta_o, phi_o = table[:, :inputs].T.copy()
    else:
        theta_i, theta_o = polar_angle(light), polar_angle(view)
        phi_i, phi_o = (np.arctan2(w.y, w.x) for w in (light, view))
    if not anisotropic:
        phi_i, phi_o = 0 * phi_i, phi_o - phi_i
    values = srgb_of(table[:, inputs:]) if output == "XYZ_COLOR" else table[:, inputs:].copy()
    del light, view, table
    said = {
        "quantity": OUTPUTS[output] or ("f" if quantity == "stated" else quantity),
        "material": notes.get("sample"),
        "notes": notes,
    }
    wavelengths = np.array([np.nan]) if outputs == 1 else None
    return measured(file, NAME, (theta_i, phi_i, theta_o, phi_o), values, wavelengths, **said)


def _header(file: TextFile) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Return the words of ALTA's own comments, and what others note."""
    settings: dict[str, list[str]] = {}
    notes: dict[str, str] = {}
    for name, *words in (comment.split() for comment in file.comments):
        if name.upper() in KEYWORDS:
            settings[name.upper()] = words
        elif words and name.isupper() and name != "ALTA":
            notes[name.lower()] = " ".join(words).strip('"')
    return settings, notes


def _stated(path: Path, settings: dict[str, list[str]], quantity: Quantity) -> tuple[str, str, int]:
    """Return the parametrisation, what the values are, and how many columns they have. Raise a FileError where they
    cannot be read as a BRDF."""
    if settings.get("TYPE", ["data"])[0].lower() == "function" or settings.get("FORMAT", ["text"])[0].lower() != "text":
        raise FileError(f"{path} holds a fitted function or binary data of ALTA; only its text data can be read.")
    name, output = ((settings.get(key) or ["UNKNOWN"])[0].upper() for key in ("PARAM_IN", "PARAM_OUT"))
    if name not in PARAMETRISATIONS:
        known = ", ".join(PARAMETRISATIONS)
        raise FileError(f"{path}: {shortened(name)} is not known; known are {known}.")
    if output not in OUTPUTS:
        raise FileError(f"{path}: its output {shortened(output)} is no BRDF (#PARAM_OUT INV_STERADIAN or RGB_COLOR).")
    if output.startswith("UNKNOWN") and quantity == "stated":
        raise FileError(
            f'{path} does not say what it holds: give the quantity, "f" or "f cos", or add a line #PARAM_OUT with '
            "INV_STERADIAN or INV_STERADIAN_COSINE_FACTOR."
        )
    needed = PARAMETRISATIONS[name][0]
    inputs, outputs = (whole(word) for word in (*settings.get("DIM", []), "", "")[:2])
    if inputs != needed or outputs not in ((3,) if "COLOR" in output else (1, 3)):
        raise FileError(
            f"{path}: its line #DIM has {inputs} and {outputs} columns; of {name} {needed} can be read, and of values "
            "3 in rgb or XYZ, or a single one, as their wavelengths are not known."
        )
    return name, output, outputs


def _above_horizon(path: Path, table: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return the rows whose lower direction, of that cosine, is above the horizon, with a warning if others are not."""
    above = cosine > -SAME
    if not np.any(above):
        raise FileError(f"{path}: no row has both directions above the horizon.")
    if below := int(np.sum(~above)):
        warnings.warn(f"{path}: rows of directions below the horizon are left out: {below:,}.", stacklevel=2)
    return table[above]


def projected(theta_l: np.ndarray, x: np.ndarray, y: np.ndarray) -> Pair:
    return spherical(theta_l, 0 * x), spherical(np.hypot(x, y), np.arctan2(y, x))


def retro(theta_l: np.ndarray, x: np.ndarray, y: np.ndarray) -> Pair:
    """V in polar coordinates about L with azimuth 0 towards the normal: those about the mirror direction, mirrored."""
    light, about = SpecularPolar(mirrored=False).directions(theta_l, np.arctan2(y, x), np.hypot(x, y))
    return light, vector(-about.x, about.y, about.z)


def half(theta_h: np.ndarray, phi_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> Pair:
    """The difference vector is V's."""
    view, light = HalfDifference(anisotropic=True).directions(np.sqrt(theta_h * (2 / np.pi)), theta_d, phi_d, phi_h)
    return light, view


def cartesian(*v: np.ndarray) -> Pair:
    def unit(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> SimpleNamespace:
        length = np.hypot(np.hypot(x, y), z)
        return vector(x / length, y / length, z / length)

    return unit(*v[3:]), unit(*v[:3])


SPHERICAL = "SPHERICAL_TL_PL_TV_PV"
PARAMETRISATIONS: dict[str, tuple[int, Callable[..., Pair], bool]] = {
    SPHERICAL: (4, lambda tl, pl, tv, pv: (spherical(tl, pl), spherical(tv, pv)), True),
    "ISOTROPIC_TV_TL_DPHI": (3, lambda tv, tl, phi: (spherical(tl, phi), spherical(tv, 0 * phi)), False),
    "ISOTROPIC_TL_TV_PROJ_DPHI": (3, projected, False),
    "RETRO_TL_TVL_PROJ_DPHI": (3, retro, False),
    "RUSIN_TH_TD_PD": (3, lambda th, td, pd: half(th, 0 * th, td, pd), False),
    "RUSIN_TH_PH_TD_PD": (4, half, True),
    "CARTESIAN": (6, cartesian, True),
}
"""ALTA's names: how many columns they have, ``(L, V)`` of these, and whether f depends on the azimuth of both."""
