"""A measured number, and its targets."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, NamedTuple


class Target(NamedTuple):
    """A bound that a figure has to meet, and where it comes from."""

    relation: Literal["≥", "≤"]
    bound: float
    reason: str


@dataclass(frozen=True)
class Figure:
    """A measured number. It is judged as displayed, rounded to ``digits`` decimals."""

    section: str
    subject: str
    """The subject measured: its row in the section's table."""
    name: str
    """The quantity measured: its column."""
    value: float
    digits: int = 3
    unit: str = ""
    interval: tuple[float, float] | None = None
    """The 95 % confidence interval, if there is one."""
    targets: tuple[Target, ...] = ()

    @property
    def missed(self) -> list[Target]:
        """Return the targets that it misses."""
        value = round(self.value, self.digits)
        reached = {"≥": lambda bound: value >= bound, "≤": lambda bound: value <= bound}
        return [t for t in self.targets if not reached[t.relation](round(t.bound, self.digits))]

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

    def to_dict(self) -> dict[str, Any]:
        """Return it in JSON's types."""
        targets = [target._asdict() for target in self.targets]
        return asdict(self) | {"targets": targets, "missed": bool(self.missed)}
