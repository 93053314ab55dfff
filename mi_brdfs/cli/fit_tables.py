"""What ``mi-brdfs fit`` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from .terminal import out, print_table

if TYPE_CHECKING:
    from ..fit import Fit


def print_ranking(fits: list[Fit]) -> None:
    """Print the models by their error, and the best one to paste."""
    from ..fit import METRICS
    from ..fit.result import notes, values

    best = fits[0]
    out.print(best.file, style="bold")
    seen = best.flip is not None
    table = Table("model", *["FLIP"] * seen, "held out", "fitted", "ΔBIC", "albedo", "agree", "notes", box=None,
                  pad_edge=False)  # fmt: skip
    for column in table.columns[1:-1]:
        column.justify = "right"
    lowest = min(it.bic for it in fits)
    for it in fits:
        table.add_row(
            it.model, *[_shown(it.flip)] * seen, f"{it.held_out:.4g}",
            f"{it.errors[it.metric]['fitted']:.4g}",
            f"{it.bic - lowest:.0f}", f"{it.albedo:.2f}", f"{it.starts.agree}/{it.starts.tried}", notes(it),
        )  # fmt: skip
    print_table(table)
    out.print(f"Error of {METRICS[best.metric].text}, up to {best.cut:g}°; {best.pairs} pairs of directions fitted.")
    if seen:
        out.print("FLIP (Andersson et al. 2020) is that of a picture of the fit, beside one of the data.")
    out.print()
    parameters = Table(best.model, "", "", box=None, pad_edge=False)
    for name, value, sigma in values(best):
        parameters.add_row(name, f"{value:.4g}", "" if sigma is None else f"± {sigma:.2g}")
    print_table(parameters)
    out.print(f"\n{best.to_xml()}\n")
    for sentence in best.remarks():
        out.print(sentence)
    out.print()


def print_medians(ranked: list[list[Fit]]) -> None:
    """Print the medians over the files."""
    from ..fit.result import medians

    out.print("Medians", style="bold")
    rows = medians(ranked)
    seen = any(row.flip is not None for row in rows)
    table = Table("model", *["FLIP"] * seen, "held out", "fitted", "files", "best in", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for row in rows:
        table.add_row(
            row.model, *[_shown(row.flip)] * seen, f"{row.held_out:.4g}", f"{row.fitted:.4g}",
            str(row.files), str(row.best_in),
        )  # fmt: skip
    print_table(table)


def _shown(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
