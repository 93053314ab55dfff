"""``mi-brdfs energy``"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from math import isinf
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import typer
from rich.table import Table
from rich.text import Text

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from ..mitsuba.registry import ENERGY, find_models, is_own, own_models
from ..model import Energy, Model
from ..writing import write_text
from .app import command
from .terminal import Exit, err, fail, out, print_table, progress, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant

if TYPE_CHECKING:
    from ..probe.largest_albedo import Maximum

T = TypeVar("T")

LINE = 80
"""The length beyond which the statement is broken into several lines."""


class Measured(NamedTuple):
    """A model with the largest albedo of its defaults, and its configurations with the brightest setting of each."""

    model: type[Model]
    default: float
    found: list[tuple[dict[str, Any], Maximum]]


@command()
def energy(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="TYPE…", help="Types, as `list` shows them. Default: all.")
    ] = None,
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
    try:
        models = find_models(names)
    except ValueError as error:
        fail(one_line(error), Exit.USAGE)
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
    from ..probe.largest_albedo import default_albedo, largest_albedo
    from ..probe.stated_energy import configurations

    measured = []
    with progress("Measuring") as bar:
        todo = {model: _of(model, configurations) for model in models}
        task = bar.add_task("", total=sum(map(len, todo.values())))
        for model, configured in todo.items():
            bar.update(task, description=model.plugins[0])
            result = Measured(model, _of(model, default_albedo), [])
            for given in configured:
                result.found.append((given, _of(model, largest_albedo, given)))
                bar.advance(task)
            measured.append(result)
    return measured


def _of(model: type[Model], measure: Callable[..., T], *given: Any) -> T:
    """Return what a function measures of a model, or fail with a sentence about the model."""
    try:
        with unwrapped_ctrl_c():
            return measure(model, *given)
    except Exception as error:
        name, text = model.plugins[0], one_line(error)
        fail(text if text.startswith(f"{name}: ") else f"{name}: {text}")


def _print_statements(measured: list[Measured]) -> None:
    """Print the table of the manual page for each model, and the statement."""
    from ..probe.stated_energy import energy_of

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
    from ..probe.stated_energy import energy_of

    stated = {model.plugins[0]: model.energy for model in own_models() if model.energy}
    stated |= {it.model.plugins[0]: energy_of(*it) for it in measured if is_own(it.model)}
    rows = [f'  "{name}": {energy.to_json()}' for name, energy in sorted(stated.items())]
    write_text(ENERGY, "{\n" + ",\n".join(rows) + "\n}\n")


def _print_comparison(measured: list[Measured]) -> bool:
    """Print a row for each configuration, and below what is wrong. Return whether anything is."""
    from ..probe.stated_energy import fault

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
    default, *rows = [
        f"{stated.default:g}",
        *(f"({_literal(given)}, {_number(albedo)})" for given, albedo in stated.largest),
    ]
    line = f"energy = Energy({default}, [{', '.join(rows)}])"
    if len(line) <= LINE:
        return line
    return "\n".join(
        ["energy = Energy(", f"    {default},", "    [", *(f"        {row}," for row in rows), "    ],", ")"]
    )


def _number(albedo: float) -> str:
    return 'float("inf")' if isinf(albedo) else f"{albedo:g}"


def _literal(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_literal(name)}: {_literal(it)}" for name, it in value.items()) + "}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_literal, value))})"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
