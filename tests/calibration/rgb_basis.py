"""Three spectra for linear sRGB values in spectral variants: non-negative, of sum 1, of exactly the primaries' colours
under D65, and as smooth as these allow (the least squared differences of neighbours).

    python tests/calibration/rgb_basis.py [--check]

Writes mi_brdfs/tabulated/basis.txt; with --check, exits with 1 if that is not what it would write.

I. Mallett and C. Yuksel, Spectral primary decomposition for rendering with sRGB reflectance, Eurographics Symposium on
Rendering 2019, doi:10.2312/sr.20191216, pose the problem.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from harness import parser
from scipy.optimize import nnls

from mi_brdfs.observer import to_srgb

FILE = Path(__file__).parents[2] / "mi_brdfs" / "tabulated" / "basis.txt"
WAVELENGTHS = np.arange(360, 831, 10)
DIGITS = 5


def basis() -> np.ndarray:
    """Return the spectra of red, green and blue, shape (3, wavelengths)."""
    count = len(WAVELENGTHS)
    weights = to_srgb(WAVELENGTHS)
    differences = np.diff(np.eye(count), axis=0)
    exact = 3e3  # by how much a constraint outweighs a difference
    rows = [
        np.kron(np.eye(3), differences),
        exact * 10 * np.kron(np.eye(3), weights.T),
        exact * np.hstack([np.eye(count)] * 3),
    ]
    sides = [np.zeros(3 * (count - 1)), exact * 10 * np.eye(3).ravel(), np.full(count, exact)]
    solution, _ = nnls(np.vstack(rows), np.concatenate(sides), maxiter=20000)
    rounded = np.round(solution.reshape(3, count), DIGITS)
    largest = rounded.argmax(axis=0), np.arange(count)
    rounded[largest] += 1 - rounded.sum(axis=0)
    return np.round(rounded, DIGITS)


def table() -> str:
    rows = (f"{nm} " + " ".join(f"{x:.{DIGITS}f}" for x in row) for nm, row in zip(WAVELENGTHS, basis().T, strict=True))
    return "\n".join(["# nm, red, green, blue", *rows]) + "\n"


if __name__ == "__main__":
    if parser(__doc__).parse_args().check:
        sys.exit(0 if FILE.read_text() == table() else f"{FILE.name} is not what this script writes.")
    FILE.write_text(table())
