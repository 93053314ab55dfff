"""``mi-brdfs bench``"""

from __future__ import annotations

import time
from typing import Annotated

from .app import command
from .options import (
    Json,
    Parameters,
    TracingVariant,
    material_argument,
    parameters_of,
    set_tracing_variant,
    sources_of,
    write_json,
)
from .terminal import Exit, err, failing, print_table, progress, stdout_to_stderr


@command("Validate", "bench ward phong:exponent=30", "bench walter roughconductor -D alpha=.3")
def bench(
    targets: Annotated[list[str], material_argument("One or two.")],
    parameters: Parameters = None,
    json_file: Json = None,
    variant: TracingVariant = None,
) -> None:
    """Compare two BSDFs: the efficiency of their samplers, the time of calls and pictures, noise. One alone shows its
    own numbers. Intervals are those of 95 % confidence."""
    given = parameters_of(parameters)
    chosen = set_tracing_variant(variant)
    start = time.perf_counter()
    with stdout_to_stderr(), progress("Measuring") as bar:
        from ..bench.comparison import STAGES, compare

        task = bar.add_task("", total=len(STAGES))
        sources = sources_of(targets, given)
        with failing(Exit.USAGE):
            result = compare(*sources, on_progress=lambda stage: bar.update(
                task, description=stage, completed=STAGES.index(stage)))  # fmt: skip
    write_json(json_file, result.to_dict())
    print_table(result.table())
    err.print(f"Measured in {time.perf_counter() - start:.0f} s, {chosen}.")
