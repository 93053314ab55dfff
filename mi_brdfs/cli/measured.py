"""``mi-brdfs measured``"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from ..mitsuba.errors import one_line
from .app import command
from .options import check_output, file_option, parameters_of, parameters_option, quantity_of, write_json, writing_to
from .terminal import Exit, err, fail, out, print_table

if TYPE_CHECKING:
    from ..measured import Measurement

FORMATS = "MERL, RGL, MBSDF, Zemax, LightTools, ALTA, Cornell, CSV or UTIA"
"""Those that can be read, as the help says, which does not wait for the readers."""


@command("Measure", "measured paint.binary --plot paint.png")
def measured(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help=f"Measured BRDFs: {FORMATS}.")],
    plot_file: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also draw slices, lobes and albedos: .png, .svg, .pdf or .jpg."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        parameters_option("What files hold that do not state it: f or f cos.", "quantity=NAME"),
    ] = None,
    json_file: Annotated[Path | None, file_option("--json", "Also write all findings to this file.")] = None,
) -> None:
    """Tell what files with measured BRDFs hold: grid, range and symmetry, how much is negative or missing, errors of
    reciprocity, albedos."""
    from ..measured import read, summarize  # imports numpy

    if plot_file is not None:
        _check_picture(plot_file)
    held = quantity_of(parameters_of(parameters))
    drawn, findings, failed = [], [], 0
    for file in files:
        try:
            measurement = read(file, held)
            summary = summarize(measurement)
        except ValueError as error:
            err.print(f"mi-brdfs: {one_line(error)}")
            failed += 1
            continue
        if len(files) > 1:
            out.print(summary.file, style="bold")
        table = Table(box=None, pad_edge=False, show_header=False)
        for row in summary.rows():
            table.add_row(*row)
        print_table(table)
        if len(files) > 1:
            out.print()
        findings.append(summary.to_dict())
        drawn += [measurement] if plot_file is not None else []
    write_json(json_file, findings)
    if plot_file is not None and drawn:
        _draw(drawn, plot_file)
    if failed:
        raise typer.Exit(Exit.ERROR)


def _check_picture(file: Path) -> None:
    """Fail if no picture can be drawn, or not into this file: before the work."""
    from ..plot.command import PICTURES

    if file.suffix.lower() not in PICTURES:
        fail(f"--plot {file}: write a {', '.join(PICTURES[:-1])} or {PICTURES[-1]}", Exit.USAGE)
    check_output("--plot", file)


def _draw(measurements: list[Measurement], file: Path) -> None:
    from .. import plot
    from ..plot.command import write

    with writing_to(file):
        write(plot.measured(*measurements), file)
    out.print(str(file))
