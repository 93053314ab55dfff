"""Measured BRDFs: files, tables, and what they say."""

from .formats import read
from .measurement import Axis, FileError, Grid, Measurement, Samples
from .summary import Summary, summarize

__all__ = ["Axis", "FileError", "Grid", "Measurement", "Samples", "Summary", "read", "summarize"]
