"""``mi-brdfs fit``"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from ..mitsuba.errors import one_line
from ..mitsuba.registry import all_models, find_models
from .app import command
from .options import check_output, write_json
from .terminal import Exit, err, fail, out, print_table, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant

if TYPE_CHECKING:
    from ..fit import Fit, Observations

TOGETHER = 10
"""The most files that are fitted together: Ctrl-C keeps what was finished before."""


@command("fit")
def fit_(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Measured BRDFs, of any format that is known.")],
    model: Annotated[str, typer.Option(metavar="TYPE,…|all", help="The models, as `list` shows them.")] = "all",
    metric: Annotated[str, typer.Option(metavar="log|l2|ngan|cube-root", help="The error to make small.")] = "log",
    starts: Annotated[int, typer.Option(min=1, help="From how many settings each fit starts.")] = 10,
    cut: Annotated[float, typer.Option(min=1, max=90, help="The largest angle to the normal, in degrees.")] = 80,
    seed: Annotated[int, typer.Option(min=0, help="Of the random starts, and of what is held out.")] = 0,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write all fits to this file.")
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Fit models to measured BRDFs, and rank them by their error on directions that were not fitted. Ctrl-C keeps what
    is finished."""
    from ..fit import find_metric

    check_output("--json", json_file)
    try:
        find_metric(metric)
        models = all_models() if model == "all" else find_models(model.split(","))
    except ValueError as error:
        fail(one_line(error), Exit.USAGE)
    chosen = set_tracing_variant(variant)
    if not chosen.endswith("_ad_rgb"):
        fail(f"this needs an rgb variant with derivatives, not {chosen}", Exit.USAGE if variant else Exit.ERROR)
    names = [it.plugins[0] for it in models]
    fits: list[Fit] = []
    complete, failed = True, 0
    with stdout_to_stderr():
        try:
            materials, failed = _read(files, cut, seed)
            failed += _fit_all(materials, names, metric, starts, seed, fits)
        except KeyboardInterrupt:
            complete = False
    ranked = [list(own) for _, own in groupby(sorted(fits, key=lambda it: it.file), key=lambda it: it.file)]
    for own in ranked:
        _print_ranking(sorted(own, key=lambda it: it.held_out), metric)
    if len(ranked) > 1 and len(names) > 1:
        _print_medians(ranked, metric)
    write_json(json_file, [it.to_dict() for it in fits])
    if not complete:
        err.print(f"Interrupted; {len(fits)} of {len(files) * len(names)} fits were finished.")
        raise typer.Exit(Exit.INTERRUPTED)
    if failed:
        raise typer.Exit(Exit.ERROR)


def _read(files: list[Path], cut: float, seed: int) -> tuple[list[Observations], int]:
    """Return what is fitted, and how many files cannot be, of which it prints why."""
    from ..fit import observe

    materials = []
    for file in files:
        try:
            materials.append(observe(file, cut, seed=seed))
        except ValueError as error:
            err.print(f"mi-brdfs: {one_line(error)}")
    return materials, len(files) - len(materials)


def _fit_all(
    materials: list[Observations], names: list[str], metric: str, starts: int, seed: int, fits: list[Fit]
) -> int:
    """Add the fits of all models to all materials, and return how many models cannot be fitted."""
    from ..fit import fit

    batches = [materials[k : k + TOGETHER] for k in range(0, len(materials), TOGETHER)]
    columns = [TextColumn("Fitting {task.description}", markup=False), BarColumn(), TaskProgressColumn(),
               TimeRemainingColumn()]  # fmt: skip
    failed = set()
    with Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=len(materials) * len(names))
        for batch in batches:
            for name in names:
                done = progress.tasks[0].completed

                def advance(ended: int, total: int, done: float = done, count: int = len(batch)) -> None:
                    progress.update(task, completed=done + count * ended / total)

                progress.update(task, description=name)
                try:
                    found = fit(batch, name, metric=metric, starts=starts, seed=seed, progress=advance)
                    for it in found:
                        _ = it.albedo  # a kernel, whose time belongs to the progress
                    fits += found
                except (ValueError, RuntimeError) as error:
                    if name not in failed:
                        progress.console.print(f"mi-brdfs: {one_line(error)}")
                    failed.add(name)
                progress.update(task, completed=done + len(batch))
    return len(failed)


def _print_ranking(fits: list[Fit], metric: str) -> None:
    """Print the models by their error, and the best one to paste."""
    from ..fit import METRICS

    best = fits[0]
    out.print(best.file, style="bold")
    table = Table("model", "held out", "fitted", "ΔBIC", "albedo", "agree", "notes", box=None, pad_edge=False)
    for column in table.columns[1:6]:
        column.justify = "right"
    lowest = min(it.bic for it in fits)
    for it in fits:
        table.add_row(
            it.model, f"{it.held_out:.4g}", f"{it.errors[metric]['fitted']:.4g}", f"{it.bic - lowest:.0f}",
            f"{it.albedo:.2f}", f"{it.starts.agree}/{it.starts.tried}", _notes(it),
        )  # fmt: skip
    print_table(table)
    out.print(f"Error of {METRICS[metric].text}, up to {best.cut:g}°; {best.pairs} pairs of directions fitted.")
    out.print()
    parameters = Table(best.model, "", "", box=None, pad_edge=False)
    for name, sigma in best.sigma.items():
        value = best.bsdf[name]
        for k, number in enumerate(value["value"] if isinstance(value, dict) else [value]):
            spread = sigma[k] if isinstance(sigma, list) else sigma
            parameters.add_row("" if k else name, f"{number:.4g}", "" if spread is None else f"± {spread:.2g}")
    print_table(parameters)
    out.print(f"\n{best.to_xml()}\n")
    for sentence in best.remarks():
        out.print(sentence)
    out.print()


def _notes(it: Fit) -> str:
    words = ["albedo above 1"] * (it.albedo > 1) + ["unresolved"] * (not it.resolved)
    return ", ".join(words + ([f"at an end: {', '.join(it.bounds)}"] if it.bounds else []))


def _print_medians(ranked: list[list[Fit]], metric: str) -> None:
    """Print the medians over the files."""
    by_model: dict[str, list[Fit]] = {}
    for own in ranked:
        for it in own:
            by_model.setdefault(it.model, []).append(it)
    out.print("Medians", style="bold")
    table = Table("model", "held out", "fitted", "files", "best in", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    winners = [min(own, key=lambda it: it.held_out).model for own in ranked]
    rows = [
        (median(it.held_out for it in own), median(it.errors[metric]["fitted"] for it in own), model, len(own))
        for model, own in by_model.items()
    ]
    for held_out, fitted, model, count in sorted(rows):
        table.add_row(model, f"{held_out:.4g}", f"{fitted:.4g}", str(count), str(winners.count(model)))
    print_table(table)
