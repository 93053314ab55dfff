"""Pictures of the models, and of the effect of their parameters.

From Python::

    from mi_brdfs.gallery import gallery
    gallery(["ward", "walter"], "pictures")      # pictures/index.html, overview.png, ward.png, walter.png

It needs ``pip install 'mi_brdfs[gallery]'``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from itertools import groupby, islice
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

import mitsuba as mi
import numpy as np

try:
    import jinja2  # noqa: F401
    import mitsuba_oidn  # noqa: F401
    from PIL import Image
except ImportError:
    raise ImportError("the gallery needs Jinja2, Pillow and mitsuba-oidn: pip install 'mi_brdfs[gallery]'") from None

from ..mitsuba.registry import find_models, info, presets
from ..model import Model
from ..pages import environment
from ..parameters.published import preset
from ..preview import preview_scene
from ..probe.arrays import luminance
from ..rendering.output import denoise, display_image, write
from ..rendering.passes import ctrl_c
from ..writing import write_text
from .contents import Sweep, by_family, portrait, stage_of, sweeps_of, year
from .sheet import Row, sheet

__all__ = ["gallery"]

SIZE, SPP = 256, 16
PER_ROW = 6
PRESETS_PER_ROW = 8
ACROSS = 3
"""How many rows of pixels in the middle of a picture make its profile."""


def gallery(
    types: str | Iterable[str] = (),
    folder: str | os.PathLike = "gallery",
    spp: int = SPP,
    size: int = SIZE,
    on_picture: Callable[[str, int, int], None] = lambda type, done, total: None,
    with_presets: bool = False,
) -> Path:
    """Render models in the preview scene, each with sweeps of its main parameters, and write an HTML page that shows
    them, with an overview and a contact sheet of each model. Ctrl-C keeps the finished pictures, and is raised.

    Args:
        types: a model, by type or alias, or several; all if empty.
        folder: where ``index.html``, ``overview.png`` and ``TYPE.png`` go; created if it does not exist.
        spp: samples per pixel, rounded up to a power of 4; the pictures are denoised.
        size: width and height of a picture, in pixels.
        on_picture: called as ``on_picture(type, done, total)`` after each picture.
        with_presets: also render each model's published materials, half as large, into ``TYPE_presets.jpg``.

    Returns:
        The path of the page.

    Raises:
        ValueError: if there is no such model, with the closest name, or spp or size is too small.
        OSError: if the folder cannot be created or written to.
    """
    if spp < 1 or size < 16:
        raise ValueError(f"A gallery needs spp >= 1 and size >= 16, not {spp} and {size}.")
    entries = [Entry(model, with_presets) for model in by_family(find_models(types))]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    TemporaryFile(dir=folder).close()  # or the error comes before the pictures
    done, total = 0, sum(len(entry.bsdfs) + len(entry.presets) for entry in entries)
    try:
        for entry in entries:
            for bsdf in [*entry.bsdfs, *map(preset, entry.presets)]:
                half = len(entry.shots) >= len(entry.bsdfs)
                with ctrl_c() as interrupt:  # a render cannot be interrupted
                    image = shot(bsdf, entry.stage, size // 2 if half else size, spp)
                if interrupt.pressed:
                    raise KeyboardInterrupt
                entry.shots.append(image)
                done += 1
                on_picture(entry.type, done, total)
            entry.write(folder)
    finally:
        begun = [entry for entry in entries if entry.shots]
        if begun:
            begun[-1].write(folder)
            _save(overview([(entry.model, entry.shots[0].picture) for entry in begun]), folder / "overview.png")
            write_text(folder / "index.html", page(begun, spp))
    return folder / "index.html"


class Shot(NamedTuple):
    """A picture of a material, and what it is to be judged by."""

    picture: Image.Image
    """Tone-mapped, a square."""
    profile: np.ndarray
    """The luminance in its middle, from left to right."""


def shot(bsdf: dict, stage: str = "studio", size: int = SIZE, spp: int = SPP, seed: int = 0) -> Shot:
    """Return a material in the preview scene, denoised, in a square of ``size`` pixels."""
    scene = preview_scene(bsdf, stage)
    # The denoiser expects pixels that do not share samples; this sampler takes powers of 4.
    scene["sensor"]["film"] |= {"width": size, "height": size, "rfilter": {"type": "box"}}
    scene["sensor"]["sampler"] = {"type": "ldsampler", "sample_count": power_of_4(spp)}
    image = np.array(mi.render(mi.load_dict(scene), seed=seed))
    middle = slice((size - ACROSS) // 2, (size + ACROSS) // 2)
    profile = luminance(image[middle].mean(axis=0))
    return Shot(Image.fromarray(np.array(display_image(mi.Bitmap(denoise(image))))), profile)


def power_of_4(spp: int) -> int:
    """Return the smallest power of 4 that is at least ``spp`` and at least 4, as the sampler requires."""
    return 4 ** max(((spp - 1).bit_length() + 1) // 2, 1)


def overview(portraits: list[tuple[type[Model], Image.Image]]) -> Image.Image:
    """Return an image of models with their names and years, by family: a family of up to six is in one row, beside
    others as far as there is room."""
    rows: list[Row] = []
    for family, group in groupby(portraits, key=lambda each: each[0].family):
        members = list(group)
        for first in range(0, len(members), PER_ROW):
            some = members[first : first + PER_ROW]
            if not rows or len(rows[-1].pictures) + len(some) > PER_ROW:
                rows.append(Row({}, [], []))
            row = rows[-1]
            if not first and family:
                row.headings[len(row.pictures)] = family
            row.pictures.extend(image for _, image in some)
            row.captions.extend(f"{model.plugins[0]}\n{year(model)}" for model, _ in some)
    return sheet(rows)


def sweep_row(sweep: Sweep, stage: str, shots: list[Shot]) -> Row:
    """Return the pictures of a sweep, as far as they go; under a point light, with their profiles."""
    captions = sweep.captions()[: len(shots)]
    profiles = [each.profile for each in shots] if stage == "point" else []
    return Row({0: sweep.heading()}, [each.picture for each in shots], captions, profiles)


class Entry:
    """A model with the plugin dicts to show, its portrait and then its sweeps, and the pictures finished so far."""

    def __init__(self, model: type[Model], with_presets: bool = False):
        self.model, self.type, self.stage = model, model.plugins[0], stage_of(model)
        self.sweeps = sweeps_of(model)
        self.bsdfs = [portrait(model), *(bsdf for sweep in self.sweeps for bsdf in sweep.bsdfs(self.type))]
        self.presets = presets(self.type) if with_presets else []
        self.shots: list[Shot] = []

    def rows(self) -> list[Row]:
        """Return a row for each sweep, as far as there are pictures."""
        shots = iter(self.shots[1:])
        rows = [sweep_row(sweep, self.stage, list(islice(shots, len(sweep.values)))) for sweep in self.sweeps]
        return [row for row in rows if row.pictures]

    def wall(self) -> list[Row]:
        """Return the published materials in rows under the names of their sets, as far as there are pictures."""
        rows, shots = [], self.shots[len(self.bsdfs) :]
        named = ((name.rpartition("/"), shot.picture) for name, shot in zip(self.presets, shots, strict=False))
        for group, members in groupby(named, key=lambda each: each[0][0]):
            pictures = [(name[2], picture) for name, picture in members]
            for first in range(0, len(pictures), PRESETS_PER_ROW):
                names, images = zip(*pictures[first : first + PRESETS_PER_ROW], strict=True)
                rows.append(Row({} if first else {0: group}, list(images), list(names)))
        return rows

    def write(self, folder: Path) -> None:
        """Write the contact sheet and the wall of presets unless they are empty, both as wide as the wider one."""
        sheets = {f"{self.type}.png": self.rows(), f"{self.type}_presets.jpg": self.wall()}
        width = max((sheet(rows).width for rows in sheets.values() if rows), default=0)
        for name, rows in sheets.items():
            if rows:
                _save(sheet(rows, width), folder / name)

    def described(self) -> str:
        """Return what the contact sheet shows, in words."""
        told = "; ".join(f"{row.headings[0]}: {', '.join(row.captions)}" for row in self.rows())
        return told and f"{self.type}: {told}"

    def finished_presets(self) -> list[str]:
        return self.presets[: max(len(self.shots) - len(self.bsdfs), 0)]


def page(entries: list[Entry], spp: int) -> str:
    """Return the page beside the pictures, as text."""
    families = [(family, list(group)) for family, group in groupby(entries, key=lambda it: it.model.family)]
    quality = f"{mi.variant()}: {power_of_4(spp)} samples per pixel, denoised"
    return environment.get_template("gallery.html").render(
        entries=entries, families=families, year=year, quality=quality, info=info
    )


def _save(image: Image.Image, path: Path) -> None:
    write(mi.Bitmap(np.array(image)), path)
