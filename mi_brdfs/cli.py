"""The command line ``mi-brdfs``: list, info, doctor, render, gallery, plot, check, bench.

Results go to stdout, errors and progress to stderr. Exit status: 0 fine, 1 error, 2 wrong usage, 130 after Ctrl-C.
"""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from enum import IntEnum
from functools import partial
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from . import doctor as doctor_module
from . import info as manual
from . import llvm
from .registry import all_models

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

if TYPE_CHECKING:
    from .render import Picture
    from .validation import Report
    from .validation.targets import Target

out = Console(markup=False, highlight=False, soft_wrap=True)
err = Console(markup=False, highlight=False, soft_wrap=True, stderr=True)
app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)

LOAD_FILE_ARGUMENTS = ("path", "parallel", "optimize")  # of mi.load_file: no -D parameter can have these names
DISPLAY_SUFFIXES = (".png", ".jpg", ".jpeg")


class Exit(IntEnum):
    """Exit statuses other than 0."""

    ERROR = 1
    USAGE = 2
    INTERRUPTED = 130


def main() -> None:
    """The entry point of the command ``mi-brdfs``."""
    app()


@app.callback()
def _describe() -> None:
    """Classical BRDFs for Mitsuba 3: what there is, what works here, and rendering scenes that use them."""


@app.command("list")
def list_() -> None:
    """List the BRDFs: type, aliases, summary."""
    table = Table("type", "aliases", "summary", box=None, pad_edge=False)
    for model in all_models():
        table.add_row(model.plugins[0], " ".join(model.plugins[1:]), model.summary())
    _print_table(table)


@app.command()
def info(type: Annotated[str, typer.Argument(metavar="TYPE", help="A type or alias that `list` shows.")]) -> None:
    """Show the manual page of a BRDF."""
    try:
        page = manual(type)
    except ValueError as error:
        _fail(one_line(error))
    out.print(_styled(page))


@app.command()
def doctor() -> None:
    """Say which variants work here, which LLVM is used, and what to do about the others."""
    findings = doctor_module.examine()
    table = Table("backend", "state", "", box=None, pad_edge=False)
    colours = {"works": "green", "missing": "yellow"}
    for it in findings:
        table.add_row(it.backend, Text(it.state, colours.get(it.state, "red")), it.detail)
        table.add_row("", "", Text(" ".join(it.variants), "dim"))
    out.print(", ".join(f"{name} {version}" for name, version in doctor_module.versions().items()))
    _print_table(table)
    out.print(doctor_module.next_step(findings))
    if not doctor_module.any_fast(findings):
        raise typer.Exit(Exit.ERROR)


@app.command()
def render(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.xml", help="The scene file.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="out.exr, .png or .jpg; the EXR and a display image are always both written."
        ),
    ] = None,
    variant: Annotated[
        str | None,
        typer.Option(help="Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb, whichever works, else scalar_rgb."),
    ] = None,
    spp: Annotated[int | None, typer.Option(min=1, help="Samples per pixel. Default: the scene's.")] = None,
    define: Annotated[
        list[str] | None, typer.Option("-D", metavar="name=value", help="Set a <default> parameter of the scene.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Another seed gives another noise.")] = 0,
) -> None:
    """Render a scene, progressively; Ctrl-C keeps what is finished."""
    parameters = _parameters(define or [])
    exr, display = _output_files(output or Path(scene.stem + ".exr"))
    chosen = _set_variant(variant)
    start = time.perf_counter()
    try:
        with _stdout_to_stderr():
            picture = _render(_load(scene, parameters), spp, seed)
        seconds = time.perf_counter() - start
        written = _write(picture, exr, display)
    except KeyboardInterrupt:
        err.print("Interrupted; nothing is finished, nothing was written.")
        raise typer.Exit(Exit.INTERRUPTED) from None
    for path in written:
        out.print(str(path))
    if picture.spp < picture.total:
        err.print(f"Interrupted; the image has the {picture.spp} of {picture.total} samples per pixel finished so far.")
        raise typer.Exit(Exit.INTERRUPTED)
    err.print(f"{picture.spp} samples per pixel in {seconds:.1f} s, {chosen}.")


