"""Tables of sweeps."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from csv import DictWriter
from itertools import chain, groupby
from statistics import mean, median
from typing import Any

from ..fit.metrics import METRICS
from .store import PARTS, SCHEMA

COLUMNS = "metric", "model", "held out", "fitted", "rank", "best in", "files"
MEDIANS = ["content", "model", "metric", "seed", *(f"{metric}_{part}" for metric in METRICS for part in PARTS)]
"""The columns of rows that :func:`medians` needs."""


def medians(rows: Iterable[dict[str, Any]]) -> str:
    """Return a table in Markdown: by metric and model, the medians over files and seeds of the errors in this metric,
    the mean rank by the error on held-out directions, and in how many files and seeds it is the least."""
    order = {name: k for k, name in enumerate(METRICS)}
    slim = [
        (order[r["metric"]], r["metric"], r["model"], r["content"], r["seed"], *errors)
        for r in rows
        if None not in (errors := [r[f"{r['metric']}_{part}"] for part in ("held_out", "fitted")])
    ]
    table = [list(COLUMNS)]
    for (_, metric), group in groupby(sorted(slim), key=lambda row: row[:2]):
        own = list(group)
        places: dict[str, list[int]] = {}
        for _, contest in groupby(sorted(own, key=lambda row: (row[3:5], row[5])), key=lambda row: row[3:5]):
            for place, row in enumerate(contest, 1):
                places.setdefault(row[2], []).append(place)
        lines = []
        for model, some in groupby(own, key=lambda row: row[2]):
            fits = list(some)
            held_out, fitted = (median(row[k] for row in fits) for k in (5, 6))
            lines.append((
                held_out, metric, model, f"{held_out:.4g}", f"{fitted:.4g}", f"{mean(places[model]):.1f}",
                str(places[model].count(1)), str(len({row[3] for row in fits})),
            ))  # fmt: skip
        table += [list(line[1:]) for line in sorted(lines)]
    return "\n".join(_markdown(table))


def _markdown(table: list[list[str]]) -> Iterator[str]:
    """Yield lines with the columns aligned, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for k, row in enumerate(table):
        cells = [
            text.ljust(width) if column < 2 else text.rjust(width)
            for column, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield f"| {' | '.join(cells)} |"
        if k == 0:
            yield f"|{'|'.join('-' * (w + 2) if c < 2 else '-' * (w + 1) + ':' for c, w in enumerate(widths))}|"


def csv(rows: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Yield lines: the columns' names, then the rows."""
    names = dict(zip(SCHEMA.names, SCHEMA.names, strict=True))
    for row in chain([names], rows):
        text = io.StringIO()
        DictWriter(text, SCHEMA.names, lineterminator="").writerow(row)
        yield text.getvalue()
