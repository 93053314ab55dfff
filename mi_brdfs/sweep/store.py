"""Finished fits in Parquet files, and tables of them."""

from __future__ import annotations

import io
import json
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from csv import DictWriter
from pathlib import Path
from statistics import mean, median
from typing import Any

try:
    import pyarrow as pa
    from pyarrow import parquet
except ImportError:
    raise ImportError("a sweep needs PyArrow: pip install 'mi_brdfs[sweep]'") from None

from ..fit import METRICS
from ..writing import replacing

PARTS = "fitted", "held_out"
IDENTITY = {
    "key": pa.string(),  # of all that follow up to the versions, but for the file's name
    "file": pa.string(),
    "content": pa.string(),  # SHA-256 of the file
    "model": pa.string(),
    "metric": pa.string(),
    "seed": pa.int64(),
    "starts": pa.int64(),
    "cut": pa.float64(),
    "variant": pa.string(),
    "versions": pa.string(),
}
JSON = "bsdf", "sigma", "correlations", "undetermined", "bounds", "remarks"
FINDINGS = {
    **{f"{metric}_{part}": pa.float64() for metric in METRICS for part in PARTS},
    "albedo": pa.float64(),
    "bic": pa.float64(),
    "tried": pa.int64(),  # starts, with the published material
    "agree": pa.int64(),
    "pairs": pa.int64(),
    "resolved": pa.bool_(),
    **dict.fromkeys(JSON, pa.string()),
    "seconds": pa.float64(),
}
SCHEMA = pa.schema(IDENTITY | FINDINGS)
"""A row is a fit, with the keys of :meth:`mi_brdfs.fit.Fit.to_dict`; nested values are JSON."""


class StoreWarning(UserWarning):
    """A file among the results that cannot be used."""


class Store:
    """A folder of Parquet files with rows of ``SCHEMA``, each file written at once."""

    def __init__(self, folder: Path):
        self.folder = folder

    def prepare(self) -> None:
        """Make the folder, and raise an OSError if it cannot be written to, before the work for it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=self.folder).close()

    def add(self, name: str, rows: Iterable[Mapping[str, Any]]) -> None:
        """Write a file into the folder that :meth:`prepare` made: all of it or nothing."""
        with replacing(self.folder / f"{name}.parquet") as part, part.open("wb") as file:
            parquet.write_table(pa.Table.from_pylist(list(rows), schema=SCHEMA), file)

    def rows(self, columns: Iterable[str] | None = None) -> Iterator[dict[str, Any]]:
        """Yield the rows of all files, one file at a time; warn of each that holds no such rows."""
        for path in sorted(self.folder.glob("[!.]*.parquet")):
            try:
                if not path.is_file():  # opening a pipe would wait for ever
                    raise ValueError("it is no regular file")
                with path.open("rb") as opened, parquet.ParquetFile(opened) as file:
                    if missing := set(SCHEMA.names) - set(file.schema_arrow.names):
                        raise ValueError(f"it has no column {min(missing)}")
                    schema = pa.schema([SCHEMA.field(name) for name in columns or SCHEMA.names])
                    found = file.read(schema.names).select(schema.names).cast(schema).to_pylist()
                for row in found:
                    json.loads(row.get("bsdf", "{}"))
            except (OSError, TypeError, ValueError) as error:  # pa.ArrowInvalid is a ValueError
                text = f"{path} holds no fits, and is left out: {error}"
                warnings.warn(" ".join(text.split()), StoreWarning, stacklevel=2)
                continue
            yield from found


def row_of(identity: Mapping[str, Any], fit: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a fit that was written by ``to_dict``."""
    errors = {f"{metric}_{part}": fit["errors"][metric][part] for metric in METRICS for part in PARTS}
    nested = {name: json.dumps(fit[name]) for name in JSON}
    starts = {"tried": fit["starts"]["tried"], "agree": fit["starts"]["agree"]}
    plain = {name: fit[name] for name in ("albedo", "bic", "pairs", "resolved", "seconds")}
    file = identity["file"].encode(errors="backslashreplace").decode()  # names need not be UTF-8, what is here has to
    return {**identity, "file": file, **errors, **starts, **plain, **nested}


# --- Tables -----------------------------------------------------------------------------------------------------------

COLUMNS = "metric", "model", "held out", "fitted", "rank", "best in", "files"
MEDIANS = ["content", "model", "metric", "seed", *(f"{metric}_{part}" for metric in METRICS for part in PARTS)]
"""The columns of rows that :func:`medians` needs."""


def medians(rows: Iterable[dict[str, Any]]) -> str:
    """Return a table in Markdown: by metric and model, the medians over files and seeds of the errors in this metric,
    the mean rank by the error on held-out directions, and in how many files and seeds it is the least."""
    fits = defaultdict[tuple, list[tuple]](list)
    contests = defaultdict[tuple, list[tuple]](list)
    for row in rows:
        held_out, fitted = (row[f"{row['metric']}_{part}"] for part in ("held_out", "fitted"))
        if held_out is not None and fitted is not None:
            fits[row["metric"], row["model"]].append((held_out, fitted, row["content"]))
            contests[row["metric"], row["content"], row["seed"]].append((held_out, row["model"]))
    places = defaultdict[tuple, list[int]](list)
    for (metric, *_), contest in contests.items():
        for place, (_, model) in enumerate(sorted(contest), 1):
            places[metric, model].append(place)
    lines = []
    for (metric, model), own in fits.items():
        held_out, fitted, contents = zip(*own, strict=True)
        ranks = places[metric, model]
        lines.append((
            [*METRICS].index(metric), median(held_out), metric, model, f"{median(held_out):.4g}",
            f"{median(fitted):.4g}", f"{mean(ranks):.1f}", str(ranks.count(1)), str(len({*contents})),
        ))  # fmt: skip
    return "\n".join(_markdown([COLUMNS, *(line[2:] for line in sorted(lines))]))


def _markdown(table: list[tuple[str, ...]]) -> Iterator[str]:
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


def csv(rows: Iterable[dict[str, Any]]) -> str:
    """Return a table of comma-separated values: the columns' names, then the rows."""
    text = io.StringIO()
    table = DictWriter(text, SCHEMA.names, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().removesuffix("\n")
