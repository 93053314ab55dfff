"""How checks say what they found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..parameters.messages import brief
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


def told(error: Exception) -> str:
    """An exception in a few words: its kind, and the first line of what it says. Mitsuba and Dr.Jit hide the cause of
    an error in a plugin's Python code behind one of their own."""
    while error.__cause__ is not None:
        error = error.__cause__
    line = next((line.strip() for line in str(error).splitlines() if line.strip()), "")
    return type(error).__name__ + (f": {brief(line.rstrip('.'))}" if line else "")


def relative(got: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """The relative errors of numbers; those far below the largest count as much as a ten-millionth of it would."""
    scale = np.maximum(np.maximum(abs(got), abs(expected)), 1e-7 * np.max(abs(expected), initial=0) + 1e-12)
    error = abs(got - expected) / scale
    return np.where(np.isfinite(error), error, np.where(np.isfinite(expected), np.inf, 0))
