"""How checks say what they found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..parameters.messages import brief
from ..probe.arrays import Array
from .report import Finding


class Fault(NamedTuple):
    """One thing that is wrong."""

    message: str
    size: float
    """How wrong it is: the largest of several faults is told."""
    at: dict[str, Any]
    """What reproduces it: :attr:`Finding.at`."""


class Outcome:
    """Collect what a check finds on one part, and make a finding of it: of its faults, the largest."""

    def __init__(self, check: str, subject: str) -> None:
        self.check, self.subject = check, subject
        self.faults: list[Fault] = []
        self.data: dict[str, Any] = {}

    def fault(self, message: str, size: float = 1, *, seed: int | None = None, **directions: Array) -> None:
        """Add a fault, with the directions ``wi`` and ``wo`` and the seed of the variates that reproduce it."""
        at: dict[str, Any] = {name: w.tolist() for name, w in directions.items()}
        self.faults.append(Fault(message, size, at if seed is None else at | {"seed": seed}))

    def finding(self, message: str, remark: str = "") -> Finding:
        """Return the finding, with ``message`` if nothing is wrong. A remark follows in any case."""
        remark = f" {remark}" if remark else ""
        if not self.faults:
            return Finding(self.check, self.subject, "pass", message + remark, self.data)
        worst = max(self.faults, key=lambda fault: fault.size)
        more = len(self.faults) - 1
        text = worst.message + (f" (and {more} more like it)" if more else "") + "." + remark
        data = self.data | {"faults": [fault.message for fault in self.faults]}
        return Finding(self.check, self.subject, "fail", text, data, worst.at)


Findings = Iterator[Finding]


def told(error: Exception) -> str:
    """Return an exception in a few words: its kind, and the first line of what it says. Mitsuba and Dr.Jit hide the
    cause of an error in a plugin's Python code behind one of their own."""
    cause: BaseException = error
    while cause.__cause__ is not None:
        cause = cause.__cause__
    line = next((line.strip() for line in str(cause).splitlines() if line.strip()), "")
    return type(cause).__name__ + (f": {brief(line.rstrip('.'))}" if line else "")


def relative(got: Array, expected: Array) -> Array:
    """Return the relative errors of numbers; those far below the largest count as a ten-millionth of it would."""
    scale = np.maximum(np.maximum(abs(got), abs(expected)), 1e-7 * np.max(abs(expected), initial=0) + 1e-12)
    error = abs(got - expected) / scale
    return np.where(np.isfinite(error), error, np.where(np.isfinite(expected), np.inf, 0))
