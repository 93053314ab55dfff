"""``mi-brdfs bench``"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ..bench import SECTIONS
from ..bench import bench as measure
from .app import command
from .options import check_names, check_output, write_json
from .terminal import err, out, print_table, progress, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant


@command()
def bench(
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="SECTION", help=f"Measure only one of {', '.join(SECTIONS)}; may be repeated."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write all figures to this file.")
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Measure efficiency, time and noise against Mitsuba's BSDFs: about ten minutes on an idle machine."""
    check_names(only, SECTIONS, "section")
    check_output("--json", json_file)
    chosen = set_tracing_variant(variant)
    start = time.perf_counter()
    with stdout_to_stderr(), progress("Measuring") as bar:
        task = bar.add_task("")
        results = measure(only or None, lambda section, done, of: bar.update(
            task, description=section, completed=done, total=of))  # fmt: skip
    write_json(json_file, results.to_dict())
    for table in results.tables():
        print_table(table)
        out.print()
    for sentence in results.missed:
        out.print(sentence)
    err.print(f"Measured in {time.perf_counter() - start:.0f} s, {chosen}; {len(results.missed)} targets are missed.")