@app.command()
def gallery(
    types: Annotated[
        list[str] | None, typer.Argument(metavar="TYPE…", help="Types or aliases that `list` shows. Default: all.")
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="It is made if it does not exist.")
    ] = Path("gallery"),
    spp: Annotated[
        int, typer.Option(min=1, help="Samples per pixel, rounded up to a power of 4; pictures are denoised.")
    ] = 16,
    size: Annotated[int, typer.Option(min=16, help="Width and height of each picture, in pixels.")] = 192,
    variant: Annotated[
        str | None,
        typer.Option(help="Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb, whichever works, else scalar_rgb."),
    ] = None,
) -> None:
    """Render models with sweeps of their parameters: contact sheets, and a page that shows them. Ctrl-C keeps what is
    finished."""
    try:
        from .gallery import gallery as render_gallery
    except ImportError as error:
        _fail(str(error))
    chosen = _set_variant(variant)
    start, finished, total = time.perf_counter(), 0, 0
    columns = [TextColumn("Rendering {task.description}", markup=False), BarColumn(), MofNCompleteColumn()]
    columns += [TextColumn("pictures,"), TimeRemainingColumn(), TextColumn("left")]
    with _stdout_to_stderr(), Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=None)

        def advance(type: str, done: int, of: int) -> None:
            nonlocal finished, total
            finished, total = done, of
            progress.update(task, description=type, completed=done, total=of)

        try:
            render_gallery(types or (), output, spp, size, advance)
        except ValueError as error:
            _fail(one_line(error), Exit.USAGE)
        except OSError as error:
            _fail(f"cannot write to the folder {output}: {error.strerror}")
        except RuntimeError as error:
            _fail(one_line(error))
        except KeyboardInterrupt:
            pass
    if finished:
        out.print(str(output / "index.html"))
    if not finished or finished < total:
        kept = f"it has {finished} of {total} pictures" if finished else "nothing is finished, nothing was written"
        err.print(f"Interrupted; {kept}.")
        raise typer.Exit(Exit.INTERRUPTED)
    err.print(f"{total} pictures in {time.perf_counter() - start:.0f} s, {chosen}.")


@app.command()
def plot(
    targets: Annotated[
        list[str],
        typer.Argument(metavar="TYPE|FILE.xml|XML…", help="Plugins, of the pack or not; files with a scene or BSDF."),
    ],
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--param",
            metavar="name=value",
            help="Set a parameter of each TYPE, to a number, a word, true, false, #rrggbb or 'r;g;b'; name=a,b,c draws "
            "each of the values.",
        ),
    ] = None,
    kind: Annotated[
        str, typer.Option(metavar="KIND", help="polar, cartesian, hemisphere, albedo or sphere.")
    ] = "polar",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="A .png, .svg, .pdf or .jpg; of sphere .html.")
    ] = None,
    angles: Annotated[
        str | None, typer.Option(metavar="DEGREES", help="Of incidence. Default: 10,40,70; of sphere 45.")
    ] = None,
    azimuth: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="Of incidence, from dp_du. Default: 0.")
    ] = None,
    scale: Annotated[
        str | None,
        typer.Option(metavar="SCALE", help="linear, log or both, of polar, cartesian, sphere. Default: both."),
    ] = None,
    variant: Annotated[
        str | None, typer.Option(help="Vectorized and unpolarized. Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb.")
    ] = None,
) -> None:
    """Draw the lobes of BSDFs, one or several to compare: in the plane of incidence (polar, cartesian), over the
    hemisphere, their albedos, or as bodies to turn in a browser (sphere)."""
    try:
        from .plot import command
    except ImportError as error:
        _fail(str(error))
    if kind not in command.KINDS:
        _fail(f"--kind {kind}: there is no such kind; there are {', '.join(command.KINDS)}", Exit.USAGE)
    try:
        bsdfs = command.asked_for(targets, parameters or [])
        options = command.options_of(kind, angles, azimuth, scale)
        file = command.output_file(output, kind, targets)
    except ValueError as error:
        _fail(str(error), Exit.USAGE)
    _check_folder("-o", output)
    _set_tracing_variant(variant)
    with _stdout_to_stderr(), _interruptible():
        try:
            figure = command.KINDS[kind](*bsdfs, **options)
        except ImportError as error:
            _fail(str(error))
        except (ValueError, RuntimeError) as error:  # Mitsuba's are of both kinds
            _fail(one_line(error), Exit.USAGE)
        try:
            command.write(figure, file)
        except OSError as error:
            _fail(f"cannot write {file}: {error.strerror}")
    out.print(str(file))


