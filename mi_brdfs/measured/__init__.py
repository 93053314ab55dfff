"""Measured BRDFs: files, tables, and what they say."""

from .convert import Conversion, bake, convert
from .formats import read
from .measurement import Axis, FileError, Grid, Measurement, Samples
from .source import Source
from .summary import Summary, summarize

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
