"""Tests of BSDFs, with pytest or anything else that runs ``assert`` statements.

from mi_brdfs.testing import assert_bsdf  # before mitsuba
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")

def test_mine():
    assert_bsdf({"type": "mine", "alpha": 0.3})
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi

from .validation import Report, check

__all__ = ["assert_bsdf"]


def assert_bsdf(bsdf: dict[str, Any] | mi.BSDF, **options: Any) -> Report:
    """Check a BSDF, and return the report if it passes.

    Args:
        bsdf: a plugin dict, or a loaded BSDF, which must belong to the active variant.
        options: the keyword arguments of :func:`mi_brdfs.validation.check`: ``angles``, ``significance``, ``only``,
            ``conserves``, ``name``.

    Raises:
        AssertionError: if a check fails, or nothing is judged. The message has a sentence for each failure, with the
            directions and the seed that reproduce it, and the call that makes the failing checks again.
        ValueError: as ``check`` does.
    """
    __tracebackhide__ = True  # pytest shows the caller's line
    report = check(bsdf, **options)
    if not report.passed:
        lines = [f"{report.name}: {report.outcome}", *report.sentences]
        if failing := list(dict.fromkeys(finding.check for finding in report.failures)):
            given = ", ".join(f"{name}={value!r}" for name, value in (options | {"only": failing}).items())
            lines.append(f"Again: mi_brdfs.validation.check({bsdf if isinstance(bsdf, dict) else 'bsdf'}, {given})")
        raise AssertionError("\n".join(lines))
    return report
