"""``mi-brdfs render``"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import mitsuba as mi
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .app import command
from .errors import one_line
from .interrupts import answer_ctrl_c
from .terminal import Exit, err, fail, out, stdout_to_stderr
from .variants import set_variant

if TYPE_CHECKING:
    from ..render import Picture

LOAD_FILE_ARGUMENTS = ("path", "parallel", "optimize")  # of mi.load_file: a -D parameter cannot have these names
DISPLAY_SUFFIXES = (".png", ".jpg", ".jpeg")


@command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.xml", help="The scene file.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="An .exr, .png or .jpg; the EXR and a display image are always both written."
        ),
    ] = None,
    variant: Annotated[
        str | None,
        typer.Option(help="Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb, whichever works, else scalar_rgb."),
    ] = None,
    spp: Annotated[int | None, typer.Option(min=1, help="Samples per pixel. Default: the scene's.")] = None,
    define: Annotated[
        list[str] | None, typer.Option("-D", metavar="name=value", help="Set a <default> parameter of the scene.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="A different seed gives different noise.")] = 0,
) -> None:
    """Render a scene progressively; Ctrl-C keeps the finished passes."""
    parameters = _parameters(define or [])
    exr, display = _output_files(output or Path(scene.stem + ".exr"))
    chosen = set_variant(variant)
    start = time.perf_counter()
    try:
        with stdout_to_stderr():
            picture = _render(_load(scene, parameters), spp, seed)
        seconds = time.perf_counter() - start
        written = _write(picture, exr, display)
    except KeyboardInterrupt:
        err.print("Interrupted; nothing is finished, nothing was written.")
        raise typer.Exit(Exit.INTERRUPTED) from None
    for path in written:
        out.print(str(path))
    if picture.spp < picture.total:
        err.print(f"Interrupted; the image has the {picture.spp} of {picture.total} samples per pixel finished so far.")
        raise typer.Exit(Exit.INTERRUPTED)
    err.print(f"{picture.spp} samples per pixel in {seconds:.1f} s, {chosen}.")


def _parameters(definitions: list[str]) -> dict[str, str]:
    parameters = {}
    for definition in definitions:
        name, equals, value = definition.partition("=")
        if not equals or not name:
            fail(f"-D {definition}: write -Dname=value", Exit.USAGE)
        if name in LOAD_FILE_ARGUMENTS:
            fail(f"-D {name}: Mitsuba reserves this name; rename the parameter in the scene", Exit.USAGE)
        parameters[name] = value
    return parameters


def _output_files(output: Path) -> tuple[Path, Path]:
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


def _load(path: Path, parameters: dict[str, str]) -> mi.Scene:
    if not path.is_file():
        fail(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    try:
        scene = mi.load_file(str(path), **parameters)
    except Exception as error:
        fail(one_line(error))
    if not isinstance(scene, mi.Scene):
        fail(f"{path} does not hold a <scene>")
    if not scene.sensors():
        fail(f"{path}: the scene has no <sensor>")
    if not scene.integrator():
        fail(f"{path}: the scene has no <integrator>")
    return scene


def _render(scene: mi.Scene, spp: int | None, seed: int) -> Picture:
    from ..render import render  # imports numpy

    columns = [
        TextColumn("Rendering"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("samples per pixel,"),
        TimeRemainingColumn(),
        TextColumn("left"),
    ]
    with Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=None)
        with answer_ctrl_c(lambda: err.print("Stopping; Ctrl-C again aborts at once.")):
            try:
                return render(
                    scene, spp, seed, on_pass=lambda done, total: progress.update(task, completed=done, total=total)
                )
            except Exception as error:
                fail(one_line(error))


def _write(picture: Picture, exr: Path, display: Path) -> list[Path]:
    from ..render import display_image, write

    image = display_image(picture.bitmap)
    files = [(picture.bitmap, exr), (image, display)]
    if image is None:
        err.print(f"The film has no RGB, XYZ or luminance channels, so there is no {display.name}.")
        files.pop()
    try:
        for bitmap, path in files:
            write(bitmap, path)
    except Exception as error:
        fail(f"cannot write {path}: {one_line(error)}")
    return [path for _, path in files]
