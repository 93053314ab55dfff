"""How checks say what they found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from .report import Finding


class Fault(NamedTuple):
    """One thing that is wrong."""

    message: str
    size: float
    """How wrong it is: the largest of several faults is told."""


class Outcome:
    """Collects what a check finds on one part, and makes a finding of it: of its faults, the largest."""

    def __init__(self, check: str, subject: str):
        self.check, self.subject = check, subject
        self.faults: list[Fault] = []
        self.data: dict = {}

    def fault(self, message: str, size: float = 1):
        self.faults.append(Fault(message, size))

    def finding(self, message: str) -> Finding:
        """The finding, with ``message`` if nothing is wrong."""
        if not self.faults:
            return Finding(self.check, self.subject, "pass", message, self.data)
        worst = max(self.faults, key=lambda fault: fault.size)
        more = len(self.faults) - 1
        text = worst.message + (f" (and {more} more like it)" if more else "") + "."
        return Finding(self.check, self.subject, "fail", text, self.data | {"faults": [f.message for f in self.faults]})


Findings = Iterator[Finding]
