"""Write the textures of the scenes beside this file: ``python scenes/textures/make_textures.py``.

Angles are in turns, as `rotation` takes them. A brushed surface looks the same after half a turn.
"""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np

FOLDER = Path(__file__).parent
SIDE = 256


def textures() -> dict[str, np.ndarray]:
    """All images by file name: numbers in [0, 1] as uint8 or uint16 (height, width), colours as uint8 sRGB (…, 3)."""
    brushed = {"lathe": lathe(), "parquet": parquet(), "perlage": perlage()}
    return {f"brushed_{name}.png": _uint16(image) for name, image in brushed.items()} | {
        f"enamel_{name}.png": _uint8(image) for name, image in enamel().items()
    }


def lathe() -> np.ndarray:
    """Brushed in circles around the middle, as on a lathe."""
    x, y = _plane()
    return _around(x, y)


def parquet(cells: int = 4) -> np.ndarray:
    """Squares that are brushed along x and along y by turns."""
    x, y = _plane()
    return 0.25 * ((np.floor(x * cells) + np.floor(y * cells)) % 2)


def perlage(spots: int = 5) -> np.ndarray:
    """Overlapping spots, each brushed in circles, as on the plates of a watch movement."""
    x, y = _plane()
    angle = np.zeros_like(x)
    for row in range(-1, spots + 2):
        for column in range(-1, spots + 2):
            dx = x + 0.5 - (column + row % 2 / 2) / spots
            dy = y + 0.5 - row / spots
            angle = np.where(np.hypot(dx, dy) < 0.75 / spots, _around(dx, dy), angle)
    return angle


def enamel() -> dict[str, np.ndarray]:
    """The five parameters of `ward` for a globe of enamel in gold wires, between bands of brushed gold."""
    u, v = np.meshgrid((np.arange(4 * SIDE) + 0.5) / (4 * SIDE), (np.arange(2 * SIDE) + 0.5) / (2 * SIDE))
    row = np.floor(8 * v)
    cap, belt = np.isin(row, (0, 7)), np.isin(row, (3, 4))
    band = cap | belt

    a, b = 12 * u + 4 * v, 12 * u - 4 * v
    cell = (np.floor(a) + 2 * np.floor(b)) % 4
    wire = (_to_integer(a) < 0.07) | (_to_integer(b) < 0.07)
    metal = band | wire | (_to_integer(8 * v) < 0.07) & (row % 2 == 1)
    matt = cell == 3

    colours = np.array([[0.02, 0.10, 0.34], [0.50, 0.04, 0.03], [0.03, 0.30, 0.22], [0.62, 0.56, 0.42]])
    gold = np.array([0.95, 0.66, 0.28])
    herringbone = np.where((row + np.floor(24 * u)) % 2, 0.125, 0.375)
    return {
        "diffuse": np.where(metal[..., None], 0, colours[cell.astype(int)]),
        "specular": np.where(metal[..., None], gold, 0.05),
        "alpha_u": np.where(band, 0.08, np.where(metal, 0.15, np.where(matt, 0.25, 0.06))),
        "alpha_v": np.where(band, 0.40, np.where(metal, 0.15, np.where(matt, 0.25, 0.06))),
        "rotation": np.where(belt, herringbone, 0),
    }


def _plane() -> tuple[np.ndarray, np.ndarray]:
    """x along u and y along v over a unit square, 0 in its middle: Mitsuba has the first row of an image at v = 0."""
    x = (np.arange(SIDE) + 0.5) / SIDE - 0.5
    return np.meshgrid(x, x)


def _around(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The direction, in [0, 0.5) of a turn, of a circle around the origin."""
    return (np.arctan2(y, x) / (2 * np.pi) + 0.25) % 0.5


def _to_integer(x: np.ndarray) -> np.ndarray:
    return np.abs(x - np.round(x))


def _uint16(numbers: np.ndarray) -> np.ndarray:
    return np.round(numbers * 65535).astype(np.uint16)


def _uint8(image: np.ndarray) -> np.ndarray:
    """Numbers as they are, colours in sRGB."""
    if image.ndim == 3:
        image = np.where(image < 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)
    return np.round(image * 255).astype(np.uint8)


def main():
    mi.set_variant("scalar_rgb")
    for name, image in textures().items():
        mi.Bitmap(image).write(str(FOLDER / name))


if __name__ == "__main__":
    main()
