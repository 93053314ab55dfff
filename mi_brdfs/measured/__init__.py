"""Measured BRDFs: files, tables, and what they say."""

from .conversion import Conversion, bake, convert
from .files import FileError
from .formats import read
from .grid import Axis, Grid
from .measurement import Measurement
from .report.summary import Summary, summarize
from .scattered import Samples, as_grid
from .source import Source

__all__ = [
    "Axis",
    "Conversion",
    "FileError",
    "Grid",
    "Measurement",
    "Samples",
    "Source",
    "Summary",
    "as_grid",
    "bake",
    "convert",
    "read",
    "summarize",
]
