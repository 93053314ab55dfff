"""A wall of pictures: the materials of a sweep, each as it was measured, and beside that its fits."""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np
from PIL import Image

from ..cluster import Failed, run
from ..gallery import shot
from ..gallery.sheet import Row, sheet
from ..names import tabulated
from ..parameters.messages import printable
from ..rendering.output import write
from .plan import Outcome, Sweep, check_content, digest, versions

SIZE, SPP = 144, 16
ROWS = 64
"""The most rows of a picture: JPEG has no more than 65,535 lines."""


class Cell(NamedTuple):
    """A picture on the wall."""

    key: str
    bsdf: dict[str, Any]
    caption: str
    content: str | None = None
    """Of the file, if it shows one."""


class Wall:
    """The pictures of the fits of a sweep that are finished, of several seeds the one with the least error on held-out
    directions. They are kept in ``pictures`` of its folder, and made once."""

    def __init__(self, sweep: Sweep):
        self.sweep, self.folder = sweep, sweep.folder / "pictures"
        self.cells: dict[str, dict[str, list[Cell]]] = {metric: {} for metric in sweep.metrics}
        """By metric and content of the file, the measurement first."""
        best: dict[tuple[str, str, str], dict[str, Any]] = {}
        errors = [f"{metric}_held_out" for metric in sweep.metrics]
        for row in sweep.rows(["content", "model", "metric", "bsdf", "versions", *errors]):
            row["error"] = row[f"{row['metric']}_held_out"]
            place = row["metric"], row["content"], row["model"]
            if row["error"] is not None and (place not in best or row["error"] < best[place]["error"]):
                best[place] = row
        for metric in sweep.metrics:
            own = {place[1:]: row for place, row in best.items() if place[0] == metric}
            for content, file in sweep.files.items():
                fits = {model: row for (of, model), row in own.items() if of == content}
                if fits:
                    least = min(row["error"] for row in fits.values())
                    self.cells[metric][content] = [
                        _measured(file, content),
                        *(_fit(model, fits[model], least) for model in self._order(own) if model in fits),
                    ]

    def _order(self, fits: dict[tuple[str, str], dict[str, Any]]) -> list[str]:
        """Return the models that have fits, those with small errors first."""
        errors: dict[str, list[float]] = {}
        for (_, model), row in fits.items():
            errors.setdefault(model, []).append(row["error"])
        return sorted(errors, key=lambda model: (median(errors[model]), model))

    def _cells(self) -> dict[str, Cell]:
        """Return all pictures by key: metrics share the measured ones."""
        return {cell.key: cell for rows in self.cells.values() for row in rows.values() for cell in row}

    @property
    def total(self) -> int:
        return len(self._cells())

    def finished(self) -> int:
        """Return how many of the pictures are in the folder."""
        return sum(self._path(cell).exists() for cell in self._cells().values())

    def render(self, workers: int | None = None, scheduler: str | None = None) -> Generator[Outcome, None, None]:
        """Render what is not in the folder. ``workers`` and ``scheduler`` are as :func:`mi_brdfs.cluster.run` has them;
        a scheduler's workers need the files."""
        tasks = {key: (cell.bsdf, cell.content) for key, cell in self._cells().items() if not self._path(cell).exists()}
        if not tasks:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        for key, result in run(picture, tasks, workers=workers, scheduler=scheduler):
            if isinstance(result, Failed):
                yield Outcome(1, result.error)
                continue
            write(mi.Bitmap(result), self.folder / f"{key}.png")
            yield Outcome(1)

    def write(self) -> list[Path]:
        """Write ``wall_METRIC.jpg`` for each metric, several where there are many materials, and return the paths. What
        was not rendered is grey."""
        found = []
        for metric, rows in self.cells.items():
            contents = list(rows)
            for first in range(0, len(contents), ROWS):
                some = []
                for content in contents[first : first + ROWS]:
                    name, cells = printable(Path(self.sweep.files[content]).name), rows[content]
                    some.append(Row({0: name}, [*map(self._picture, cells)], [cell.caption for cell in cells]))
                number = f"_{first // ROWS + 1}" if len(contents) > ROWS else ""
                path = self.sweep.folder / f"wall_{metric}{number}.jpg"
                write(mi.Bitmap(np.array(sheet(some))), path)
                found.append(path)
        return found

    def _picture(self, cell: Cell) -> Image.Image:
        path = self._path(cell)
        if not path.exists():
            return Image.new("RGB", (SIZE, SIZE), "#dddddd")
        with Image.open(path) as image:
            return image.convert("RGB")

    def _path(self, cell: Cell) -> Path:
        return self.folder / f"{cell.key}.png"


def _measured(file: str, content: str) -> Cell:
    bsdf = {"type": "tabulated", "filename": str(Path(file).absolute())}
    return Cell(_key(f"{versions()} {content}"), bsdf, "measured", content)


def _fit(model: str, row: dict[str, Any], least: float) -> Cell:
    caption = f"{model}\n{row['error']:.3g}{', best' if row['error'] == least else ''}"
    return Cell(_key(f"{row['versions']} {row['bsdf']}"), json.loads(row["bsdf"]), caption)


def _key(identity: str) -> str:
    return digest([identity, SIZE, SPP, mi.variant()])


def picture(bsdf: dict[str, Any], content: str | None) -> np.ndarray:
    """Return a material as 8-bit sRGB; a worker's task. If it is a file, this has to have a content."""
    shown = bsdf | tabulated(bsdf["filename"]) if content else bsdf
    found = np.array(shot(shown, size=SIZE, spp=SPP).picture)
    if content:
        check_content(bsdf["filename"], content)
    return found
