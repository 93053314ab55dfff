"""Compare the noise and cost of BSDFs with those of Mitsuba's own: ``bench()``, or ``bench(["efficiency"])``.

:func:`bench` returns :class:`Results`: figures with their targets. :data:`SECTIONS` lists the measurements by name;
their docstrings say how they work.
"""

from .figure import Figure, Target
from .report import Results
from .runner import SECTIONS, bench

__all__ = ["SECTIONS", "Figure", "Results", "Target", "bench"]
