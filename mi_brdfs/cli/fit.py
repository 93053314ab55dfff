"""``mi-brdfs fit``"""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import TaskProgressColumn
from rich.table import Table

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from ..mitsuba.registry import all_models, find_models
from ..model import Model
from ..parameters.messages import printable
from ..probe.sources import value_of
from .app import command
from .files import check_output
from .options import (
    PAGES,
    Json,
    TracingVariant,
    file_option,
    parameters_of,
    parameters_option,
    set_tracing_variant,
    write_json,
    write_text,
    writing_to,
)
from .terminal import Exit, err, fail, failing, out, print_table, progress, stdout_to_stderr

if TYPE_CHECKING:
    from ..fit import Fit, Observations
    from ..fit.html import Section

TOGETHER = 10
"""The most files that are fitted together: Ctrl-C keeps what was finished before."""

Files = Annotated[list[Path], typer.Argument(metavar="FILE…", help="Measured BRDFs, of any format that is known.")]
Models = Annotated[str, typer.Option("--model", metavar="TYPE,…|all", help="The models, as `list` shows them.")]
Starts = Annotated[int, typer.Option(min=1, help="From how many settings each fit starts.")]
Cut = Annotated[float, typer.Option(min=1, max=90, help="The largest angle to the normal, in degrees.")]


@command(
    "Measure",
    "fit paint.binary --model ward,walter -o report.html",
    "fit paint.binary -o best.xml --json fit.json --save fits",
    name="fit",
)
def fit_(
    files: Files,
    model: Models = "all",
    metric: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="The error to make small: log, l2, ngan, cube-root, bieron-l2 or bieron-log."
        ),
    ] = "log",
    starts: Starts = 10,
    parameters: Annotated[
        list[str] | None,
        parameters_option(
            "Fix a parameter of the models that have it to a number, a word, true, false, #rrggbb or 'r;g;b'; of "
            "a choice, name=a,b fits each; or set the quantity of files that do not state it; may be repeated."
        ),
    ] = None,
    cut: Cut = 80,
    seed: Annotated[int, typer.Option(min=0, help="Of the random starts, and of what is held out.")] = 0,
    image: Annotated[
        bool, typer.Option("--image", help="Rank by FLIP, the error of a rendered picture as an eye sees it.")
    ] = False,
    output: Annotated[
        Path | None,
        file_option(
            "-o", "Also write a page with pictures, or the best fit.", "FILE.html|FILE.xml", (*PAGES, ".xml"), "--html"
        ),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Also write each fit there: FILE-MODEL.xml.")
    ] = None,
    json_file: Json = None,
    variant: TracingVariant = None,
) -> None:
    """Fit models to measured BRDFs, and rank them by their error on directions that were not fitted. Ctrl-C keeps what
    is finished."""
    from ..fit import find_metric

    best = output if output and output.suffix.lower() == ".xml" else None
    report = None if best else output
    if best and len(files) > 1:
        fail(f"-o {output}: it holds one fit, and there are {len(files)} files; give --save FOLDER", Exit.USAGE)
    if save and save.suffix.lower() == ".xml":
        fail(f"--save {save}: name a folder for all fits, or write the best one with -o {save}", Exit.USAGE)
    names_of_files = [_id(file) for file in files]
    if save and (twice := next((name for name in names_of_files if names_of_files.count(name) > 1), None)):
        fail(f"--save {save}: two files are called {twice}; fit them into different folders", Exit.USAGE)
    with failing(Exit.USAGE):
        find_metric(metric)
        models = all_models() if model == "all" else find_models(model.split(","))
        words = parameters_of(parameters)
        quantity = words.pop("quantity", "stated")
        given = _given(words, models)
    if image:
        from ..fit.appearance import evaluator

        evaluator()  # is there, or the error says what brings it
    if report:
        from ..fit.html import page_of  # so is what it needs
    set_tracing_variant(variant, "_ad_rgb")
    if save:
        with writing_to(save):
            save.mkdir(parents=True, exist_ok=True)
        for stem in {_id(file, it.plugins[0]) for file in files for it in models}:
            for path in {save / f"{stem}.xml", *save.glob(f"{stem}_*.xml")}:  # also with choices
                check_output("--save", path, mark=f' id="{path.stem}" type=')
    fits: list[Fit] = []
    complete, seen, failed = True, True, 0
    with stdout_to_stderr():
        try:
            materials, failed = _read(files, quantity, cut, seed)
            failed += _fit_all(materials, models, metric, starts, seed, given, fits)
        except KeyboardInterrupt:
            complete = False
        by_file = groupby(sorted(fits, key=lambda it: it.file), key=lambda it: it.file)
        ranked = [sorted(own, key=lambda it: it.held_out) for _, own in by_file]
        sections: list[Section] = []
        if report or image:
            ranked, seen = _look(ranked, sections if report else None, image, complete)
    for own in ranked:
        print_ranking(own)
    if len(ranked) > 1 and len(models) > 1:
        print_medians(ranked)
    if fits:
        write_json(json_file, [it.to_dict() for own in ranked for it in own])
    finished = len({(it.file, it.bsdf["type"]) for it in fits})
    interrupted = "" if complete else f"Interrupted; {finished} of {len(files) * len(models)} fits were finished."
    if complete and not seen:
        interrupted = "Interrupted; not all pictures were made."
    if report and ranked:
        write_text(report, page_of(sections, interrupted))
    if best and ranked:
        write_text(best, ranked[0][0].to_xml(_id(files[0])) + "\n")
    if save:
        for it in fits:
            name = _id(Path(it.file), it.model)
            write_text(save / f"{name}.xml", it.to_xml(name) + "\n")
    if interrupted:
        err.print(interrupted)
        raise typer.Exit(Exit.INTERRUPTED)
    if failed:
        raise typer.Exit(Exit.ERROR)


