"""``mi-brdfs convert``"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import mitsuba as mi
import typer

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .app import command
from .options import Parameters, check_output, parameters_of, quantity_of
from .terminal import Exit, err, fail, print_paragraph, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant


@command()
def convert(
    given: Annotated[
        str,
        typer.Argument(
            metavar="IN", help="A measured file; or a BSDF: the type of a plugin, FILE.xml, FILE.xml:ID, or XML."
        ),
    ],
    output: Annotated[
        Path, typer.Argument(metavar="OUT", help="The file to write: .binary (MERL), .bsdf (RGL or Zemax), .csv.")
    ],
    parameters: Parameters = None,
    format: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The format, where several have that ending; by default the first."),
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Write a measured file in another format, or any BSDF as a table, and say how far the two differ."""
    check_output("OUT", output)
    from ..measured import convert as converted
    from ..measured import read
    from ..probe.sources import is_measured  # imports numpy

    is_bsdf = not is_measured(given)
    parts = parameters_of(parameters) if is_bsdf else {}
    quantity: Any = None if is_bsdf else quantity_of(parameters)
    if is_bsdf:
        set_tracing_variant(variant)
    with stdout_to_stderr(), err.status(f"Writing {output.name}"):
        try:
            with unwrapped_ctrl_c():
                result = converted(_bsdf(given, parts) if is_bsdf else read(given, quantity), output, format)
        except OSError as error:
            fail(f"cannot write {output}: {error.strerror or error}")
        except (ValueError, RuntimeError) as error:  # Mitsuba raises both
            fail(one_line(error), Exit.USAGE)
    for line in str(result).splitlines():
        print_paragraph(line)


def _bsdf(word: str, parameters: dict[str, str]) -> dict[str, Any] | mi.BSDF:
    """Return the only BSDF that a word stands for."""
    from ..probe.sources import find_sources

    found = list(find_sources(word, parameters))
    if len(found) > 1:
        words = ", ".join(it.word for it in found)
        raise ValueError(f"{word} has several materials; convert one of {words}")
    return found[0].load()
