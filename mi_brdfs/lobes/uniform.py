"""What is the same everywhere on a surface, computed once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import drjit as dr


@dataclass
class Uniform:
    """Numbers that kernels read instead of computing them in each lane, if they are the same everywhere on a surface.
    Called with a name and numbers, it returns those that it has ``kept`` of that name, or else the numbers: also while
    derivatives are sought, which those that are kept have not."""

    kept: dict[str, list[Any]] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    settling: bool = False

    def __call__(self, name: str, numbers: Any) -> Any:
        self.names.add(name)
        if self.settling and all(dr.width(number) == 1 for number in numbers):
            self.kept[name] = [dr.detach(number) for number in numbers]
        kept = None if self.settling or dr.grad_enabled(numbers) else self.kept.get(name)
        return numbers if kept is None else kept

    def settle(self, compute: Callable[[], Any]) -> None:
        """Keep what is asked for in a computation at two points of the surface, of which some numbers are arrays of
        two. No kernel may be recorded then."""
        self.kept.clear()
        self.settling = True
        try:
            compute()
        finally:
            self.settling = False
        dr.eval(self.kept)
