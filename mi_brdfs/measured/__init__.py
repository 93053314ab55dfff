"""Measured BRDFs: files, tables, and what they say."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .conversion import Conversion, bake, convert
    from .formats import read
    from .measurement import Axis, FileError, Grid, Measurement, Samples
    from .report.summary import Summary, summarize
    from .source import Source

_HOMES = {
    "conversion": ("Conversion", "bake", "convert"),
    "formats": ("read",),
    "measurement": ("Axis", "FileError", "Grid", "Measurement", "Samples"),
    "source": ("Source",),
    "report.summary": ("Summary", "summarize"),
}
"""The modules of the public names, imported when they are used: the readers take time."""

__all__ = [
    "Axis",
    "Conversion",
    "FileError",
    "Grid",
    "Measurement",
    "Samples",
    "Source",
    "Summary",
    "bake",
    "convert",
    "read",
    "summarize",
]


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(importlib.import_module(f".{module}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
