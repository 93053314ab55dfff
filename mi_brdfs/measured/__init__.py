"""Measured BRDFs: files, tables, and what they say."""

from .formats import read
from .measurement import Axis, FileError, Grid, Measurement, Samples

__all__ = ["Axis", "FileError", "Grid", "Measurement", "Samples", "read"]
