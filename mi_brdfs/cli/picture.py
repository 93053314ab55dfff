"""The picture that a command renders: its options, its progress, and its files."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mitsuba as mi
import typer
from rich.progress import TextColumn

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .interrupts import answer_ctrl_c
from .terminal import Exit, err, fail, out, progress, stdout_to_stderr

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..rendering.passes import Picture

DISPLAY_SUFFIXES = (".png", ".jpg", ".jpeg")

Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", help="An .exr, .png or .jpg; the EXR and a display image are always both written."),
]
Seconds = Annotated[
    float | None,
    typer.Option("--time", metavar="SECONDS", min=0, help="End with the pass in which this time is over."),
]
Seed = Annotated[int, typer.Option(min=0, help="A different seed gives different noise.")]
Denoise = Annotated[
    bool, typer.Option("--denoise", help="Use a box filter, and denoise the picture with Open Image Denoise.")
]


def output_files(output: Path) -> tuple[Path, Path]:
    """Return the paths of the EXR and the display image for ``output``, if they can be written."""
    suffix = output.suffix.lower()
    if suffix != ".exr" and suffix not in DISPLAY_SUFFIXES:
        fail(f"{output}: unknown image format; use .exr, .png or .jpg", Exit.USAGE)
    files = (output, output.with_suffix(".png")) if suffix == ".exr" else (output.with_suffix(".exr"), output)
    for file in files:
        if file.is_dir():
            fail(f"{file} is a folder")
    try:
        tempfile.TemporaryFile(dir=output.parent).close()
    except OSError as error:
        fail(f"cannot write to the folder {output.parent}: {error.strerror}")
    return files


def render_to(
    files: tuple[Path, Path], load: Callable[[], tuple[mi.Scene, int]], denoise: bool, **options: Any
) -> None:
    """Render the scene and sensor that ``load`` returns, with the options of :func:`.rendering.passes.render`, write
    the files, and print their names. Ctrl-C keeps the finished passes."""
    from ..rendering.output import denoised  # imports numpy

    start = time.perf_counter()
    try:
        with stdout_to_stderr():
            picture = _render(*load(), options)
            seconds = time.perf_counter() - start
            if denoise:
                picture = denoised(picture)
        written = _write(picture, *files)
    except (ImportError, ValueError) as error:
        fail(f"--denoise: {error}")
    for path in written:
        out.print(str(path))
    if picture.interrupted:
        of = "" if picture.total is None else f" of {picture.total}"
        err.print(f"Interrupted; the image has the {picture.spp}{of} samples per pixel finished so far.")
        raise typer.Exit(Exit.INTERRUPTED)
    err.print(f"{picture.spp} samples per pixel in {seconds:.1f} s, {mi.variant()}.")


def _render(scene: mi.Scene, sensor: int, options: dict[str, Any]) -> Picture:
    from ..rendering.passes import render  # imports numpy

    seconds, start = options.get("seconds"), time.perf_counter()
    with progress("Rendering", TextColumn("{task.fields[spp]} samples per pixel,")) as bar:
        task = bar.add_task("", total=None, spp=0)

        def advance(done: int, total: int | None) -> None:
            spp = done if total is None else f"{done}/{total}"
            # The end that comes first.
            parts = [done / total] if total else []
            parts += [] if seconds is None else [(time.perf_counter() - start) / max(seconds, 1e-3)]
            bar.update(task, completed=max(parts), total=1, spp=spp)

        with answer_ctrl_c(lambda: err.print("Stopping; Ctrl-C again aborts at once.")):
            try:
                with unwrapped_ctrl_c():
                    return render(scene, sensor=sensor, on_pass=advance, **options)
            except Exception as error:
                fail(one_line(error))


def _write(picture: Picture, exr: Path, display: Path) -> list[Path]:
    from ..rendering.output import display_image, write

    image = display_image(picture.bitmap)
    files = [(picture.bitmap, exr), (image, display)]
    if image is None:
        err.print(f"The film has no RGB, XYZ or luminance channels, so there is no {display.name}.")
        files.pop()
    try:
        for bitmap, path in files:
            write(bitmap, path)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}")
    except Exception as error:
        fail(f"cannot write {path}: {one_line(error)}")
    return [path for _, path in files]
