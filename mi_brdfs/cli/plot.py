"""``mi-brdfs plot``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .app import command
from .files import check_output
from .options import (
    FIGURES,
    Labels,
    TracingVariant,
    file_option,
    material_argument,
    parameters_option,
    set_tracing_variant,
    writing_to,
)
from .terminal import Exit, err, fail, failing, out, stdout_to_stderr


@command(
    "Look", "plot ward:alpha=.1,.2,.4 --kind cartesian", "plot paint.binary fit.json:walter --angles 30,60 -o fit.pdf"
)
def plot(
    targets: Annotated[list[str], material_argument()],
    parameters: Annotated[
        list[str] | None,
        parameters_option(
            "Set a parameter of each material that has it to a number, a word, true, false, #rrggbb or 'r;g;b'; "
            "name=a,b,c draws each value."
        ),
    ] = None,
    kind: Annotated[str, typer.Option(metavar="KIND", help="polar, cartesian, hemisphere or albedo.")] = "polar",
    output: Annotated[Path | None, file_option("-o", "A .png, .svg, .pdf or .jpg.", endings=FIGURES)] = None,
    angles: Annotated[
        str | None, typer.Option(metavar="DEGREES", help="Angles of incidence. Default: 10,40,70.")
    ] = None,
    azimuth: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="Azimuth of incidence, from dp_du. Default: 0.")
    ] = None,
    scale: Annotated[
        str | None, typer.Option(metavar="SCALE", help="linear, log or both, for polar, cartesian. Default: both.")
    ] = None,
    normalize: Annotated[
        bool, typer.Option("--normalize", help="Divide each curve by its maximum, for polar, cartesian.")
    ] = False,
    rgb: Annotated[
        bool, typer.Option("--rgb", help="Draw red, green and blue, not the luminance, for polar, cartesian, albedo.")
    ] = False,
    side_by_side: Annotated[
        bool, typer.Option("--side-by-side", help="Draw each BSDF in a panel of its own, for polar, cartesian.")
    ] = False,
    title: Annotated[str | None, typer.Option(metavar="TEXT", help="Above the figure.")] = None,
    labels: Labels = None,
    size: Annotated[
        str | None, typer.Option(metavar="WxH", help="In inches, of 200 pixels. Default: as needed.")
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Draw the lobes of one BSDF, or of several to compare: in the plane of incidence (polar, cartesian), over the
    hemisphere, or as albedo curves. `mi-brdfs explore MATERIAL…` shows lobes in 3D and slices over θh and θd, with
    `--export FILE.html` as a file; `mi-brdfs measured FILE --plot PICTURE.png` draws those slices of measured files."""
    from ..plot import command as asked

    if kind not in asked.KINDS:
        kinds = ", ".join(asked.KINDS)
        lobe = "mi-brdfs explore MATERIAL… --export FILE.html"
        fail(f"--kind {kind}: there is no such kind; there are {kinds}; for a lobe in 3D, {lobe}", Exit.USAGE)
    with failing(Exit.USAGE):
        options = asked.options_of(
            kind,
            angles,
            azimuth=azimuth,
            scale=scale,
            normalize=normalize or None,
            rgb=rgb or None,
            side_by_side=side_by_side or None,
            title=title,
            labels=labels and labels.split(","),
            size=asked.size_of(size),
        )
        file = output or asked.default_file(kind, targets)
    check_output("-o", file)
    set_tracing_variant(variant)
    with stdout_to_stderr(), err.status(f"Drawing {file.name}"):
        with failing(Exit.USAGE):
            bsdfs = asked.asked_for(targets, parameters or [])
            figure = asked.KINDS[kind](*bsdfs, **options)
        with writing_to(file):
            asked.write(figure, file)
    out.print(str(file))
