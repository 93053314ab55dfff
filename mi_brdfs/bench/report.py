"""What was measured, as figures with their targets: as tables, in JSON, and as the README's summary."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple

from rich.table import Table
from rich.text import Text

MISSED = " !"
"""Marks a figure that misses a target."""


class Target(NamedTuple):
    """What a figure has to reach, and whose demand that is."""

    relation: Literal["≥", "≤"]
    bound: float
    reason: str


@dataclass(frozen=True)
class Figure:
    """One number that was measured. It is judged as it is shown, with so many digits after the point."""

    section: str
    """The name of a section, one of ``mi_brdfs.bench.SECTIONS``."""
    subject: str
    """What it is a number of: its row in the section's table."""
    name: str
    """Which number it is: its column."""
    value: float
    digits: int = 3
    unit: str = ""
    interval: tuple[float, float] | None = None
    """That of 95 % confidence, where there is one."""
    targets: tuple[Target, ...] = ()

    @property
    def missed(self) -> list[Target]:
        """The targets that it does not reach."""
        value = round(self.value, self.digits)
        reached = {"≥": lambda bound: value >= bound, "≤": lambda bound: value <= bound}
        return [t for t in self.targets if not reached[t.relation](round(t.bound, self.digits))]

    @property
    def marked(self) -> str:
        """The number with its unit, and a mark if it misses a target."""
        return f"{self._shown(self.value)}{self.unit}{MISSED if self.missed else ''}"

    def __str__(self) -> str:
        interval = f" [{', '.join(map(self._shown, self.interval))}]" if self.interval else ""
        return f"{self._shown(self.value)}{self.unit}{interval}"

    def _shown(self, value: float) -> str:
        return f"{value:.{self.digits}f}"

    def sentences(self) -> list[str]:
        """A sentence for each target that it misses."""
        return [
            f"{self.section}: {self.subject}: {self.name} is {self}, and should be {t.relation} {self._shown(t.bound)} "
            f"({t.reason})."
            for t in self.missed
        ]


@dataclass(frozen=True)
class Results:
    """All figures of one call, and what they were measured with."""

    figures: list[Figure]
    setup: dict[str, str]
    """Versions, the variant, the number of threads."""
    cases: dict[str, dict[str, Any]]
    """The fields of the cases that subjects name."""

    @property
    def missed(self) -> list[str]:
        """A sentence for each target that was missed."""
        return [sentence for figure in self.figures for sentence in figure.sentences()]

    @property
    def sections(self) -> list[str]:
        """The names of what was measured."""
        return list(dict.fromkeys(figure.section for figure in self.figures))

    def of(self, section: str) -> list[Figure]:
        """The figures of one section."""
        return [figure for figure in self.figures if figure.section == section]

    def to_dict(self) -> dict[str, Any]:
        """The results in types that JSON has."""
        figures = [asdict(figure) | {"missed": bool(figure.missed)} for figure in self.figures]
        for figure in figures:
            figure["targets"] = [target._asdict() for target in figure["targets"]]
        return {"setup": self.setup, "missed": self.missed, "figures": figures, "cases": self.cases}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Results:
        """The results that :meth:`to_dict` made this of."""
        figures = []
        for fields in data["figures"]:
            fields = {key: value for key, value in fields.items() if key != "missed"}
            fields["targets"] = tuple(Target(**target) for target in fields["targets"])
            fields["interval"] = fields["interval"] and tuple(fields["interval"])
            figures.append(Figure(**fields))
        return cls(figures, data["setup"], data["cases"])

    def tables(self) -> list[Table]:
        """A table for each section, with a row for each subject. What misses a target is red and marked."""
        return [_table(section, self.of(section)) for section in self.sections]

    def markdown(self) -> str:
        """The README's summary."""
        from .summary import summary

        return summary(self)


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
