"""``mi-brdfs presets``"""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from ..mitsuba.registry import presets
from ..parameters.published import preset, provenance
from .app import command
from .terminal import Exit, err, fail, failing, out, print_paragraph, print_table

LETTERS = {"alpha": "α", "exponent": "n", "b": "B"}
"""The parameters that are shown in the table, the width of the lobe."""


@command("Look", "presets --like gold", "presets ngan/ward/blue-acrylic", name="presets")
def presets_(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this one, with its source.")] = None,
    model: Annotated[str | None, typer.Option(metavar="TYPE", help="Only those of this plugin.")] = None,
    like: Annotated[str | None, typer.Option(metavar="TEXT", help="Only names with this text in them.")] = None,
) -> None:
    """List the published materials, or show one. The plugin takes its name as its parameter `preset`."""
    with failing(Exit.USAGE):
        if name is not None:
            _show(name)
            return
        found = [it for it in presets(model) if (like or "").lower() in it]
    if not found:
        words = [f" of {model}" if model else "", f" with {like!r} in its name" if like else ""]
        fail(f"there is no preset{''.join(words)}", Exit.USAGE)
    table = Table("preset", "plugin", "diffuse", "lobe", box=None, pad_edge=False)
    for it in found:
        values = preset(it)
        table.add_row(it, values["type"], _hex(values["diffuse_reflectance"]["value"]), _width(values))
    print_table(table)
    if out.is_terminal:
        err.print(f"{len(found)} presets; diffuse as sRGB, lobe by its roughness α, exponent n or width B.")


def _hex(rgb: list[float]) -> Text:
    """Return a linear colour as sRGB, and in it a mark."""
    from ..srgb import encoded_8bit  # imports numpy

    word = f"#{encoded_8bit(rgb).tobytes().hex()}"
    return Text.assemble(word, (" █" if out.is_terminal else "", word))


def _width(values: dict[str, Any]) -> str:
    name = next(name for name in LETTERS if name in values)
    return f"{LETTERS[name]} {values[name]:.3g}" if values[name] < 100 else f"{LETTERS[name]} {values[name]:.0f}"


def _show(name: str) -> None:
    """Print a preset as a dict and in XML, and where it comes from."""
    values, origin = preset(name), provenance(name)
    items = [f"    {key!r}: {value!r}," for key, value in values.items()]
    facts = [f"Source: {origin.source}, doi:{origin.doi}.", f"Formula: {origin.convention}."]
    facts += [f"Note: {defect}" for defect in origin.defects]
    out.print("\n".join(["{", *items, "}"]))
    out.print(f'\n<bsdf type="{values["type"]}">\n    <string name="preset" value="{name}"/>\n</bsdf>\n')
    for fact in facts:
        print_paragraph(fact)
