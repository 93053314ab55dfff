"""What a check found."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from .trial import Trial

Verdict = Literal["fail", "pass", "skip", "info"]
"""The gravest first."""


@dataclass(frozen=True)
class Finding:
    """The verdict of one check on one part of a BSDF."""

    check: str
    """The name of the check, one of ``mi_brdfs.validation.CHECKS``."""
    subject: str
    """What was checked: the whole, or one of its components or parameters."""
    verdict: Verdict
    """``fail``, ``pass``, ``skip`` if it could not be checked, or ``info`` if there is nothing to judge."""
    message: str
    """One sentence: what is wrong and by how much, or how good it is."""
    data: dict[str, Any] = field(default_factory=dict)
    """The numbers behind it."""


@dataclass(frozen=True)
class Report:
    """All findings on one BSDF."""

    name: str
    findings: list[Finding]
    trials: list[Trial] = field(default_factory=list, repr=False, compare=False)
    """The histograms that the checks of the sampler were made of."""

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return not self.failures

    @property
    def failures(self) -> list[Finding]:
        """The findings that failed."""
        return [finding for finding in self.findings if finding.verdict == "fail"]

    @property
    def why_not_judged(self) -> str:
        """A sentence for the user if nothing passed or failed, and else none."""
        if any(finding.verdict in ("pass", "fail") for finding in self.findings):
            return ""
        return " ".join(["Nothing was judged.", *dict.fromkeys(finding.message for finding in self.findings)])

    def verdict(self, check: str) -> Verdict | None:
        """Return the gravest verdict of a check, or None if it was not made."""
        found = [finding.verdict for finding in self.of(check)]
        return next((verdict for verdict in get_args(Verdict) if verdict in found), None)

    def of(self, check: str) -> list[Finding]:
        """Return the findings of one check."""
        return [finding for finding in self.findings if finding.check == check]

    def to_dict(self) -> dict[str, Any]:
        """Return the report in types that JSON has."""
        return {"name": self.name, "passed": self.passed, "findings": [asdict(finding) for finding in self.findings]}

    def __str__(self) -> str:
        rows = [(f.verdict, f.check, f.subject, f.message) for f in self.findings]
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
        lines = ["  ".join([*map(str.ljust, row, widths), row[3]]) for row in rows]
        return "\n".join([f"{self.name}: {'passed' if self.passed else 'failed'}", *lines])
