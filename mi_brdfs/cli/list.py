"""``mi-brdfs list``"""

from __future__ import annotations

from rich.table import Table

from ..mitsuba.registry import DATA, all_models
from .app import command
from .terminal import print_table


@command("list")
def list_() -> None:
    """List the BRDFs, then the plugin of measured files: type, aliases, summary."""
    table = Table("type", "aliases", "summary", box=None, pad_edge=False)
    for model in dict.fromkeys([*all_models(), *DATA.values()]):
        table.add_row(model.plugins[0], " ".join(model.plugins[1:]), model.summary().replace("``", ""))
    print_table(table)
