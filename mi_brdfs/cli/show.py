"""``mi-brdfs show``"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import mitsuba as mi
import typer

from ..preview import STAGES, preview_scene
from ..rendering import MOST_PIXELS
from .app import command
from .options import AnyVariant, Parameters, material_argument, parameters_of, set_variant, source_of
from .picture import Denoise, Output, Seconds, Seed, output_files, render_to
from .terminal import Exit, fail, failing


@command("Look", "show walter:material=Au,alpha=.2 --denoise", "show best.xml --stage lamp -o best.png")
def show(
    material: Annotated[str, material_argument(metavar="MATERIAL")],
    parameters: Parameters = None,
    stage: Annotated[str, typer.Option(metavar="STAGE", help=f"The light: {', '.join(STAGES)}.")] = "studio",
    output: Output = None,
    size: Annotated[
        int, typer.Option(min=16, max=MOST_PIXELS, help="Width and height of the picture, in pixels.")
    ] = 512,
    spp: Annotated[
        int | None,
        typer.Option(min=1, help="Samples per pixel. Default: 128, 32 if denoised, or as --time says."),
    ] = None,
    seconds: Seconds = None,
    denoise: Denoise = False,
    variant: AnyVariant = None,
    seed: Seed = 0,
) -> None:
    """Render one material on the stage; Ctrl-C keeps the finished passes."""
    given = parameters_of(parameters)
    if stage not in STAGES:
        fail(f"--stage {stage}: there is no such stage; there are {', '.join(STAGES)}", Exit.USAGE)
    # So that .5 and 5 have names of their own.
    written_out = re.sub(r"(?<!\d)\.(?=\d)", "0.", Path(material).name.replace(".xml", ""))
    name = "bsdf" if material.startswith("<") else re.sub(r"[^\w-]+", "_", written_out)
    files = output_files(output or Path(f"{name[:100] or 'bsdf'}.exr"))
    set_variant(variant)

    def load() -> tuple[mi.Scene, int]:
        with failing(Exit.USAGE):
            source = source_of(material, given, "show")
            scene = preview_scene(source.load(), stage)
        film = scene["sensor"]["film"]
        film |= {"width": size, "height": size}
        if denoise:
            film["rfilter"] = {"type": "box"}
            scene["sensor"]["sampler"]["sample_count"] = 32
        return mi.load_dict(scene), 0

    render_to(files, load, denoise, spp=spp, seed=seed, seconds=seconds)
