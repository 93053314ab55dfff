"""Pictures of the models, and of the effect of their parameters.

From Python::

    from mi_brdfs.gallery import gallery
    gallery(["ward", "walter"], "pictures")      # pictures/index.html, overview.png, ward.png, walter.png

It needs ``pip install 'mi_brdfs[gallery]'``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path

import mitsuba as mi
import numpy as np

try:
    import mitsuba_oidn
    from PIL import Image
except ImportError:
    raise ImportError("the gallery needs Pillow and Open Image Denoise: pip install 'mi_brdfs[gallery]'") from None

from ..mitsuba.registry import find_models
from ..model import Model
from ..preview import preview_scene
from ..render import ctrl_c, display_image, write
from .html import Section, page
from .sheet import Row, sheet
from .sweeps import shown, sweeps_of

__all__ = ["gallery"]

SIZE, SPP = 192, 16
PER_ROW = 7


def gallery(
    types: Iterable[str] = (),
    folder: str | os.PathLike = "gallery",
    spp: int = SPP,
    size: int = SIZE,
    on_picture: Callable[[str, int, int], None] = lambda type, done, total: None,
) -> Path:
    """Render models in the preview scene, each with sweeps of its main parameters, and write an HTML page that shows
    them, with an overview and a contact sheet of each model. Ctrl-C keeps the finished pictures, and is raised.

    Args:
        types: the models, by type or alias; all if empty.
        folder: where ``index.html``, ``overview.png`` and ``TYPE.png`` go; created if it does not exist.
        spp: samples per pixel, rounded up to a power of 4; the pictures are denoised.
        size: width and height of a picture, in pixels.
        on_picture: called as ``on_picture(type, done, total)`` after each picture.

    Returns:
        The path of the page.

    Raises:
        ValueError: if there is no such model; the message has the closest name.
        OSError: if the folder cannot be created or written to.
    """
    models = find_models(types)
    entries = [Entry(model) for model in models]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    done, total = 0, sum(len(entry.bsdfs) for entry in entries)
    try:
        for entry in entries:
            for bsdf in entry.bsdfs:
                with ctrl_c() as interrupt:  # a render cannot be interrupted
                    image = picture(bsdf, size, spp)
                if interrupt.pressed:
                    raise KeyboardInterrupt
                entry.pictures.append(image)
                done += 1
                on_picture(entry.type, done, total)
            entry.write(folder)
    finally:
        begun = [entry for entry in entries if entry.pictures]
        if begun:
            begun[-1].write(folder)
            _save(overview([(entry.model, entry.pictures[0]) for entry in begun]), folder / "overview.png")
            text = page([entry.section() for entry in begun], f"{power_of_4(spp)} samples per pixel, denoised")
            (folder / "index.html").write_text(text, encoding="utf-8")
    return folder / "index.html"


def picture(bsdf: dict, size: int = SIZE, spp: int = SPP, seed: int = 0) -> Image.Image:
    """Return a material in the preview scene, denoised and tone-mapped; a square of ``size`` pixels."""
    scene = preview_scene(bsdf)
    # The denoiser expects pixels that do not share samples; this sampler takes powers of 4.
    scene["sensor"]["film"] |= {"width": size, "height": size, "rfilter": {"type": "box"}}
    scene["sensor"]["sampler"] = {"type": "ldsampler", "sample_count": power_of_4(spp)}
    image = np.array(mi.render(mi.load_dict(scene), seed=seed))
    return Image.fromarray(np.array(display_image(mi.Bitmap(mitsuba_oidn.denoise(image, hdr=True)))))


def power_of_4(spp: int) -> int:
    """Return the smallest power of 4 that is at least ``spp`` and at least 4, as the sampler requires."""
    return 4 ** max(((spp - 1).bit_length() + 1) // 2, 1)


def overview(portraits: list[tuple[type[Model], Image.Image]]) -> Image.Image:
    """Return an image of models with their names and years, in rows of the same length except for the last."""
    rows, lines = [], -(-len(portraits) // PER_ROW)
    length = -(-len(portraits) // lines)
    for first in range(0, len(portraits), length):
        some = portraits[first : first + length]
        rows.append(Row("", [image for _, image in some], [f"{model.plugins[0]}\n{year(model)}" for model, _ in some]))
    return sheet(rows)


def year(model: type[Model]) -> str:
    """Return a model's year of publication: the first year on its manual page, if there is one."""
    found = re.search(r"\b(1[789]|20)\d\d\b", model.__doc__ or "")
    return found[0] if found else ""


class Entry:
    """A model with the plugin dicts to show, its example and then its sweeps, and the pictures finished so far."""

    def __init__(self, model: type[Model]):
        self.model, self.type = model, model.plugins[0]
        self.sweeps = sweeps_of(model)
        self.bsdfs = [model.example(), *(bsdf for sweep in self.sweeps for bsdf in sweep.bsdfs(self.type))]
        self.pictures: list[Image.Image] = []

    def rows(self) -> list[Row]:
        """Return a row for each sweep, as far as there are pictures."""
        pictures = iter(self.pictures[1:])
        rows = []
        for sweep in self.sweeps:
            some = list(islice(pictures, len(sweep.values)))
            rows.append(Row(sweep.heading(self.type), some, [shown(value) for value in sweep.values[: len(some)]]))
        return [row for row in rows if row.pictures]

    def write(self, folder: Path) -> None:
        """Write the contact sheet unless it is empty."""
        if rows := self.rows():
            _save(sheet(rows), folder / f"{self.type}.png")

    def section(self) -> Section:
        rows = [(row.heading, row.captions) for row in self.rows()]
        return Section(self.model, year(self.model), self.bsdfs[0], rows)


def _save(image: Image.Image, path: Path) -> None:
    write(mi.Bitmap(np.array(image)), path)