def _id(file: Path, *words: str) -> str:
    """Return an id, which is also the name of a file, for what is fitted to a file."""
    return re.sub(r"[^\w-]+", "_", "-".join([file.stem, *words]))


def _given(parameters: dict[str, str], models: list[type[Model]]) -> dict[str, Any]:
    """Return what -D options fix, a tuple where they give several words of a choice. Raise a ValueError if no model has
    such a parameter, or several values are given for what is no choice."""
    from ..fit.unknowns import check_names, default_words

    given: dict[str, Any] = {}
    for name, text in parameters.items():
        check_names(models, [name])
        several = tuple(value_of(part) for part in text.split(","))
        if len(several) > 1 and not any(name in default_words(it) for it in models):
            raise ValueError(f"-D {name}={text}: only a choice can have several values, and {name} is a number")
        given[name] = several if len(several) > 1 else several[0]
    return given


def _read(files: list[Path], quantity: Any, cut: float, seed: int) -> tuple[list[Observations], int]:
    """Return what is fitted, and how many files cannot be, of which it prints why."""
    from ..fit import observe
    from ..measured import read

    materials = []
    for file in files:
        try:
            materials.append(observe(read(file, quantity), cut, seed=seed))
        except ValueError as error:
            err.print(f"mi-brdfs: {one_line(error)}")
    return materials, len(files) - len(materials)


def _fit_all(
    materials: list[Observations],
    models: list[type[Model]],
    metric: str,
    starts: int,
    seed: int,
    given: dict[str, Any],
    fits: list[Fit],
) -> int:
    """Add the fits of all models to all materials, and return how many models cannot be fitted."""
    from ..fit import fit
    from ..fit.unknowns import known_names

    batches = [materials[k : k + TOGETHER] for k in range(0, len(materials), TOGETHER)]
    failed = set()
    with progress("Fitting", TaskProgressColumn()) as bar:
        task = bar.add_task("", total=len(materials) * len(models))
        for batch in batches:
            for model in models:
                name, done = model.plugins[0], bar.tasks[0].completed

                def advance(ended: int, total: int, done: float = done, count: int = len(batch)) -> None:
                    bar.update(task, completed=done + count * ended / total)

                bar.update(task, description=name)
                try:
                    own = {key: value for key, value in given.items() if key in known_names(model)}
                    with unwrapped_ctrl_c():
                        found = fit(batch, name, metric=metric, given=own, starts=starts, seed=seed, progress=advance)
                        for it in found:
                            _ = it.albedo  # a kernel, whose time belongs to the progress
                    fits += found
                except (ValueError, RuntimeError) as error:
                    if name not in failed:
                        bar.console.print(f"mi-brdfs: {one_line(error)}")
                    failed.add(name)
                bar.update(task, completed=done + len(batch))
    return len(failed)


