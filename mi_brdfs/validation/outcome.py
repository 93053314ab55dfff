"""How checks say what they found."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from ..mitsuba.errors import line_of_author, unwrapped_ctrl_c
from ..parameters.messages import brief
from ..probe.arrays import Array
from ..probe.directions import angles_of
from .report import Finding

KNOWN = 1e-3
"""What the direction of a sample is known to, at angles that are not near grazing."""


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
        self.remark = ""
        """What follows in any case."""
        self.tried = 0
        """Of how many directions each may have a fault."""

    def fault(self, message: str, size: float = 1, *, seed: int | None = None, **directions: Array) -> None:
        """Add a fault, with the directions ``wi`` and ``wo`` and the seed of the variates that reproduce it."""
        at: dict[str, Any] = {name: w.tolist() for name, w in directions.items()}
        self.faults.append(Fault(message, size, at if seed is None else at | {"seed": seed}))

    def wrong(
        self,
        lanes: Array,
        name: str,
        got: Array,
        why: str,
        wi: Array,
        wo: Array,
        *,
        expected: Array | None = None,
        uv: Array | None = None,
        wavelengths: Array | None = None,
        seed: int | None = None,
        digits: int = 4,
    ) -> None:
        """Add a fault for the lane that is most wrong, if any is.

        Args:
            lanes: how wrong each is, or which are, shape (N,) or (N, channels).
            name: of what is wrong.
            got: what it is, shape (N,) or (N, channels).
            why: what is wrong with that, or what is ``expected`` if that is given.
            wi: the directions of incidence, shape (3,) or (N, 3).
            wo: the others.
            uv: the texture coordinates, shape (N, 2), if they matter.
            wavelengths: those of the channels, of the shape of ``got``, if they matter.
        """
        if not np.any(lanes):
            return
        k = int(np.argmax(np.reshape(lanes, (len(lanes), -1)).max(axis=1)))
        wi, wo = (w if w.ndim == 1 else w[k] for w in (wi, wo))
        values = np.atleast_1d(got[k])
        if expected is None:
            # A value that is negative or no number is wrong before any other.
            channel = np.argmax(np.where(np.isfinite(values) & (values >= 0), values, np.inf))
        else:
            wanted = np.atleast_1d(expected[k])
            channel = np.argmax(abs(values - wanted))
            why = f"but {wanted[channel]:.{digits}g} {why}"
        name = name if uv is None else f"at uv = ({uv[k, 0]:.3g}, {uv[k, 1]:.3g}) {name}"
        name = name if wavelengths is None else f"at {np.atleast_1d(wavelengths[k])[channel]:.0f} nm {name}"
        told = f"{name} is {values[channel]:.{digits}g} for light from {angles_of(wi)} towards {angles_of(wo)}, {why}"
        self.fault(told, float(np.sum(lanes)), wi=wi, wo=wo, seed=seed)

    def differing(
        self,
        tolerance: float,
        name: str,
        got: Array,
        expected: Array,
        why: str,
        wi: Array,
        wo: Array,
        *,
        floor: float = 1e-7,
        unknown: float = np.inf,
        where: Array | None = None,
        but_for: float = 0,
        **reproduces: Any,
    ) -> float:
        """Add a fault for the lane that differs most from what is ``expected``, if more than a part of them do by more
        than a relative tolerance: of those ``where`` it matters, as :func:`relative` has it. All else is as in
        :meth:`wrong`. Return what all ``but_for`` that part do not exceed."""
        error = relative(got, expected, floor, unknown).reshape(len(got), -1)
        where = np.ones(len(error), bool) if where is None else where
        if not where.any():
            return 0.0
        largest = error.max(axis=1)[where]
        usual = float(np.quantile(largest, 1 - but_for))
        if usual > tolerance:
            many = f"; {(largest > tolerance).mean():.1%} of those tried differ" if but_for else ""
            over = error * (error > tolerance) * where[:, None]
            self.wrong(over, name, got, why + many, wi, wo, expected=expected, **reproduces)
        return usual

    def astray(
        self, when: str, got: Array, expected: Array, why: str, wi: Array, seed: int, but_for: float = 0.01
    ) -> None:
        """Add a fault for the sample that is farthest from where it is ``expected``, if more than a part of them are
        not where they are. Those that are zero on either hand do not count."""
        apart = np.linalg.norm(got - expected, axis=1) * got.any(axis=1) * expected.any(axis=1)
        if apart.size and np.quantile(apart, 1 - but_for) > KNOWN:
            k = int(np.argmax(apart))
            told = f"{when} sample draws {angles_of(got[k])} for light from {angles_of(wi[k])}"
            self.fault(f"{told}, but {angles_of(expected[k])} {why}", apart.sum(), wi=wi[k], seed=seed)

    def finding(self, message: str) -> Finding:
        """Return the finding, with ``message`` if nothing is wrong."""
        remark = f" {self.remark}" if self.remark else ""
        if not self.faults:
            return Finding(self.check, self.subject, "pass", message + remark, self.data)
        worst = max(self.faults, key=lambda fault: fault.size)
        others = f" (and {more} more like it)" if (more := len(self.faults) - 1) else ""
        if more and more + 1 == self.tried:
            others = f" (it fails for all {self.tried} directions tried)"
        text = worst.message + others + "." + remark
        data = self.data | {"faults": [fault.message for fault in self.faults]}
        return Finding(self.check, self.subject, "fail", text, data, worst.at)


Findings = Iterator[Finding]


class Skipped(Exception):
    """Raised by a check where a part cannot be checked, with the reason."""


@contextmanager
def skipping(why: str) -> Iterator[None]:
    """Skip what is checked where something within raises, which is told after ``why``."""
    try:
        with unwrapped_ctrl_c():
            yield
    except Skipped:
        raise
    except Exception as error:
        raise Skipped(f"{why}{told(error)}.") from None


def told(error: Exception) -> str:
    """Return an exception in a few words: its kind, and the first line of what it says, or that a plugin is unknown in
    the variant.
    Mitsuba and Dr.Jit hide the cause of an error in a plugin's Python code behind one of their own."""
    cause: BaseException = error
    while cause.__cause__ is not None:
        cause = cause.__cause__
    line = next((line.strip() for line in str(cause).splitlines() if line.strip()), "")
    if unknown := re.search(r'Plugin "(.+)" not found', line):
        return f'nobody has registered the plugin "{brief(unknown[1])}" there'
    at = f" ({place})" if (place := line_of_author(cause)) else ""
    return type(cause).__name__ + (f": {brief(line.rstrip('.'))}" if line else "") + at


def relative(got: Array, expected: Array, floor: float = 1e-7, unknown: float = np.inf) -> Array:
    """Return the relative errors of numbers; those below ``floor`` of the largest count as that part of it. Where what
    is expected is not finite it is 0, and where only the other is NaN, ``unknown``."""
    largest = np.max(abs(expected), initial=0, where=np.isfinite(expected))
    scale = np.maximum(np.maximum(abs(got), abs(expected)), floor * largest + 1e-12)
    with np.errstate(invalid="ignore"):
        error = abs(got - expected) / scale
    return np.where(np.isfinite(error), error, np.where(np.isfinite(expected), unknown, 0))
