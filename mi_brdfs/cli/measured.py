"""``mi-brdfs measured``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from ..mitsuba.errors import one_line
from .app import command
from .options import FIGURES, Json, file_option, parameters_of, parameters_option, quantity_of, write_json, writing_to
from .terminal import Exit, err, out, print_table

FORMATS = "MERL, RGL, MBSDF, Zemax, LightTools, ALTA, Cornell, CSV or UTIA"
"""Those that can be read, as the help says, which does not wait for the readers."""


@command("Measure", "measured paint.binary --plot paint.png")
def measured(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help=f"Measured BRDFs: {FORMATS}.")],
    plot_file: Annotated[
        Path | None,
        file_option("--plot", "Also draw slices, lobes and albedos: .png, .svg, .pdf or .jpg.", endings=FIGURES),
    ] = None,
    parameters: Annotated[
        list[str] | None, parameters_option("What files hold that do not state it: f or f cos.", "quantity=NAME")
    ] = None,
    json_file: Json = None,
) -> None:
    """Tell what files with measured BRDFs hold: grid, range and symmetry, how much is negative or missing, errors of
    reciprocity, albedos."""
    from ..measured import read, summarize  # imports numpy

    if plot_file is not None:
        from .. import plot  # what it needs is there, or the error says what brings it
        from ..plot.command import write
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
        with writing_to(plot_file):
            write(plot.measured(*drawn), plot_file)
        out.print(str(plot_file))
    if failed:
        raise typer.Exit(Exit.ERROR)