def _look(
    ranked: list[list[Fit]], sections: list[Section] | None, image: bool, complete: bool
) -> tuple[list[list[Fit]], bool]:
    """Render the fits to each material until Ctrl-C is pressed, and add to the sections of the report if there is one.
    Return the fits, in the order of their FLIP errors if ``image``, and whether all were rendered."""
    from ..fit.appearance import MOST, look

    if sections is not None:
        from ..fit.html import section_of
    found = []
    with progress("Rendering") as bar:
        task = bar.add_task("", total=sum(1 + len(own if image else own[:MOST]) for own in ranked))
        for own in ranked:
            section = None
            bar.update(task, description=Path(own[0].file).name)
            if complete:
                try:
                    with unwrapped_ctrl_c():
                        own, shown = look(own, image, lambda: bar.advance(task))
                    section = section_of(own, shown) if sections is not None else None
                except KeyboardInterrupt:
                    complete = False
                except (ValueError, RuntimeError) as error:
                    bar.console.print(f"mi-brdfs: {own[0].file}: no pictures: {one_line(error)}")
            if sections is not None:
                sections.append(section or section_of(own))
            found.append(own)
    return found, complete


# --- What is printed --------------------------------------------------------------------------------------------------


def _table(seen: bool, *columns: str) -> Table:
    """Return a table of models and their errors, with columns of other numbers."""
    table = Table("model", box=None, pad_edge=False)
    for column in (*["FLIP"] * seen, "held out", "fitted", *columns):
        table.add_column(column, justify="right")
    return table


def print_ranking(fits: list[Fit]) -> None:
    """Print the models by their error, and the best one to paste."""
    from ..fit import METRICS
    from ..fit.result import notes, number, values

    best = fits[0]
    out.print(printable(best.file), style="bold")
    seen = best.flip is not None
    table = _table(seen, "ΔBIC", "albedo", "agree")
    table.add_column("notes")
    lowest = min(it.bic for it in fits)
    for it in fits:
        table.add_row(
            it.model, *[number(it.flip)] * seen, f"{it.held_out:.4g}",
            f"{it.errors[it.metric]['fitted']:.4g}",
            f"{it.bic - lowest:.0f}", f"{it.albedo:.3f}", f"{it.starts.agree}/{it.starts.tried}", notes(it, best),
        )  # fmt: skip
    print_table(table)
    out.print(f"Error of {METRICS[best.metric].text}, up to {best.cut:g}°; {best.pairs} pairs of directions fitted.")
    if seen:
        out.print("FLIP (Andersson et al. 2020) is that of a picture of the fit, beside one of the data.")
    out.print()
    parameters = Table(best.model, "", "", box=None, pad_edge=False)
    for name, value, sure in values(best):
        parameters.add_row(name, f"{value:.4g}", sure)
    print_table(parameters)
    out.print(f"\n{best.to_xml()}\n")
    for sentence in best.remarks():
        out.print(sentence)
    out.print()


def print_medians(ranked: list[list[Fit]]) -> None:
    """Print the medians over the files."""
    from ..fit.result import medians, number

    out.print("Medians", style="bold")
    rows = medians(ranked)
    seen = any(row.flip is not None for row in rows)
    table = _table(seen, "files", "best in")
    for row in rows:
        table.add_row(
            row.model, *[number(row.flip)] * seen, f"{row.held_out:.4g}", f"{row.fitted:.4g}",
            str(row.files), str(row.best_in),
        )  # fmt: skip
    print_table(table)
