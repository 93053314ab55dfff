"""The results, figures with their targets: as tables, as JSON, and as the summary in docs/bench.md."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table
from rich.text import Text

from .figure import MISSED, Figure, Target
from .summary import summary


@dataclass(frozen=True)
class Results:
    """All figures of one call, and the setup they were measured with."""

    figures: list[Figure]
    setup: dict[str, str]
    """The versions, the variant and the number of threads."""
    cases: dict[str, dict[str, Any]]
    """The fields of the cases, by subject."""

    @property
    def missed(self) -> list[str]:
        """Return a sentence for each missed target."""
        return [sentence for figure in self.figures for sentence in figure.sentences()]

    @property
    def sections(self) -> list[str]:
        """Return the names of the sections measured."""
        return list(dict.fromkeys(figure.section for figure in self.figures))

    def of(self, section: str) -> list[Figure]:
        """Return the figures of one section."""
        return [figure for figure in self.figures if figure.section == section]

    def to_dict(self) -> dict[str, Any]:
        """Return the results in JSON's types."""
        figures = [asdict(figure) | {"missed": bool(figure.missed)} for figure in self.figures]
        for figure in figures:
            figure["targets"] = [target._asdict() for target in figure["targets"]]
        return {"setup": self.setup, "missed": self.missed, "figures": figures, "cases": self.cases}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Results:
        """Return the results from the output of :meth:`to_dict`."""
        figures = []
        for fields in data["figures"]:
            fields = {key: value for key, value in fields.items() if key != "missed"}
            fields["targets"] = tuple(Target(**target) for target in fields["targets"])
            fields["interval"] = fields["interval"] and tuple(fields["interval"])
            figures.append(Figure(**fields))
        return cls(figures, data["setup"], data["cases"])

    def tables(self) -> list[Table]:
        """Return a table for each section, with a row for each subject. Figures that miss a target are red and
        marked."""
        return [_table(section, self.of(section)) for section in self.sections]

    def markdown(self) -> str:
        """Return the summary in docs/bench.md."""
        return summary(self.figures, self.setup, self.cases)


def _table(title: str, figures: Iterable[Figure]) -> Table:
    rows: dict[str, dict[str, Figure]] = {}
    for figure in figures:
        rows.setdefault(figure.subject, {})[figure.name] = figure
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    table = Table("", *names, title=title, title_justify="left", box=None, pad_edge=False)
    for subject, row in rows.items():
        table.add_row(subject, *(_cell(row[name]) if name in row else "" for name in names))
    return table


def _cell(figure: Figure) -> Text:
    return Text(f"{figure}{MISSED}", "red") if figure.missed else Text(str(figure))
