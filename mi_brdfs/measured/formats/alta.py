"""Text data of the ALTA library: rows in one of its parametrisations of pairs of directions."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Literal

import numpy as np

from ..arrays import vector
from ..coordinates import HalfDifference, polar_angle, spherical
from ..measurement import FileError, Measurement, Quantity
from ..rows import arranged, checked_angles, without_cosine
from ..text import TextFile, opening, shortened, whole
from .zemax import srgb_of

NAME = "ALTA"
DESCRIPTION = "text with the lines #DIM, #PARAM_IN and #PARAM_OUT"
OUTPUTS: dict[str, Literal["f", "f cos"] | None] = {
    "INV_STERADIAN": "f", "INV_STERADIAN_COSINE_FACTOR": "f cos", "RGB_COLOR": None, "XYZ_COLOR": None,
    "UNKNOWN_OUTPUT": None,
}  # fmt: skip
"""ALTA's names of what a BRDF's columns can hold, None where they leave the cosine open."""
KEYWORDS = ("DIM", "PARAM_IN", "PARAM_OUT", "VS", "TYPE", "FORMAT")
Pair = tuple[SimpleNamespace, SimpleNamespace]


def recognizes(path: Path, head: bytes) -> bool:
    return any(line.startswith(("#dim ", "#dim\t", "#param_in", "#alta ")) for line in opening(path))


def read(path: Path, quantity: Quantity) -> Measurement:
    """Read rows of input and output columns (L. Belcour, P. Barla, R. Pacanowski, ALTA: a BRDF analysis library,
    Eurographics Workshop on Material Appearance Modeling 2014, doi:10.2312/mam.20141298). The light L is wi, and the
    view V is wo; both point away from the surface, and Δφ = 0 is where they coincide. Columns of uncertainty (#VS) are
    left out. ``INV_STERADIAN_COSINE_FACTOR`` is divided by cosθo. Files without #PARAM_OUT are, for ALTA, of an unknown
    output: ``quantity`` says what they hold. Colours are taken as f if it does not.

    Raises:
        FileError: if the file is no text, not complete, of a fitted function, or in a parametrisation in which no BRDF
            is known everywhere, as along a cut, or if nothing says what it holds.
    """
    file = TextFile(path)
    rows = file.rows()
    first = next(rows, [])
    settings: dict[str, list[str]] = {}
    notes: dict[str, str] = {}
    for name, *words in (comment.split() for comment in file.comments):
        if name.upper() in KEYWORDS:
            settings[name.upper()] = words
        elif words and name.isupper() and name != "ALTA":
            notes[name.lower()] = " ".join(words).strip('"')
    if settings.get("TYPE", ["data"])[0].lower() == "function" or settings.get("FORMAT", ["text"])[0].lower() != "text":
        raise FileError(f"{path} holds a fitted function or binary data of ALTA; only its text data can be read.")
    inputs, outputs = dimensions(path, settings)
    directions, anisotropic = parametrisation(path, settings, inputs)
    output = (settings.get("PARAM_OUT") or ["UNKNOWN_OUTPUT"])[0].upper()
    if output not in OUTPUTS:
        raise FileError(f"{path}: its output {shortened(output)} is no BRDF (#PARAM_OUT INV_STERADIAN or RGB_COLOR).")
    if output == "UNKNOWN_OUTPUT" and quantity == "stated":
        raise FileError(
            f'{path} does not say what it holds: give the quantity, "f" or "f cos", or add a line #PARAM_OUT with '
            "INV_STERADIAN or INV_STERADIAN_COSINE_FACTOR."
        )
    if outputs not in (1, 3) or (outputs == 1 and "COLOR" in output):
        raise FileError(f"{path}: its #DIM has {outputs} outputs, but wavelengths are not known; 1 or 3 can be read.")
    uncertain = any(word not in ("0", "0.0") for word in settings.get("VS", []))
    what = f"{inputs} of #PARAM_IN and {outputs} of #PARAM_OUT"
    table = file.table(itertools.chain([first], rows), inputs + outputs, what, more=uncertain)
    known = np.all(np.isfinite(table[:, :inputs]), axis=1)
    if not np.all(known):
        raise file.error("a coordinate is infinite or missing", file.row_lines[int(np.argmin(known))])
    with np.errstate(invalid="ignore"):
        light, view = directions(*table[:, :inputs].T)
    if np.any(zero := np.isnan(light.z + view.z)):
        raise file.error("a direction is the zero vector", file.row_lines[int(np.argmax(zero))])
    theta_i, theta_o, phi_i, phi_o = (angle(w) for angle in (polar_angle, azimuth) for w in (light, view))
    if not anisotropic:
        phi_i, phi_o = 0 * phi_i, phi_o - phi_i
    checked_angles(file, (theta_i, theta_o), (phi_i, phi_o))
    values = table[:, inputs:].copy()
    del light, view, table
    held = OUTPUTS[output] or ("f" if quantity == "stated" else quantity)
    if held == "f cos":
        values = without_cosine(values, np.cos(theta_o))
    if output == "XYZ_COLOR":
        values = srgb_of(values)
    return Measurement(
        path,
        NAME,
        arranged(theta_i, phi_i, theta_o, phi_o, values),
        np.array([np.nan]) if outputs == 1 else None,
        material=notes.get("sample", path.stem),
        quantity=held,
        notes=notes,
    )


def dimensions(path: Path, settings: dict[str, list[str]]) -> tuple[int, int]:
    words = settings.get("DIM", [])
    inputs, outputs = (whole(word) for word in (*words, "", "")[:2])
    if not 0 < inputs < 1000 or not 0 < outputs < 1000:
        raise FileError(f"{path}: its line #DIM should have the numbers of input and of output columns.")
    return inputs, outputs


def parametrisation(path: Path, settings: dict[str, list[str]], inputs: int) -> tuple[Callable[..., Pair], bool]:
    """Return the function of the input columns that gives ``(L, V)``, and whether its BRDFs are anisotropic."""
    name = (settings.get("PARAM_IN") or ["UNKNOWN_INPUT"])[0].upper()
    if name not in PARAMETRISATIONS:
        if inputs < 3:
            raise FileError(
                f"{path}: {shortened(name)} has {inputs} of the at least 3 coordinates of a BRDF: its values are a cut."
            )
        raise FileError(f"{path}: {shortened(name)} is not known; known are {', '.join(PARAMETRISATIONS)}.")
    needed, directions, anisotropic = PARAMETRISATIONS[name]
    if inputs != needed:
        raise FileError(f"{path}: {name} has {needed} columns, but #DIM says {inputs}.")
    return directions, anisotropic


def projected(theta_l: np.ndarray, x: np.ndarray, y: np.ndarray) -> Pair:
    return spherical(theta_l, 0 * x), spherical(np.hypot(x, y), np.arctan2(y, x))


def retro(theta_l: np.ndarray, x: np.ndarray, y: np.ndarray) -> Pair:
    """V in polar coordinates about L, whose azimuth is 0 towards the normal."""
    about = spherical(np.hypot(x, y), np.arctan2(y, x))
    cos, sin = np.cos(theta_l), np.sin(theta_l)
    return spherical(theta_l, 0 * x), vector(about.z * sin - about.x * cos, about.y, about.z * cos + about.x * sin)


def azimuth(w: SimpleNamespace) -> np.ndarray:
    return np.arctan2(w.y, w.x)


def half(theta_h: np.ndarray, phi_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> Pair:
    """The difference vector is V's."""
    view, light = HalfDifference(anisotropic=True).directions(np.sqrt(theta_h * (2 / np.pi)), theta_d, phi_d, phi_h)
    return light, view


def cartesian(*v: np.ndarray) -> Pair:
    def unit(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> SimpleNamespace:
        length = np.hypot(np.hypot(x, y), z)
        return vector(x / length, y / length, z / length)

    return unit(*v[3:]), unit(*v[:3])


PARAMETRISATIONS: dict[str, tuple[int, Callable[..., Pair], bool]] = {
    "SPHERICAL_TL_PL_TV_PV": (4, lambda tl, pl, tv, pv: (spherical(tl, pl), spherical(tv, pv)), True),
    "ISOTROPIC_TV_TL_DPHI": (3, lambda tv, tl, phi: (spherical(tl, phi), spherical(tv, 0 * phi)), False),
    "ISOTROPIC_TL_TV_PROJ_DPHI": (3, projected, False),
    "RETRO_TL_TVL_PROJ_DPHI": (3, retro, False),
    "RUSIN_TH_TD_PD": (3, lambda th, td, pd: half(th, 0 * th, td, pd), False),
    "RUSIN_TH_PH_TD_PD": (4, half, True),
    "CARTESIAN": (6, cartesian, True),
}
"""ALTA's names: how many columns they have, ``(L, V)`` of these, and whether f depends on the azimuth of both."""
