"""Measured BRDFs: files, tables, and what they say."""

from .conversion import Conversion, bake, convert
from .formats import read
from .measurement import Axis, FileError, Grid, Measurement, Samples
from .report.summary import Summary, summarize
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
    "bake",
    "convert",
    "read",
    "summarize",
]
