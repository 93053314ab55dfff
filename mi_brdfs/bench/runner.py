"""Running what is asked for, section by section."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import TypeVar

import drjit as dr
import mitsuba as mi

from ..doctor import versions
from ..mitsuba import llvm
from ..variants import is_measurable
from .cases import Case, all_cases
from .efficiency import efficiency
from .first import first
from .report import Figure, Results
from .resources import cycles, recompiles
from .scalar import scalar
from .timing import Renders, alternate, time, variance

SECTIONS: dict[str, Callable[[Run], Iterator[Figure]]] = {
    section.__name__: section for section in (efficiency, time, variance, first, recompiles, cycles, scalar)
}
"""What is measured by name, in the order in which it is; the docstring of each says how, and what the targets are."""

T = TypeVar("T")


@dataclass
class Run:
    """One call of :func:`bench`: what the sections share."""

    on_progress: Callable[[str, int, int], None]
    cases: list[Case]
    section: str = ""
    _renders: dict[tuple[str, str], Renders] = field(default_factory=dict)

    @property
    def beside(self) -> list[Case]:
        """The cases with a built-in beside them."""
        return [case for case in self.cases if case.builtin]

    def steps(self, items: Sequence[T]) -> Iterator[T]:
        """The items, telling how many are done."""
        for done, item in enumerate(items):
            self.on_progress(self.section, done, len(items))
            yield item

    def renders(self, case: Case, scene: str) -> Renders:
        """A case beside its built-in in one of the scenes; rendered once for all sections."""
        key = case.name, scene
        if key not in self._renders:
            self._renders[key] = alternate(case.bsdf, case.builtin, scene)
        return self._renders[key]


def bench(
    only: Iterable[str] | None = None, on_progress: Callable[[str, int, int], None] = lambda section, done, of: None
) -> Results:
    """Measure all models, also those that were registered by others, beside Mitsuba's own in the active variant;
    except ``scalar``, which is measured in ``scalar_rgb``. Times mean something only while the machine does nothing
    else.

    Args:
        only: the names of the sections to run, by default all of :data:`SECTIONS`.
        on_progress: called with the name of the section, the steps done, and how many it has.

    Raises:
        ValueError: for an unknown name of a section, or a variant that is not vectorized and unpolarized.
    """
    wanted = set(SECTIONS if only is None else only)
    if unknown := sorted(wanted - set(SECTIONS)):
        raise ValueError(f"There is no section {unknown[0]!r}; there are {', '.join(SECTIONS)}.")
    variant = mi.variant()
    if not is_measurable(variant):
        raise ValueError(f"Measuring needs a vectorized and unpolarized variant, not {variant}.")
    run = Run(on_progress, all_cases())
    figures = []
    for run.section in (name for name in SECTIONS if name in wanted):
        figures += SECTIONS[run.section](run)
    setup = versions() | {"variant": variant, "threads": str(dr.thread_count())}
    if variant.startswith("llvm"):
        setup["llvm"] = llvm.dotted(llvm.version())
    return Results(figures, setup, {case.name: asdict(case) for case in run.cases})
