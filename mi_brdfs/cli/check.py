"""``mi-brdfs check``"""

from __future__ import annotations

import signal
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mitsuba as mi
import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from ..mitsuba import guests
from ..mitsuba.registry import all_models
from .app import command
from .errors import one_line
from .interrupts import ending_processes, interruptible
from .options import check_folder, check_names, write_json
from .terminal import Exit, err, fail, out, print_table, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant

if TYPE_CHECKING:
    from ..measure.sources import BSDFSource
    from ..validation import Report


@command()
def check(
    targets: Annotated[
        list[str] | None,
        typer.Argument(metavar="TYPE|FILE.xml|XML…", help="Plugins of the pack or others; files with a scene or BSDF."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Check every plugin of the pack.")] = False,
    html_file: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Also write a report with pictures to this file.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write all findings to this file.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Run only this check; may be repeated.")
    ] = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, help="Check this many BSDFs in parallel.")] = 1,
    variant: TracingVariant = None,
) -> None:
    """Check BSDFs: sampling, density, energy, reciprocity, components, textures, derivatives. Exit with 1 if any
    fails."""
    from ..measure.sources import find_sources
    from ..validation import CHECKS

    check_names(only, CHECKS, "check")
    if bool(targets) == every:
        fail("name plugins or files to check, or give --all", Exit.USAGE)
    check_folder("--html", html_file)
    check_folder("--json", json_file)
    chosen = set_tracing_variant(variant)
    start = time.perf_counter()
    with stdout_to_stderr():
        found = []
        for word in targets or [model.plugins[0] for model in all_models()]:
            try:
                found += find_sources(word)
            except Exception as error:
                text = one_line(error)
                fail(text if text.startswith(word) else f"{word}: {text}", Exit.USAGE)
        with interruptible():
            reports = _check_all(found, only or None, chosen, min(jobs, len(found)))
    write_json(json_file, [report.to_dict() for report in reports])
    if html_file is not None:
        from ..validation.html import page

        html_file.write_text(page(reports), encoding="utf-8")
    _print_reports(reports)
    err.print(f"{len(reports)} checked in {time.perf_counter() - start:.1f} s, {chosen}.")
    if not all(report.passed for report in reports):
        raise typer.Exit(Exit.ERROR)


def _check_all(sources: list[BSDFSource], only: list[str] | None, variant: str, jobs: int) -> list[Report]:
    """Return the reports on all BSDFs, made in separate processes if there are several jobs."""
    from ..validation import CHECKS

    subject = TextColumn("Checking {task.description}", markup=False)
    columns = [subject, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()]
    each = len(only or CHECKS)
    reports = []
    with Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=len(sources) * each)
        if jobs == 1:
            for source in sources:
                progress.update(task, description=source.name)
                reports.append(_check_one(source, only, on_progress=partial(progress.advance, task)))
            return reports
        # Spawned: a process with Dr.Jit's threads must not be forked.
        known = variant, guests.sources()
        pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_start_job, initargs=known)
        with pool, ending_processes():
            for future in [pool.submit(_check_one, source, only) for source in sources]:
                reports.append(future.result())
                progress.update(task, description=reports[-1].name, advance=each)
    return reports


def _check_one(source: BSDFSource, only: list[str] | None, **given: Any) -> Report:
    """Return the report on a BSDF in the active variant."""
    from ..validation import check

    return check(source.load(), name=source.name, only=only, **given)


def _start_job(variant: str, sources: list[str]) -> None:
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as for a shell's background job
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # on Ctrl-C, end without a traceback
    for source in sources:
        guests.import_models(source)
    mi.set_variant(variant)


def _print_reports(reports: list[Report]) -> None:
    """Print a row for each report, and below them what failed."""
    words = {"fail": ("FAIL", "red"), "pass": ("pass", "green"), "skip": ("skip", "yellow"), None: ("-", "dim")}
    checks = list(dict.fromkeys(finding.check for report in reports for finding in report.findings))
    table = Table("type", *checks, box=None, pad_edge=False)
    for report in reports:
        verdicts = [report.verdict(name) for name in checks]
        table.add_row(report.name, *(Text(*words.get(verdict, (verdict, "dim"))) for verdict in verdicts))
    print_table(table)
    for report in reports:
        for finding in report.failures:
            out.print(f"{report.name}: {finding.check}: {finding.subject}: {finding.message}")
        if report.why_not_judged:
            out.print(f"{report.name}: {report.why_not_judged}")