@app.command()
def check(
    targets: Annotated[
        list[str] | None,
        typer.Argument(metavar="TYPE|FILE.xml|XML…", help="Plugins, of the pack or not; files with a scene or BSDF."),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Check every plugin of the pack.")] = False,
    html_file: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Write a report with pictures to this file, too.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all findings to this file, too.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Run this check alone; may be repeated.")
    ] = None,
    jobs: Annotated[int, typer.Option("-j", "--jobs", min=1, help="Check so many BSDFs at the same time.")] = 1,
    variant: Annotated[
        str | None, typer.Option(help="Vectorized and unpolarized. Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb.")
    ] = None,
) -> None:
    """Check BSDFs: sampling, density, energy, reciprocity, components, textures, derivatives. Exit status 1 if one
    fails."""
    from .validation import CHECKS
    from .validation.targets import find_targets

    _check_names(only, CHECKS, "check")
    if bool(targets) == every:
        _fail("name plugins or files to check, or give --all", Exit.USAGE)
    _check_folder("--html", html_file)
    _check_folder("--json", json_file)
    chosen = _set_tracing_variant(variant)
    start = time.perf_counter()
    with _stdout_to_stderr():
        found = []
        for word in targets or [model.plugins[0] for model in all_models()]:
            try:
                found += find_targets(word)
            except Exception as error:
                text = one_line(error)
                _fail(text if text.startswith(word) else f"{word}: {text}", Exit.USAGE)
        with _interruptible():
            reports = _check_all(found, only or None, chosen, min(jobs, len(found)))
    _write_json(json_file, [report.to_dict() for report in reports])
    if html_file is not None:
        from .validation.html import page

        html_file.write_text(page(reports), encoding="utf-8")
    _print_reports(reports)
    err.print(f"{len(reports)} checked in {time.perf_counter() - start:.1f} s, {chosen}.")
    if not all(report.passed for report in reports):
        raise typer.Exit(Exit.ERROR)


def _check_all(targets: list[Target], only: list[str] | None, variant: str, jobs: int) -> list[Report]:
    """The reports on all targets, from processes of their own if there are several jobs."""
    from .validation import CHECKS

    subject = TextColumn("Checking {task.description}", markup=False)
    columns = [subject, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()]
    each = len(only or CHECKS)
    reports = []
    with Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=len(targets) * each)
        if jobs == 1:
            for target in targets:
                progress.update(task, description=target.name)
                reports.append(target.check(only, on_progress=partial(progress.advance, task)))
            return reports
        # Started anew: a process with Dr.Jit's threads must not be forked.
        pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_start_job, initargs=(variant,))
        with pool, _ending_processes():
            for future in [pool.submit(target.check, only) for target in targets]:
                reports.append(future.result())
                progress.update(task, description=reports[-1].name, advance=each)
    return reports


def _start_job(variant: str) -> None:
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as it is for a shell's job in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # on Ctrl-C, end without a traceback
    mi.set_variant(variant)


@contextmanager
def _ending_processes() -> Iterator[None]:
    """Let the processes end at once after an error or Ctrl-C."""
    try:
        yield
    except BaseException:
        for process in active_children():
            process.terminate()
        raise


@app.command()
def bench(
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="SECTION", help="Measure this alone; may be repeated.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write all figures to this file, too.")
    ] = None,
    variant: Annotated[
        str | None, typer.Option(help="Vectorized and unpolarized. Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb.")
    ] = None,
) -> None:
    """Measure efficiency, time and noise beside Mitsuba's BSDFs, some ten minutes on a machine that is not busy."""
    from .bench import SECTIONS
    from .bench import bench as measure

    _check_names(only, SECTIONS, "section")
    _check_folder("--json", json_file)
    chosen = _set_tracing_variant(variant)
    start = time.perf_counter()
    columns = [TextColumn("Measuring {task.description}", markup=False), BarColumn(), MofNCompleteColumn()]
    with _stdout_to_stderr(), Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("")
        with _interruptible():
            results = measure(only or None, lambda section, done, of: progress.update(
                task, description=section, completed=done, total=of))  # fmt: skip
    _write_json(json_file, results.to_dict())
    for table in results.tables():
        _print_table(table)
        out.print()
    for sentence in results.missed:
        out.print(sentence)
    err.print(f"Measured in {time.perf_counter() - start:.0f} s, {chosen}; {len(results.missed)} targets are missed.")


