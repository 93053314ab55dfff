"""A number that was measured, and what it has to reach."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

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
        """Return a sentence for each target that it misses."""
        return [
            f"{self.section}: {self.subject}: {self.name} is {self}, and should be {t.relation} {self._shown(t.bound)} "
            f"({t.reason})."
            for t in self.missed
        ]
