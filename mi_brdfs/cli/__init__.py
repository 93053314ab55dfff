"""The command line ``mi-brdfs``.

A file for each command. Results go to stdout, errors and progress to stderr. Exit status: 0 success, 1 error, 2 wrong
usage, 3 if ``check`` could judge nothing, 130 after Ctrl-C.
"""

from . import list, info, presets, measured, doctor, show, render, gallery, plot, convert, fit, explore, check, energy, bench  # noqa: E501, F401, I001 -- in the order of --help
from .app import app, main

__all__ = ["app", "main"]
