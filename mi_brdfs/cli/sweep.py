"""``mi-brdfs sweep``"""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .app import command
from .files import check_output
from .fit import Cut, Files, Models, Starts
from .options import Scheduler, TracingVariant, check_workers, set_tracing_variant
from .terminal import Exit, err, fail, failing, out, progress, stdout_to_stderr

if TYPE_CHECKING:
    from ..sweep import Outcome

TABLES = "md", "csv"


@command("Measure", "sweep paints/*.binary --metric log,cube-root -o results")
def sweep(
    files: Files,
    model: Models = "all",
    metric: Annotated[
        str, typer.Option(metavar="METRIC,…", help="The errors to make small, as `fit` has them.")
    ] = "log",
    starts: Starts = 10,
    cut: Cut = 80,
    seed: Annotated[
        str, typer.Option(metavar="NUMBER,…", help="Of the random starts, and of what is held out: a fit for each.")
    ] = "0",
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Results go there, and finished ones are used.")
    ] = Path("sweep"),
    workers: Annotated[
        int | None, typer.Option(min=0, help="Processes; 0 for none but this. Default: one for each core, up to 8.")
    ] = None,
    scheduler: Scheduler = None,
    render: Annotated[
        bool, typer.Option("--render", help="Also render the materials and their fits: wall_METRIC.jpg.")
    ] = False,
    table: Annotated[
        str, typer.Option(metavar="md|csv", help="Print medians by model and metric, or all fits, a line for each.")
    ] = "md",
    variant: TracingVariant = None,
) -> None:
    """Fit many models to many measured BRDFs, in parallel, and compare them. The same command goes on where it was
    interrupted, and fits only what is new or has changed."""
    from ..sweep import MEDIANS, ClusterError, FileError, Sweep, csv, medians

    if render:
        from .. import gallery  # noqa: F401 -- it says what pictures need
        from ..sweep.wall import Wall
    if table not in TABLES:
        fail(f"--table {table}: there is no such table; there are {', '.join(TABLES)}", Exit.USAGE)
    check_workers(workers, scheduler)
    if (workers or scheduler) and find_spec("distributed") is None:
        fail('workers need the extra "cluster": pip install "mi_brdfs[cluster]"')
    seeds = _numbers(seed)
    set_tracing_variant(variant, "_ad_rgb")
    if workers is None and not scheduler:
        workers = min(os.cpu_count() or 1, 8)
        if find_spec("distributed") is None:
            workers = 0
            err.print('mi-brdfs: one process fits; pip install "mi_brdfs[cluster]" for all cores')
    names = [] if model == "all" else model.split(",")
    try:
        with failing(Exit.USAGE, ValueError), failing(Exit.ERROR, FileError):
            plan = Sweep(files, names, output, metrics=metric.split(","), seeds=seeds, starts=starts, cut=cut)
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fail(f"{output}: {error.strerror}")
    for file in output.glob("wall_*.jpg") if render else ():
        check_output("-o", file)
        if not (output / "pictures").is_dir():
            fail(f"-o: {file} is there, and no such result; name another folder", Exit.USAGE)
    complete, errors, wall = True, list[str](), None
    with stdout_to_stderr():
        try:
            with unwrapped_ctrl_c():
                _follow(plan.fit(workers, scheduler), "fits", plan.total, plan.finished(), errors)
                if render:
                    wall = Wall(plan)
                    _follow(wall.render(workers, scheduler), "pictures", wall.total, wall.finished(), errors)
                    for path in wall.write():
                        err.print(str(path))
        except (ClusterError, OSError) as error:
            full = f"cannot write to {output}: {error.strerror}" if isinstance(error, OSError) else None
            errors.append(full or one_line(error))
            err.print(f"mi-brdfs: {errors[-1]}")
        except KeyboardInterrupt:
            complete = False
    if plan.finished():
        out.print(csv(plan.rows()) if table == "csv" else medians(plan.rows(MEDIANS)))
    kept = f"{plan.finished()} of {plan.total} fits" + (
        f" and {wall.finished()} of {wall.total} pictures" if wall else ""
    )
    if not complete:
        err.print(f"Interrupted; {kept} are finished: the same command goes on from there.")
        raise typer.Exit(Exit.INTERRUPTED)
    if errors:
        err.print(f"{kept} are finished; the same command tries the others again.")
        raise typer.Exit(Exit.ERROR)


def _numbers(text: str) -> list[int]:
    """Return the seeds of the option."""
    try:
        found = [int(number) for number in text.split(",")]
    except ValueError:
        found = [-1]
    if min(found) < 0 or max(found) >= 1 << 63:
        fail(f"--seed {text}: write whole numbers from 0 to 2^63 - 1, as in 0,1,2", Exit.USAGE)
    return list(dict.fromkeys(found))


def _follow(outcomes: Generator[Outcome, None, None], what: str, total: int, finished: int, errors: list[str]) -> None:
    """Show how far something has come, and why parts of it fail, each reason once."""
    with closing(outcomes), progress(f"Sweep of {what}") as bar:
        task = bar.add_task("", total=total, completed=finished)
        for outcome in outcomes:
            bar.advance(task, outcome.size)
            if outcome.error and (sentence := one_line(RuntimeError(outcome.error))) not in errors:
                errors.append(sentence)
                bar.console.print(f"mi-brdfs: {sentence}")
