"""Reports as one page of HTML that needs nothing else: what is wrong in sentences, pictures of it, and all findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..pages import environment
from ..pages.figures import svg
from .pictures import SURE, chart, pictures
from .report import Finding, Report
from .trial import Trial


def page(reports: Sequence[Report]) -> str:
    """Return the page, as text."""
    functions = {"parts": _parts, "others": _others}
    drawings = {"pictures": pictures, "chart": chart, "svg": svg, "sure": SURE}
    return environment.get_template("check.html").render(reports=reports, **functions, **drawings)


def _parts(report: Report) -> Iterator[tuple[str, list[Trial], dict[str, dict[str, Any]]]]:
    """Yield the name of the whole and of each component, its trials, and the data of each check of energy."""
    energy = [finding for finding in report.findings if finding.check in ("albedo", "efficiency") and finding.data]
    for name in dict.fromkeys([trial.part for trial in report.trials] + [finding.subject for finding in energy]):
        trials = [trial for trial in report.trials if trial.part == name]
        yield name, trials, {finding.check: finding.data for finding in energy if finding.subject == name}


def _others(finding: Finding) -> list[str]:
    """Return the faults that its message only counts."""
    return [fault for fault in finding.data.get("faults", []) if not finding.message.startswith(fault)]
