"""The state that the sections of one call of ``bench`` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from .cases import Case
from .renders import Renders, alternate

T = TypeVar("T")


@dataclass
class BenchRun:
    """The progress of the call, and the pictures that several sections use."""

    on_progress: Callable[[str, int, int], None]
    cases: list[Case]
    section: str = ""
    _renders: dict[tuple[str, str], Renders] = field(default_factory=dict)

    @property
    def beside(self) -> list[Case]:
        """Return the cases that have a built-in."""
        return [case for case in self.cases if case.builtin]

    def steps(self, items: Sequence[T]) -> Iterator[T]:
        """Yield the items, reporting progress."""
        for done, item in enumerate(items):
            self.on_progress(self.section, done, len(items))
            yield item

    def renders(self, case: Case, scene: str) -> Renders:
        """Return the pictures of a case and its built-in in one of the scenes, rendered once for all sections."""
        key = case.name, scene
        if key not in self._renders:
            self._renders[key] = alternate(case.bsdf, case.other, scene)
        return self._renders[key]
