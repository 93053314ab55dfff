"""Reports in a terminal: a block for each BSDF, folded to the width."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import get_args

from ..parameters.messages import printable
from .report import Report, Verdict

STYLES = {"FAILED": "bold red", "passed": "bold green", "not judged": "bold yellow", "fail": "red", "note": "yellow"}


def block(report: Report, width: int) -> Iterator[tuple[str, str]]:
    """Yield the lines of a block with their styles: the outcome, the checks by their verdicts, and the sentences."""
    yield from _folded(f"{report.name}: {report.outcome}", width, "", STYLES[report.outcome])
    checks = list(dict.fromkeys(finding.check for finding in report.findings))
    for verdict in get_args(Verdict):
        if named := [check for check in checks if report.verdict(check) == verdict]:
            word = "FAIL" if verdict == "fail" else verdict
            yield from _folded(f"  {word}  {', '.join(named)}", width, " " * 8, STYLES.get(verdict, "dim"))
    for sentence in report.sentences:
        yield from _folded(f"  {sentence}", width, " " * 4, "")


def _folded(text: str, width: int, indent: str, style: str) -> Iterator[tuple[str, str]]:
    for line in textwrap.wrap(printable(text), width, subsequent_indent=indent, break_on_hyphens=False):
        yield line, style
