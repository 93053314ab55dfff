"""``mi-brdfs render``"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import mitsuba as mi
import typer

from ..parameters.messages import listed, no_file
from ..rendering.scene_file import RESERVED, SceneFile
from .app import command
from .options import (
    AnyVariant,
    Lenient,
    Scheduler,
    check_workers,
    parameters_of,
    parameters_option,
    set_variant,
    source_of,
)
from .picture import Denoise, Output, Seconds, Seed, output_files, render_to
from .terminal import Exit, fail, failing, stdout_to_stderr

if TYPE_CHECKING:
    from ..probe.sources import BSDFSource


@command("Look", "render room.xml --spp 64 --denoise", "render room.xml --replace wall=fit.json:walter -o wall.png")
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.xml", help="The scene file.")],
    output: Output = None,
    variant: AnyVariant = None,
    spp: Annotated[int | None, typer.Option(min=1, help="Samples per pixel. Default: the scene's.")] = None,
    seconds: Seconds = None,
    define: Annotated[list[str] | None, parameters_option("Set a <default> parameter of the scene.")] = None,
    replacements: Annotated[
        list[str] | None,
        typer.Option(
            "--replace",
            metavar="ID=MATERIAL",
            help="Put a material in the place of the BSDF, or of that of the shape, with this id; may be repeated.",
        ),
    ] = None,
    sensor: Annotated[
        str, typer.Option(metavar="NUMBER|ID", help="Which of the scene's sensors, counted from 0, or its id.")
    ] = "0",
    crop: Annotated[
        str | None,
        typer.Option(metavar="X,Y,WIDTH,HEIGHT", help="Render this part of the picture, in pixels from the top left."),
    ] = None,
    denoise: Denoise = False,
    lenient: Lenient = False,
    seed: Seed = 0,
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Render with N processes of one thread each, on this machine."),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Render a scene progressively; Ctrl-C keeps the finished passes."""
    check_workers(workers, scheduler)
    parameters = parameters_of(define)
    for name in parameters:
        if name in RESERVED:
            fail(f"-D {name}: Mitsuba reserves this name; rename the parameter in the scene", Exit.USAGE)
    window = _window(crop)
    files = output_files(output or Path((scene.stem or "scene") + ".exr"))
    set_variant(variant)

    with stdout_to_stderr():
        replaced = _replaced(replacements or [])
    if scheduler and (file_of := next((it.word for it in replaced.values() if Path(it.source).exists()), None)):
        fail(f"--replace: the workers of a scheduler do not have {file_of}; give a plugin or a preset", Exit.USAGE)
    file = SceneFile(str(scene), parameters, box_filter=denoise, lenient=lenient, replaced=replaced)

    def load() -> tuple[mi.Scene, int]:
        loaded = _load(file)
        index = _index(loaded, sensor)
        if window:
            from ..rendering.passes import crop  # imports numpy

            with failing(Exit.USAGE, about=f"--crop {','.join(map(str, window))}"):
                crop(loaded.sensors()[index], *window)
        return loaded, index

    passes = None
    if workers or scheduler:
        from ..cluster.passes import passes_on  # imports numpy

        passes = passes_on(file, window=window, workers=workers, scheduler=scheduler)
    render_to(files, load, denoise, spp=spp, seed=seed, seconds=seconds, passes=passes)


def _window(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        x, y, width, height = (int(number) for number in text.split(","))
    except ValueError:
        fail(f"--crop {text}: write four whole numbers, X,Y,WIDTH,HEIGHT", Exit.USAGE)
    return [x, y, width, height]


def _replaced(options: list[str]) -> dict[str, BSDFSource]:
    """Return the materials by the ids that they are given to."""
    found = {}
    for option in options:
        id, equals, word = option.partition("=")
        if not (id and equals and word):
            fail(f"--replace {option}: write ID=MATERIAL, as in floor=burley:roughness=.2", Exit.USAGE)
        if id in found:
            fail(f"--replace {option}: {id} is given twice", Exit.USAGE)
        found[id] = source_of(word, {})
    return found


def _index(scene: mi.Scene, sensor: str) -> int:
    ids = [it.id() for it in scene.sensors()]
    if sensor in ids:
        return ids.index(sensor)
    if not sensor.isdecimal() or int(sensor) >= len(ids):
        known = listed((f"{k} ({name})" if name else str(k) for k, name in enumerate(ids)), "and")
        have = f"sensors are {known}" if len(ids) > 1 else f"only sensor is {known}"
        fail(f"--sensor {sensor}: there is no such sensor; the scene's {have}", Exit.USAGE)
    return int(sensor)


def _load(file: SceneFile) -> mi.Scene:
    path = Path(file.path)
    if not path.is_file():
        fail(no_file(path))
    with failing(Exit.ERROR, Exception):
        scene = file.load()
    if not isinstance(scene, mi.Scene):
        fail(f"{path} does not hold a <scene>")
    if not scene.sensors():
        fail(f"{path}: the scene has no <sensor>")
    if not scene.integrator():
        fail(f"{path}: the scene has no <integrator>")
    return scene