def _print_reports(reports: list[Report]) -> None:
    """A row for each report, and below what failed."""
    words = {"fail": ("FAIL", "red"), "pass": ("pass", "green"), "skip": ("skip", "yellow"), None: ("-", "dim")}
    checks = list(dict.fromkeys(finding.check for report in reports for finding in report.findings))
    table = Table("type", *checks, box=None, pad_edge=False)
    for report in reports:
        verdicts = [report.verdict(name) for name in checks]
        table.add_row(report.name, *(Text(*words.get(verdict, (verdict, "dim"))) for verdict in verdicts))
    _print_table(table)
    for report in reports:
        for finding in report.failures:
            out.print(f"{report.name}: {finding.check}: {finding.subject}: {finding.message}")
        if report.why_not_judged:
            out.print(f"{report.name}: {report.why_not_judged}")


def one_line(error: BaseException) -> str:
    """Reduce an exception of Mitsuba to its cause, in one line, with the place in the scene file if it is known."""
    while error.__cause__:  # render-time errors keep their cause there
        error = error.__cause__
    text = re.sub(r"\[\w+\.cpp:\d+\] ", "", str(error)) or type(error).__name__
    place = None
    for match in re.finditer(r"(?:At|[Ww]hile loading) (.+?) \(line (\d+), col \d+\): ", text):
        place, rest = match, text[match.end() :]
    broken = re.search(r'Parsing of XML file "(.+)" failed: (.+) \(line (\d+), col \d+\)', text)
    unused = re.findall(r"^ +- \$([^=]+)=", text, re.MULTILINE) if "unused parameters" in text else []
    if broken:
        return f"{broken[1]}: line {broken[3]}: {broken[2]}"
    if unused:
        return f"-D {', '.join(unused)}: the scene has no <default> parameter of this name"
    sentence = _last_of_traceback(rest if place else text)
    return f"{place[1]}: line {place[2]}: {sentence}" if place else sentence


def _last_of_traceback(text: str) -> str:
    """The exception's message if ``text`` holds a Python traceback, else ``text``, in one line."""
    _, traceback, tail = text.partition("Traceback (most recent call last):")
    if traceback:
        text = re.split(r"^[\w.]+(?:Error|Exception|Warning): ", tail, flags=re.MULTILINE)[-1]
    # Nothing that a scene file says may command the terminal.
    return "".join(character for character in " ".join(text.split()) if character.isprintable())


def _print_table(table: Table) -> None:
    """One line a row where another program reads it."""
    console = Console(markup=False, highlight=False, width=None if out.is_terminal else 400)
    console.print(table)


def _fail(text: str, status: Exit = Exit.ERROR) -> NoReturn:
    err.print(f"mi-brdfs: {text}")
    raise typer.Exit(status)


def _parameters(definitions: list[str]) -> dict[str, str]:
    parameters = {}
    for definition in definitions:
        name, equals, value = definition.partition("=")
        if not equals or not name:
            _fail(f"-D {definition}: write -Dname=value", Exit.USAGE)
        if name in LOAD_FILE_ARGUMENTS:
            _fail(f"-D {name}: Mitsuba keeps this name for itself; rename the parameter in the scene", Exit.USAGE)
        parameters[name] = value
    return parameters


def _output_files(output: Path) -> tuple[Path, Path]:
    """The EXR and the display image that ``output`` asks for, if they can be written."""
    suffix = output.suffix.lower()
    if suffix != ".exr" and suffix not in DISPLAY_SUFFIXES:
        _fail(f"{output}: unknown image format; use .exr, .png or .jpg", Exit.USAGE)
    files = (output, output.with_suffix(".png")) if suffix == ".exr" else (output.with_suffix(".exr"), output)
    for file in files:
        if file.is_dir():
            _fail(f"{file} is a folder")
    try:
        tempfile.TemporaryFile(dir=output.parent).close()
    except OSError as error:
        _fail(f"cannot write to the folder {output.parent}: {error.strerror}")
    return files


def _check_names(names: list[str] | None, known: Collection[str], kind: str) -> None:
    for name in names or []:
        if name not in known:
            _fail(f"--only {name}: there is no such {kind}; there are {', '.join(known)}", Exit.USAGE)


@contextmanager
def _interruptible() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        err.print("Interrupted; nothing was written.")
        raise typer.Exit(Exit.INTERRUPTED) from None


def _write_json(file: Path | None, data: list | dict) -> None:
    if file is not None:
        file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _check_folder(option: str, file: Path | None) -> None:
    if file is not None and not file.absolute().parent.is_dir():
        _fail(f"{option} {file}: there is no folder {file.parent}", Exit.USAGE)


