"""Measured BRDFs: files, tables, and what they say."""

from .convert import Conversion, bake, convert
from .formats import read
from .measurement import Axis, FileError, Grid, Measurement, Samples
from .source import Source

__all__ = ["Axis", "Conversion", "FileError", "Grid", "Measurement", "Samples", "Source", "bake", "convert", "read"]
