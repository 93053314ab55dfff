"""Measured BRDFs: files, tables, and what they say."""

from .conversion import Conversion, convert
from .files import FileError
from .formats import read
from .grid import Axis, Grid
from .measurement import Measurement
from .report.summary import Summary, summarize
from .scattered import Samples, as_grid

__all__ = [
    "Axis",
    "Conversion",
    "FileError",
    "Grid",
    "Measurement",
    "Samples",
    "Summary",
    "as_grid",
    "convert",
    "read",
    "summarize",
]
