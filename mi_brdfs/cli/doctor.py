"""``mi-brdfs doctor``"""

from __future__ import annotations

import typer
from rich.table import Table
from rich.text import Text

from .. import doctor as doctor_module
from .app import command
from .terminal import Exit, out, print_table


@command("Develop", "doctor")
def doctor() -> None:
    """Show which variants work on this machine, which LLVM is used, and how to enable the others."""
    findings = doctor_module.examine()
    table = Table("backend", "state", "", box=None, pad_edge=False)
    colours = {"works": "green", "missing": "yellow"}
    for it in findings:
        table.add_row(it.backend, Text(it.state, colours.get(it.state, "red")), it.detail)
        table.add_row("", "", Text(" ".join(it.variants), "dim"))
    for name, version in doctor_module.versions().items():
        out.print(f"{name} {version}")
    print_table(table)
    out.print(doctor_module.next_step(findings))
    if not doctor_module.any_fast(findings):
        raise typer.Exit(Exit.ERROR)
