"""How little noise a BSDF makes, and what it costs, beside Mitsuba's own: ``bench()``, or ``bench(["efficiency"])``.

:func:`bench` returns :class:`Results`: figures with the targets that they have to reach. :data:`SECTIONS` lists what is
measured by name; their docstrings say how.
"""

from .figure import Figure, Target
from .report import Results
from .runner import SECTIONS, bench

__all__ = ["SECTIONS", "Figure", "Results", "Target", "bench"]
