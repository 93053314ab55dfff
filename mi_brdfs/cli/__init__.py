"""The command line ``mi-brdfs``.

A file for each command, with ``list`` beside ``info``. Results go to stdout, errors and progress to stderr. Exit
status: 0 success, 1 error, 2 wrong usage, 3 if ``check`` could judge nothing, 130 after Ctrl-C, 143 after SIGTERM.
"""

from . import info, presets, show, render, gallery, plot, explore, upgrade  # noqa: F401, I001 -- in the order of --help
from . import measured, convert, fit, sweep, check, bench, energy, doctor  # noqa: F401
from .app import app, main

__all__ = ["app", "main"]
