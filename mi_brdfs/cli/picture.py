"""The picture that a command renders: its options, its progress, and its files."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mitsuba as mi
import typer
from rich.progress import TextColumn

from ..parameters.messages import listed
from .files import check_output
from .options import file_option, writing_to
from .terminal import Exit, err, fail, failing, out, progress, stdout_to_stderr

if TYPE_CHECKING:
    from ..rendering.passes import Picture

PICTURES = ".exr", ".png", ".jpg", ".jpeg"

Output = Annotated[
    Path | None,
    file_option("-o", "An .exr, .png or .jpg; the EXR and a display image are always both written.", "PATH", PICTURES),
]
Seconds = Annotated[
    float | None, typer.Option("--time", metavar="SECONDS", min=0, help="End with the pass in which this time is over.")
]
Seed = Annotated[int, typer.Option(min=0, max=2**32 - 1, help="A different seed gives different noise.")]
Denoise = Annotated[
    bool, typer.Option("--denoise", help="Use a box filter, and denoise the picture with Open Image Denoise.")
]


def output_files(output: Path) -> tuple[Path, Path]:
    """Return the paths of the EXR and the display image for ``output``, if they can be written."""
    if output.suffix.lower() not in PICTURES:  # a device, of which there would have to be two
        fail(f"-o {output}: write a {listed(PICTURES)}", Exit.USAGE)
    is_exr = output.suffix.lower() == ".exr"
    files = (output, output.with_suffix(".png")) if is_exr else (output.with_suffix(".exr"), output)
    for file in files:
        check_output("-o", file)
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

        with _answering_ctrl_c(), failing(Exit.ERROR, Exception):
            return render(scene, sensor=sensor, on_pass=advance, **options)


@contextmanager
def _answering_ctrl_c() -> Iterator[None]:
    """Answer Ctrl-C at once, where Python's own handlers wait for the pass to end; a second one ends the process."""
    ours, written_by_python = socket.socketpair()
    written_by_python.setblocking(False)

    def watch() -> None:
        pressed = 0
        while received := ours.recv(64):
            pressed += received.count(signal.SIGINT)
            if pressed > 1:
                err.show_cursor(True)
                err.print("Aborted; nothing was written.")
                os._exit(Exit.INTERRUPTED)
            if pressed == 1:
                err.print("Stopping; Ctrl-C again aborts at once.")

    previous = signal.set_wakeup_fd(written_by_python.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(previous)
        written_by_python.close()
        watcher.join()
        ours.close()


def _write(picture: Picture, exr: Path, display: Path) -> list[Path]:
    from ..rendering.output import broken_pixels, display_image, write

    if count := broken_pixels(picture):
        err.print(f"{count} pixels have values that are not finite, as a parameter, a texture or a light may have.")
    image = display_image(picture.bitmap)
    files = [(picture.bitmap, exr), (image, display)]
    if image is None:
        err.print(f"The film has no RGB, XYZ or luminance channels, so there is no {display.name}.")
        files.pop()
    for bitmap, path in files:
        with failing(Exit.ERROR, Exception, about=f"cannot write {path}"), writing_to(path):
            write(bitmap, path)
    return [path for _, path in files]
