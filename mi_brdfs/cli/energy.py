"""``mi-brdfs energy``"""

from __future__ import annotations

import time
from math import isinf
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from rich.table import Table
from rich.text import Text

from ..mitsuba.registry import ENERGY, find_models, is_own, own_models
from ..model import Energy, Model
from ..writing import write_text
from .app import command
from .options import TracingVariant, Types, set_tracing_variant
from .terminal import Exit, err, failing, out, print_table, progress, stdout_to_stderr

if TYPE_CHECKING:
    from ..probe.largest_albedo import Maximum

LINE = 80
"""The length beyond which the statement is broken into several lines."""


class Measured(NamedTuple):
    """A model with the largest albedo of its defaults, and its configurations with the brightest setting of each."""

    model: type[Model]
    default: float
    found: list[tuple[dict[str, Any], Maximum]]


@command("Develop", "energy walter --check", "energy --import my_brdf.py lommel")
def energy(
    names: Types = None,
    check: Annotated[
        bool, typer.Option("--check", help="Compare with what the classes state. Exit with 1 if any of it is wrong.")
    ] = False,
    write: Annotated[
        bool, typer.Option("--write", help="Write what is found of the pack's own models to their data file.")
    ] = False,
    variant: TracingVariant = None,
) -> None:
    """Measure the largest albedo of models, by default and in white for each choice, and print the line of code that
    states it in the class."""
    with failing(Exit.USAGE):
        models = find_models(names)
    if check:
        for model in models:
            if model.energy is None:
                err.print(f"{model.plugins[0]} states no energy.")
        models = [model for model in models if model.energy is not None]
    chosen = set_tracing_variant(variant)
    start = time.perf_counter()
    with stdout_to_stderr():
        measured = _measure_all(models)
    wrong = check and _print_comparison(measured)
    if not check:
        _print_statements(measured)
    if write:
        _write(measured)
    err.print(f"{len(models)} measured in {time.perf_counter() - start:.1f} s, {chosen}.")
    if wrong:
        raise typer.Exit(Exit.ERROR)


def _measure_all(models: list[type[Model]]) -> list[Measured]:
    from ..probe.largest_albedo import configurations, default_albedo, largest_albedo

    measured = []
    todo = {}
    for model in models:
        with failing(Exit.ERROR, Exception, about=model.plugins[0]):
            todo[model] = configurations(model)
    with progress("Measuring") as bar:
        task = bar.add_task("", total=sum(map(len, todo.values())))
        for model, configured in todo.items():
            bar.update(task, description=model.plugins[0])
            with failing(Exit.ERROR, Exception, about=model.plugins[0]):
                measured.append(Measured(model, default_albedo(model), []))
                for given in configured:
                    measured[-1].found.append((given, largest_albedo(model, given)))
                    bar.advance(task)
    return measured


def _print_statements(measured: list[Measured]) -> None:
    """Print the table of the manual page for each model, and the statement."""
    from ..probe.largest_albedo import energy_of

    for model, default, found in measured:
        stated = energy_of(model, default, found)
        heading, *rows = stated.rows()
        table = Table(*heading, box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row)
        out.print(model.plugins[0], style="bold")
        print_table(table)
        out.print(f"\n{_statement(stated)}\n")


def _write(measured: list[Measured]) -> None:
    """Write the data file of the pack's own models, with what was found in place of what it says of these."""
    from ..probe.largest_albedo import energy_of

    stated = {model.plugins[0]: model.energy for model in own_models() if model.energy}
    stated |= {it.model.plugins[0]: energy_of(*it) for it in measured if is_own(it.model)}
    rows = [f'  "{name}": {energy.to_json()}' for name, energy in sorted(stated.items())]
    write_text(ENERGY, "{\n" + ",\n".join(rows) + "\n}\n")


def _print_comparison(measured: list[Measured]) -> bool:
    """Print a row for each configuration, and below what is wrong. Return whether anything is."""
    from ..probe.largest_albedo import fault

    table = Table("type", "configuration", "stated", "found", "", box=None, pad_edge=False)
    faults = []
    for model, default, found in measured:
        name, energy = model.plugins[0], model.energy
        if energy is None:
            continue
        _, of_default, *others = energy.rows()
        compared = [(of_default[0], energy.default, default, 0.0, "")]
        for row, (_, stated), (_, it) in zip(others, energy.largest, found, strict=True):
            compared.append((row[0], stated, it.albedo, it.noise, f", at {it.place}"))
        for words, stated, albedo, noise, place in compared:
            problem = fault(stated, albedo, noise)
            shown = "no limit" if isinf(stated) else f"{stated:.4g}"
            table.add_row(
                name, words, shown, f"{albedo:.4g}", Text(*("WRONG", "red") if problem else ("right", "green"))
            )
            if problem:
                faults.append(f"{name}: {words}: {shown} is stated, but {problem}: found {albedo:.5g}{place}")
    print_table(table)
    for sentence in faults:
        out.print(sentence)
    return bool(faults)


def _statement(stated: Energy) -> str:
    """Return the line of code, in several lines if it is long."""
    numbers = [f"{albedo:g}".replace("inf", 'float("inf")') for _, albedo in stated.largest]
    given = [repr(words).replace("'", '"') for words, _ in stated.largest]
    rows = [f"({words}, {number})" for words, number in zip(given, numbers, strict=True)]
    line = f"energy = Energy({stated.default:g}, [{', '.join(rows)}])"
    if len(line) <= LINE:
        return line
    indented = "".join(f"        {row},\n" for row in rows)
    return f"energy = Energy(\n    {stated.default:g},\n    [\n{indented}    ],\n)"
