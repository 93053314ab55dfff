"""``mi-brdfs render``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import mitsuba as mi
import typer

from ..mitsuba.errors import one_line
from .app import command
from .options import parameters_of
from .picture import Denoise, Output, Seconds, Seed, output_files, render_to
from .terminal import Exit, fail
from .variants import AnyVariant, set_variant

LOAD_FILE_ARGUMENTS = ("path", "parallel", "optimize")  # of mi.load_file: a -D parameter cannot have these names


@command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.xml", help="The scene file.")],
    output: Output = None,
    variant: AnyVariant = None,
    spp: Annotated[int | None, typer.Option(min=1, help="Samples per pixel. Default: the scene's.")] = None,
    seconds: Seconds = None,
    define: Annotated[
        list[str] | None,
        typer.Option("-D", "--param", metavar="name=value", help="Set a <default> parameter of the scene."),
    ] = None,
    sensor: Annotated[
        str, typer.Option(metavar="NUMBER|ID", help="Which of the scene's sensors, counted from 0, or its id.")
    ] = "0",
    crop: Annotated[
        str | None,
        typer.Option(metavar="X,Y,WIDTH,HEIGHT", help="Render this part of the picture, in pixels from the top left."),
    ] = None,
    denoise: Denoise = False,
    seed: Seed = 0,
) -> None:
    """Render a scene progressively; Ctrl-C keeps the finished passes."""
    parameters = parameters_of(define)
    for name in parameters:
        if name in LOAD_FILE_ARGUMENTS:
            fail(f"-D {name}: Mitsuba reserves this name; rename the parameter in the scene", Exit.USAGE)
    window = _window(crop)
    files = output_files(output or Path(scene.stem + ".exr"))
    set_variant(variant)

    def load() -> tuple[mi.Scene, int]:
        loaded = _load(scene, parameters, box_filter=denoise)
        index = _index(loaded, sensor)
        if window:
            _crop(loaded.sensors()[index], window)
        return loaded, index

    render_to(files, load, denoise, spp=spp, seed=seed, seconds=seconds)


def _window(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        x, y, width, height = (int(number) for number in text.split(","))
    except ValueError:
        fail(f"--crop {text}: write four whole numbers, X,Y,WIDTH,HEIGHT", Exit.USAGE)
    return [x, y, width, height]


def _crop(sensor: mi.Sensor, window: list[int]) -> None:
    from ..render import crop

    try:
        crop(sensor, *window)
    except ValueError as error:
        fail(f"--crop {','.join(map(str, window))}: {error}", Exit.USAGE)


def _index(scene: mi.Scene, sensor: str) -> int:
    ids = [it.id() for it in scene.sensors()]
    if sensor in ids:
        return ids.index(sensor)
    if not sensor.isdecimal() or int(sensor) >= len(ids):
        known = ", ".join(f"{k} ({name})" if name else str(k) for k, name in enumerate(ids))
        fail(f"--sensor {sensor}: there is no such sensor; there are {known}", Exit.USAGE)
    return int(sensor)


def _load(path: Path, parameters: dict[str, str], box_filter: bool) -> mi.Scene:
    if not path.is_file():
        fail(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    try:
        scene = (_load_with_box_filter if box_filter else mi.load_file)(str(path), **parameters)
    except Exception as error:
        fail(one_line(error))
    if not isinstance(scene, mi.Scene):
        fail(f"{path} does not hold a <scene>")
    if not scene.sensors():
        fail(f"{path}: the scene has no <sensor>")
    if not scene.integrator():
        fail(f"{path}: the scene has no <integrator>")
    return scene


def _load_with_box_filter(path: str, **parameters: str) -> mi.Object:
    """Load a file with box filters in place of its films': a denoiser expects pixels that share no samples."""
    config = mi.parser.ParserConfig(mi.variant())
    state = mi.parser.parse_file(config, path, **parameters)
    mi.parser.transform_all(config, state)
    for node in state.nodes:
        if node.type == mi.ObjectType.ReconstructionFilter:
            node.props = mi.Properties("box")
    for node in state.nodes:
        children = [node.props[name] for name in node.props.keys()]
        places = [it.index() for it in children if isinstance(it, mi.Properties.ResolvedReference)]
        filtered = any(state.nodes[place].type == mi.ObjectType.ReconstructionFilter for place in places)
        if node.type == mi.ObjectType.Film and not filtered:
            node.props["rfilter"] = mi.load_dict({"type": "box"})
    return mi.parser.instantiate(config, state)