def _set_variant(wanted: str | None) -> str:
    """Activate the variant asked for, or the fastest that works."""
    if wanted:
        _refuse(wanted)
        try:
            mi.set_variant(wanted)
        except ImportError:
            _fail(f"{wanted} does not work on this machine; `mi-brdfs doctor` says why")
        return wanted
    for name in ("cuda_ad_rgb", "metal_ad_rgb", "llvm_ad_rgb"):
        if name not in mi.variants():
            continue
        if name.startswith("llvm") and (text := llvm.problem()):
            err.print(f"mi-brdfs: using scalar_rgb, which is slow: {text}")
            continue
        try:
            mi.set_variant(name)
            return name
        except ImportError:
            continue
    mi.set_variant("scalar_rgb")
    return "scalar_rgb"


def _set_tracing_variant(wanted: str | None) -> str:
    """The same, of those that check and bench work in."""
    chosen = _set_variant(wanted)
    if chosen.startswith("scalar") or "polarized" in chosen:
        _fail(f"this needs a vectorized and unpolarized variant, not {chosen}", Exit.USAGE if wanted else Exit.ERROR)
    return chosen


def _refuse(variant: str) -> None:
    if variant not in mi.variants():
        _fail(f"there is no variant {variant}; this Mitsuba has {', '.join(mi.variants())}")
    if variant.startswith("llvm") and (text := llvm.problem()):
        _fail(text)


@contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Send to stderr what Mitsuba prints to stdout, its warnings.

    At the level of the operating system: its log may speak inside a signal handler, where no Python may run.
    """
    sys.stdout.flush()
    stdout = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(stdout, 1)
        os.close(stdout)


def _load(path: Path, parameters: dict[str, str]) -> mi.Scene:
    if not path.is_file():
        _fail(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    try:
        scene = mi.load_file(str(path), **parameters)
    except Exception as error:
        _fail(one_line(error))
    if not isinstance(scene, mi.Scene):
        _fail(f"{path} does not hold a <scene>")
    if not scene.sensors():
        _fail(f"{path}: the scene has no <sensor>")
    if not scene.integrator():
        _fail(f"{path}: the scene has no <integrator>")
    return scene


def _render(scene: mi.Scene, spp: int | None, seed: int) -> Picture:
    from .render import render  # imports numpy

    columns = [
        TextColumn("Rendering"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("samples per pixel,"),
        TimeRemainingColumn(),
        TextColumn("left"),
    ]
    with Progress(*columns, console=err, disable=not err.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=None)
        with _answer_ctrl_c(lambda: err.print("Stopping; Ctrl-C again aborts at once.")):
            try:
                return render(
                    scene, spp, seed, on_pass=lambda done, total: progress.update(task, completed=done, total=total)
                )
            except Exception as error:
                _fail(one_line(error))


@contextmanager
def _answer_ctrl_c(announce: Callable[[], None]) -> Iterator[None]:
    """Answer Ctrl-C at once, where Python's own handlers wait for the pass to end; the second ends the process."""
    ours, written_by_python = socket.socketpair()
    written_by_python.setblocking(False)

    def watch() -> None:
        pressed = 0
        while received := ours.recv(64):
            pressed += received.count(signal.SIGINT)
            if pressed > 1:
                err.show_cursor(True)
                err.print("Aborted; nothing was written.")
                os._exit(Exit.INTERRUPTED)
            if pressed == 1:
                announce()

    previous = signal.set_wakeup_fd(written_by_python.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(previous)
        written_by_python.close()
        watcher.join()
        ours.close()


def _write(picture: Picture, exr: Path, display: Path) -> list[Path]:
    from .render import display_image, write

    image = display_image(picture.bitmap)
    files = [(picture.bitmap, exr), (image, display)]
    if image is None:
        err.print(f"The film has no RGB, XYZ or luminance channels, so there is no {display.name}.")
        files.pop()
    try:
        for bitmap, path in files:
            write(bitmap, path)
    except Exception as error:
        _fail(f"cannot write {path}: {one_line(error)}")
    return [path for _, path in files]


def _styled(page: str) -> Text:
    """A manual page for the terminal: literals and headings by style instead of by reStructuredText's marks."""
    lines = re.sub(r":\w+:`([^`]+)`", r"\1", page).splitlines()
    text = Text()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if _underlines(line):
            continue
        heading = bool(line.strip()) and _underlines(following)
        for index, part in enumerate(line.split("``")):
            text.append(part, "bold" if heading else "cyan" if index % 2 else "")
        text.append("\n")
    return text


def _underlines(line: str) -> bool:
    return re.fullmatch(r"(=|-|~){3,}", line.strip()) is not None


if __name__ == "__main__":
    sys.exit(main())
