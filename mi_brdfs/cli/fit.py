"""``mi-brdfs fit``"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import TaskProgressColumn

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from ..mitsuba.registry import all_models, find_models
from ..model import Model
from ..probe.sources import value_of
from .app import command
from .fit_tables import print_medians, print_ranking
from .options import check_output, parameters_of, write_json, write_text
from .terminal import Exit, err, fail, progress, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant

if TYPE_CHECKING:
    from ..fit import Fit, Observations
    from ..fit.html import Page

TOGETHER = 10
"""The most files that are fitted together: Ctrl-C keeps what was finished before."""


@command("fit")
def fit_(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="Measured BRDFs, of any format that is known.")],
    model: Annotated[str, typer.Option(metavar="TYPE,…|all", help="The models, as `list` shows them.")] = "all",
    metric: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="The error to make small: log, l2, ngan, cube-root, bieron-l2 or bieron-log."
        ),
    ] = "log",
    starts: Annotated[int, typer.Option(min=1, help="From how many settings each fit starts.")] = 10,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "-D",
            "--param",
            metavar="name=value",
            help="Fix a parameter of the models that have it to a number, a word, true, false, #rrggbb or 'r;g;b'; of "
            "a choice, name=a,b fits each; or set the quantity of files that do not state it; may be repeated.",
        ),
    ] = None,
    cut: Annotated[float, typer.Option(min=1, max=90, help="The largest angle to the normal, in degrees.")] = 80,
    seed: Annotated[int, typer.Option(min=0, help="Of the random starts, and of what is held out.")] = 0,
    image: Annotated[
        bool, typer.Option("--image", help="Rank by FLIP, the error of a rendered picture as an eye sees it.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.html", help="Also write a page with pictures.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write all fits to this file.")
    ] = None,
    variant: TracingVariant = None,
) -> None:
    """Fit models to measured BRDFs, and rank them by their error on directions that were not fitted. Ctrl-C keeps what
    is finished."""
    from ..fit import find_metric

    check_output("--json", json_file)
    check_output("-o", output)
    if output and output.suffix.lower() not in (".html", ".htm"):
        fail(f"-o {output}: the report is a page; give it a name that ends in .html", Exit.USAGE)
    try:
        find_metric(metric)
        models = all_models() if model == "all" else find_models(model.split(","))
        words = parameters_of(parameters)
        quantity = words.pop("quantity", "stated")
        given = _given(words, models)
        page = _page(image, output)
    except ValueError as error:
        fail(one_line(error), Exit.USAGE)
    except ImportError as error:
        fail(str(error))
    chosen = set_tracing_variant(variant)
    if not chosen.endswith("_ad_rgb"):
        fail(f"this needs an rgb variant with derivatives, not {chosen}", Exit.USAGE if variant else Exit.ERROR)
    names = [it.plugins[0] for it in models]
    fits: list[Fit] = []
    complete, seen, failed = True, True, 0
    with stdout_to_stderr():
        try:
            materials, failed = _read(files, quantity, cut, seed)
            failed += _fit_all(materials, names, metric, starts, seed, given, fits)
        except KeyboardInterrupt:
            complete = False
        by_file = groupby(sorted(fits, key=lambda it: it.file), key=lambda it: it.file)
        ranked = [sorted(own, key=lambda it: it.held_out) for _, own in by_file]
        if page or image:
            ranked, seen = _look(ranked, page, image, complete)
    for own in ranked:
        print_ranking(own)
    if len(ranked) > 1 and len(names) > 1:
        print_medians(ranked)
    write_json(json_file, [it.to_dict() for own in ranked for it in own])
    finished = len({(it.file, it.bsdf["type"]) for it in fits})
    interrupted = "" if complete else f"Interrupted; {finished} of {len(files) * len(names)} fits were finished."
    if complete and not seen:
        interrupted = "Interrupted; not all pictures were made."
    if page and output and ranked:
        write_text(output, page.text(interrupted))
    if interrupted:
        err.print(interrupted)
        raise typer.Exit(Exit.INTERRUPTED)
    if failed:
        raise typer.Exit(Exit.ERROR)


def _page(image: bool, output: Path | None) -> Page | None:
    """Return an empty report if one is wanted.

    Raises:
        ImportError: if what it or FLIP needs is not installed.
    """
    if image:
        from ..fit.appearance import evaluator

        evaluator()
    if not output:
        return None
    from ..fit.html import Page

    return Page()


def _given(parameters: dict[str, str], models: list[type[Model]]) -> dict[str, Any]:
    """Return what -D options fix, a tuple where they give several words of a choice.

    Raises:
        ValueError: if no model has such a parameter, or several values are given for what is no choice.
    """
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
    names: list[str],
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
        task = bar.add_task("", total=len(materials) * len(names))
        for batch in batches:
            for name in names:
                done = bar.tasks[0].completed

                def advance(ended: int, total: int, done: float = done, count: int = len(batch)) -> None:
                    bar.update(task, completed=done + count * ended / total)

                bar.update(task, description=name)
                try:
                    (each,) = find_models([name])
                    own = {key: value for key, value in given.items() if key in known_names(each)}
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


def _look(ranked: list[list[Fit]], page: Page | None, image: bool, complete: bool) -> tuple[list[list[Fit]], bool]:
    """Render the fits to each material until Ctrl-C is pressed, and add them to the report if there is one. Return
    them, in the order of their FLIP errors if ``image``, and whether all were rendered."""
    from ..fit.appearance import MOST, Appearance, by_flip, render

    found = []
    with progress("Rendering") as bar:
        task = bar.add_task("", total=sum(1 + len(own if image else own[:MOST]) for own in ranked))
        for own in ranked:
            shown: Appearance | None = None
            bar.update(task, description=Path(own[0].file).name)
            if complete:
                try:
                    with unwrapped_ctrl_c():
                        shown = render(own if image else own[:MOST], lambda: bar.advance(task))
                    own, shown = by_flip(own, shown) if image else (own, shown)
                    if page:
                        page.add(own, shown)
                except KeyboardInterrupt:
                    complete, shown = False, None
                except (ValueError, RuntimeError) as error:
                    shown = None
                    bar.console.print(f"mi-brdfs: {own[0].file}: no pictures: {one_line(error)}")
            if page and not shown:
                page.add(own)
            found.append(own)
    return found, complete
