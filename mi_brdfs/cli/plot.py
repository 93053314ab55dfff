"""``mi-brdfs plot``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .app import command
from .options import check_output
from .terminal import Exit, fail, out, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant


@command()
def plot(
    targets: Annotated[
        list[str],
        typer.Argument(
            metavar="TYPE|FILE|XML…",
            help="Plugins of the pack or others; files with a scene, a BSDF or measured values.",
        ),
    ],
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "-D",
            "--param",
            metavar="name=value",
            help="Set a parameter of each TYPE to a number, a word, true, false, #rrggbb or 'r;g;b'; name=a,b,c draws "
            "each value.",
        ),
    ] = None,
    kind: Annotated[
        str, typer.Option(metavar="KIND", help="polar, cartesian, hemisphere, albedo or sphere.")
    ] = "polar",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="A .png, .svg, .pdf, .jpg; .html for sphere.")
    ] = None,
    angles: Annotated[
        str | None, typer.Option(metavar="DEGREES", help="Angles of incidence. Default: 10,40,70; 45 for sphere.")
    ] = None,
    azimuth: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="Azimuth of incidence, from dp_du. Default: 0.")
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(metavar="SCALE", help="linear, log or both, for polar, cartesian, sphere. Default: both."),
    ] = None,
    normalize: Annotated[
        bool, typer.Option("--normalize", help="Divide each curve by its maximum, for polar, cartesian, sphere.")
    ] = False,
    rgb: Annotated[
        bool, typer.Option("--rgb", help="Draw red, green and blue, not the luminance, for polar, cartesian, albedo.")
    ] = False,
    variant: TracingVariant = None,
) -> None:
    """Draw the lobes of one BSDF, or of several to compare: in the plane of incidence (polar, cartesian), over the
    hemisphere, as albedo curves, or as bodies to turn in a browser (sphere)."""
    try:
        from ..plot import command as asked
    except ImportError as error:
        fail(str(error))
    if kind not in asked.KINDS:
        fail(f"--kind {kind}: there is no such kind; there are {', '.join(asked.KINDS)}", Exit.USAGE)
    try:
        bsdfs = asked.asked_for(targets, parameters or [])
        options = asked.options_of(
            kind, angles, azimuth=azimuth, scale=scale, normalize=normalize or None, rgb=rgb or None
        )
        file = asked.output_file(output, kind, targets)
    except ValueError as error:
        fail(str(error), Exit.USAGE)
    check_output("-o", output)
    set_tracing_variant(variant)
    with stdout_to_stderr():
        try:
            with unwrapped_ctrl_c():
                figure = asked.KINDS[kind](*bsdfs, **options)
        except ImportError as error:
            fail(str(error))
        except (ValueError, RuntimeError) as error:  # Mitsuba raises both
            fail(one_line(error), Exit.USAGE)
        try:
            asked.write(figure, file)
        except OSError as error:
            fail(f"cannot write {file}: {error.strerror}")
    out.print(str(file))
