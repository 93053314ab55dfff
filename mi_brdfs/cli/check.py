"""``mi-brdfs check``"""

from __future__ import annotations

import os
import shlex
import signal
import threading
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import active_children, connection, get_context, parent_process
from pathlib import Path
from typing import Annotated, Any

import mitsuba as mi
import typer

from .. import validation
from ..given import angles_of_incidence
from ..mitsuba import guests
from ..mitsuba.registry import all_models
from ..model import EnergyWarning
from ..parameters.messages import printable
from ..probe.sources import BSDFSource, degrees_of
from ..starting import signals_held
from ..validation import CHECKS, compare
from ..validation.report import Report, block, junit
from .app import command, imported
from .options import (
    PAGES,
    Json,
    Parameters,
    TracingVariant,
    file_option,
    material_argument,
    parameters_of,
    set_tracing_variant,
    source_of,
    sources_of,
    write_json,
    write_text,
)
from .terminal import Exit, err, fail, failing, out, progress, stdout_to_stderr


@command(
    "Validate",
    "check ward:alpha=.05 scene.xml:paint",
    "check --import my_brdf.py lommel --html check.html",
    "check walter:alpha=.3,f0=.9 --against mine.xml",
)
def check(
    targets: Annotated[list[str] | None, material_argument()] = None,
    every: Annotated[bool, typer.Option("--all", help="Check every plugin of the pack.")] = False,
    parameters: Parameters = None,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help=f"Run only this check, of {', '.join(CHECKS)}; may be repeated."),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(metavar="OTHER", help="Compare values with those of this BSDF instead, given as the others are."),
    ] = None,
    angles: Annotated[
        str | None, typer.Option(metavar="DEGREES", help="Angles of incidence. Default: 0,30,60,80.")
    ] = None,
    conserves: Annotated[
        bool, typer.Option("--conserves", help="Let none gain energy, whatever the page of its model says.")
    ] = False,
    significance: Annotated[
        float | None,
        typer.Option(metavar="P", help="How probable it is that a right BSDF fails a statistical test. Default: 0.01."),
    ] = None,
    html_file: Annotated[
        Path | None, file_option("--html", "Also write a page with pictures (extra report).", endings=PAGES)
    ] = None,
    json_file: Json = None,
    junit_file: Annotated[
        Path | None, file_option("--junit", "Also write all findings as JUnit's XML.", endings=[".xml"])
    ] = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, help="Check this many BSDFs in parallel.")] = 1,
    variant: TracingVariant = None,
) -> None:
    """Check BSDFs: sampling, density, energy, reciprocity, components, textures, derivatives. Exit with 1 if any
    fails, with 3 if nothing was judged."""
    if bool(targets) == every:
        fail("name plugins or files to check, or give --all", Exit.USAGE)
    given = parameters_of(parameters)
    options = _options(angles, significance)
    if against is None:
        for name in only or []:
            if name not in CHECKS:
                fail(f"--only {name}: there is no such check; there are {', '.join(CHECKS)}", Exit.USAGE)
        options |= {"only": only or None, "conserves": conserves or None}
    elif only or conserves or significance is not None:
        fail("--against compares values; --only, --conserves and --significance belong to the checks", Exit.USAGE)
    if html_file is not None:
        from ..validation.html import page
    chosen = set_tracing_variant(variant)
    start = time.perf_counter()
    warnings.simplefilter("ignore", EnergyWarning)  # the report says it
    with stdout_to_stderr():
        words = targets or [model.plugins[0] for model in all_models()]
        sources = sources_of(words, given)
        other = None if against is None else source_of(against, {})
        reports = _check_all(sources, other, options, chosen, min(jobs, len(sources)))
        pairs = zip(sources, reports, strict=True)
        again = [_again(*pair, options) if pair[1].failures and other is None else "" for pair in pairs]
    write_json(json_file, [report.to_dict() for report in reports])
    if html_file is not None:
        write_text(html_file, page(reports, again))
    if junit_file is not None:
        write_text(junit_file, junit(reports))
    for report, command_line in zip(reports, again, strict=True):
        for line, style in block(report, out.width):
            out.print(line, style=style)
        if command_line:
            out.print(printable(f"    Again: {command_line}"))
    err.print(f"{len(reports)} checked in {time.perf_counter() - start:.1f} s, {chosen}.")
    if any(report.failures for report in reports):
        raise typer.Exit(Exit.ERROR)
    if not any(report.judged for report in reports):
        raise typer.Exit(Exit.NOT_JUDGED)


