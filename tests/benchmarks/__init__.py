"""The project's own benchmark: the noise and cost of its models compared with Mitsuba's, and targets.

    python tests/benchmarks [--only SECTION] [--json docs/bench.json]

Everything takes about ten minutes on two idle cores. :data:`SECTIONS` lists the measurements; their docstrings say how
they work. ``python docs/generate`` makes docs/bench.md of the JSON.
"""

from .efficiency import efficiency
from .resources import cycles, recompiles
from .times import first, pictures, scalar

SECTIONS = {section.__name__: section for section in (efficiency, pictures, first, recompiles, cycles, scalar)}
