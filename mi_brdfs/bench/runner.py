"""The runner of the sections."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict

import drjit as dr
import mitsuba as mi

from ..doctor import versions
from ..mitsuba import llvm
from ..variants import is_measurable
from .cases import all_cases
from .efficiency import efficiency
from .figure import Figure
from .first import first
from .report import Results
from .resources import cycles, recompiles
from .run import BenchRun
from .scalar import scalar
from .timing import time, variance

SECTIONS: dict[str, Callable[[BenchRun], Iterator[Figure]]] = {
    section.__name__: section for section in (efficiency, time, variance, first, recompiles, cycles, scalar)
}
"""The measurements by name, in order; the docstring of each has the method and the targets."""


def bench(
    only: Iterable[str] | None = None, on_progress: Callable[[str, int, int], None] = lambda section, done, of: None
) -> Results:
    """Measure all models, including those registered by others, against Mitsuba's own in the active variant; ``scalar``
    is measured in ``scalar_rgb``. Times are meaningful only on an otherwise idle machine.

    Args:
        only: the names of the sections to run, by default all of :data:`SECTIONS`.
        on_progress: called with the name of the section, the steps done, and their total number.

    Raises:
        ValueError: if a section is unknown, or the variant is not vectorized and unpolarized.
    """
    wanted = set(SECTIONS if only is None else only)
    if unknown := sorted(wanted - set(SECTIONS)):
        raise ValueError(f"There is no section {unknown[0]!r}; there are {', '.join(SECTIONS)}.")
    variant = mi.variant()
    if not is_measurable(variant):
        raise ValueError(f"Measuring needs a vectorized and unpolarized variant, not {variant}.")
    run = BenchRun(on_progress, all_cases())
    figures: list[Figure] = []
    for run.section in (name for name in SECTIONS if name in wanted):
        figures += SECTIONS[run.section](run)
    setup = versions() | {"variant": variant, "threads": str(dr.thread_count())}
    if variant.startswith("llvm") and (found := llvm.version()):
        setup["llvm"] = llvm.dotted(found)
    return Results(figures, setup, {case.name: asdict(case) for case in run.cases})