def _options(angles: str | None, significance: float | None) -> dict[str, Any]:
    """Return the arguments that are given."""
    options: dict[str, Any] = {}
    if angles is not None:
        with failing(Exit.USAGE, ValueError, about="--angles"):
            options["angles"] = angles_of_incidence(degrees_of(angles))
    if significance is not None:
        if not 0 < significance < 1:
            fail(f"--significance {significance:g}: it must be in (0, 1)", Exit.USAGE)
        options["significance"] = significance
    return options


def _check_all(
    sources: list[BSDFSource], other: BSDFSource | None, options: dict[str, Any], variant: str, jobs: int
) -> list[Report]:
    """Return the reports on all BSDFs, made in separate processes if there are several jobs."""
    each = 1 if other else len(options["only"] or CHECKS)
    reports = []
    with progress("Checking") as bar:
        task = bar.add_task("", total=len(sources) * each)
        if jobs == 1:
            for source in sources:
                bar.update(task, description=source.name)
                reports.append(_check_one(source, other, options, partial(bar.advance, task)))
            return reports
        # Spawned: a process with Dr.Jit's threads must not be forked.
        known = variant, guests.sources()
        with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_start_job, initargs=known) as pool:
            try:
                with signals_held():
                    futures = [pool.submit(_check_one, source, other, options) for source in sources]
                for future in futures:
                    reports.append(future.result())
                    bar.update(task, description=reports[-1].name, advance=each)
            except BrokenProcessPool:
                fail(f"a process ended while it checked, perhaps for want of memory: use fewer jobs than -j {jobs}")
            except BaseException:  # also Ctrl-C
                for process in active_children():
                    process.terminate()
                raise
    return reports


def _check_one(
    source: BSDFSource, other: BSDFSource | None, options: dict[str, Any], on_progress: Any = lambda: None
) -> Report:
    """Return the report on a BSDF in the active variant: on the checks, or on how it compares with another."""
    if other is None:
        return validation.check(source.load(), name=source.name, on_progress=on_progress, **options)
    report = compare(source.load(), other.load(), name=source.name, other_name=other.name, **options)
    on_progress()
    return report


def _start_job(variant: str, sources: list[str]) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as for a shell's background job
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # on Ctrl-C, end without a traceback
    warnings.simplefilter("ignore", EnergyWarning)
    mi.set_variant(variant)
    for source in sources:
        guests.import_models(source)


def _end_with_parent() -> None:
    """End this process with the one that started it, however that ends."""
    parent = parent_process()
    assert parent
    connection.wait([parent.sentinel])
    os._exit(Exit.ERROR)


def _again(source: BSDFSource, report: Report, options: dict[str, Any]) -> str:
    """Return the command that makes the failing checks of a BSDF again, without XML that was given as text."""
    words = [word for module in imported for word in ("--import", module)]
    words += [word for name, value in source.parameters.items() for word in ("-D", f"{name}={value}")]
    words += [word for check in dict.fromkeys(f.check for f in report.failures) for word in ("--only", check)]
    if "angles" in options:
        words += ["--angles", ",".join(f"{angle:g}" for angle in options["angles"])]
    if "significance" in options:
        words += ["--significance", f"{options['significance']:g}"]
    words += ["--conserves"] if options["conserves"] else []
    if source.word.startswith("<"):
        return f"the same XML with {shlex.join(words)}"
    return shlex.join(["mi-brdfs", "check", source.word, *words])
