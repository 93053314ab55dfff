"""The command ``python tests/benchmarks``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))

from mi_brdfs.cli.doctor import versions
from mi_brdfs.cli.options import set_tracing_variant
from mi_brdfs.mitsuba import llvm

# After mi_brdfs, which chooses the LLVM that Mitsuba loads.
import benchmarks  # isort: skip
import drjit as dr  # isort: skip
from benchmarks.cases import CASES  # isort: skip
from benchmarks.figure import Figure  # isort: skip


def results(figures: list[Figure], variant: str) -> dict[str, Any]:
    """Return the figures and what they were measured with, in JSON's types."""
    setup = versions() | {"variant": variant, "threads": str(dr.thread_count())}
    if variant.startswith("llvm") and (found := llvm.version()):
        setup["llvm"] = llvm.dotted(found)
    return {
        "setup": setup,
        "missed": [sentence for figure in figures for sentence in figure.sentences()],
        "figures": [figure.to_dict() for figure in figures],
        "cases": {case.name: asdict(case) for case in CASES},
    }


def table(title: str, figures: Iterable[Figure]) -> Table:
    """Return a row for each subject. Figures that miss a target are red and marked."""
    rows: dict[str, dict[str, str]] = {}
    for it in figures:
        rows.setdefault(it.subject, {})[it.name] = f"[red]{escape(str(it))} ![/]" if it.missed else escape(str(it))
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    made = Table("", *names, title=title, title_justify="left", box=None, pad_edge=False)
    for subject, row in rows.items():
        made.add_row(subject, *(row.get(name, "") for name in names))
    return made


def main() -> None:
    parser = argparse.ArgumentParser(prog="python tests/benchmarks", description="The project's own benchmark.")
    parser.add_argument("--only", action="append", choices=benchmarks.SECTIONS, help="may be repeated")
    parser.add_argument("--json", type=Path, help="also write all figures to this file")
    asked = parser.parse_args()
    variant = set_tracing_variant(None)
    console, figures = Console(), []
    for name in asked.only or benchmarks.SECTIONS:
        found = list(benchmarks.SECTIONS[name]())
        for section in dict.fromkeys(figure.section for figure in found):
            console.print(table(section, (figure for figure in found if figure.section == section)))
        figures += found
    measured = results(figures, variant)
    if asked.json:
        asked.json.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
    print(*measured["missed"], sep="\n")


if __name__ == "__main__":
    main()
