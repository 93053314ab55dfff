"""``mi-brdfs list`` and ``mi-brdfs info``"""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

from ..manual import WIDEST, plain, show
from ..mitsuba.registry import DATA, all_models, find_plugin
from ..model import Plugin
from ..parameters import nested
from ..parameters.vocabulary import OTHERS, key
from .app import command
from .terminal import Exit, Terminal, fail, failing, out, print_table


@command("Look", "list", "list --search gold", name="list")
def list_(
    search: Annotated[
        str | None, typer.Option(metavar="WORD", help="Only those that a word leads to, also one of other programs.")
    ] = None,
) -> None:
    """List the BRDFs, then the plugin of measured files: type, aliases, summary."""
    table = Table("type", "aliases", *["option"] * (search is not None), "summary", box=None, pad_edge=False)
    for model in dict.fromkeys([*all_models(), *DATA.values()]):
        options = [] if search is None else _options(model, search)
        if options is not None:
            cells = [] if search is None else [" ".join(options)]
            table.add_row(model.plugins[0], " ".join(model.plugins[1:]), *cells, model.summary().replace("``", ""))
    if not table.row_count:
        fail(f"no model goes by the word {search}; `mi-brdfs list` has them all", Exit.USAGE)
    print_table(table)


def _options(model: type[Plugin], word: str) -> list[str] | None:
    """Return the parameters of a model and their words that a word leads to; None if it does not lead to the model."""
    wanted = key(word)
    others = [other.partition(" ") for other in OTHERS.get(wanted, ())]
    names = {wanted, *(name for name, _, option in others if not option)}
    found = [option for name, _, option in others if name in model.plugins and option]
    for parameter in nested(model.declared()):
        found += [name for name in parameter.names if name in names or key(name) == wanted]
        choices = map(str, parameter.choices)
        found += [f"{parameter.names[0]}={it}" for it in choices if it in names or key(it) == wanted]
    named = {it.partition("=")[0]: it for it in found}
    is_named = not names.isdisjoint(model.plugins) or wanted in key(" ".join([*model.plugins, model.summary()]))
    return sorted(named.values()) if found or is_named else None


@command("Look", "info walter", "info tabulated")
def info(type: Annotated[str, typer.Argument(metavar="TYPE", help="A type or alias, as `list` shows it.")]) -> None:
    """Show the manual page of a BRDF."""
    with failing(Exit.ERROR):
        plugin = find_plugin(type)
        if out.is_terminal:  # the console folds lines, unlike `out`
            show(plugin, Terminal(width=min(out.width, WIDEST), emoji=False, highlight=False))
        else:
            out.print(plain(plugin))
