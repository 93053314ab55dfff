"""Pages of HTML that need nothing else: their templates, which share a frame and a style sheet."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi

try:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
except ImportError:
    raise ImportError("reports need Jinja2 and Matplotlib: pip install 'mi_brdfs[report]'") from None

from .. import __version__

environment = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    undefined=StrictUndefined,
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
)
environment.globals |= {"version": __version__, "mitsuba": mi.__version__}
