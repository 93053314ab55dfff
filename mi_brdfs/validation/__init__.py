"""Checks of any BSDF: ``check({"type": "ward"})``, or of one that is loaded.

:func:`check` returns a :class:`Report` with a :class:`Finding` for each check of each part of the BSDF: a verdict and
one sentence. :func:`compare` does so for the values of two BSDFs. :data:`CHECKS` lists the checks by name; their
docstrings say what they check and how strictly; docs/extending.md says what they cannot see.
"""

from .report import Finding, Report
from .runner import CHECKS, check, compare

__all__ = ["CHECKS", "Finding", "Report", "check", "compare"]
