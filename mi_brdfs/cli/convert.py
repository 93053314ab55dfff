"""``mi-brdfs convert``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .app import command
from .options import (
    Parameters,
    TracingVariant,
    material_argument,
    parameters_of,
    quantity_of,
    set_tracing_variant,
    source_of,
    writing_to,
    written,
)
from .terminal import Exit, err, failing, print_paragraph, stdout_to_stderr


@command("Measure", "convert paint.bsdf paint.binary", "convert fit.json:walter paint.csv")
def convert(
    given: Annotated[str, material_argument(metavar="MATERIAL")],
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="The file to write: .binary (MERL), .bsdf (RGL or Zemax), .csv.",
            callback=written("OUT"),
        ),
    ],
    parameters: Parameters = None,
    format: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The format, where several have that ending; by default the first."),
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Write a measured file in another format, or any BSDF as a table, and say how far the two differ."""
    from ..measured import convert as converted
    from ..measured import read
    from ..probe.sources import is_measured, split  # imports numpy

    with failing(Exit.USAGE):
        word, own = split(given)
    is_file = is_measured(word)
    values = parameters_of(parameters) | own
    quantity: Any = quantity_of(values) if is_file else None
    if not is_file:
        set_tracing_variant(variant)
    with stdout_to_stderr(), err.status(f"Writing {output.name}"), writing_to(output), failing(Exit.USAGE):
        taken = read(word, quantity) if is_file else source_of(word, values, "convert").load()
        result = converted(taken, output, format)
    for line in str(result).splitlines():
        print_paragraph(line)
