"""Checks of any BSDF: ``check({"type": "ward"})``, or of one that is loaded.

:func:`check` returns a :class:`Report` with a :class:`Finding` for each check of each part of the BSDF: a verdict and
one sentence. :data:`CHECKS` lists the checks by name; their docstrings say what they check and how strictly.
"""

from .report import Finding, Report
from .runner import CHECKS, check

__all__ = ["CHECKS", "Finding", "Report", "check"]
