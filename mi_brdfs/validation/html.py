"""Reports as one page of HTML that needs nothing else: what is wrong in sentences, pictures of it, and all findings."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from ..pages import environment
from ..pages.figures import svg
from ..probe.chi_square import in_words
from .pictures import SURE, chart, pictures
from .report import Finding, Report
from .runner import CHECKS
from .trial import Trial


def page(reports: Sequence[Report], again: Sequence[str] = ()) -> str:
    """Return the page, as text, failures first; ``again`` are the commands that make the failing checks again."""
    functions = {"parts": _parts, "others": _others, "failures": _failures, "meaning": _meaning, "in_words": in_words}
    drawings = {"pictures": pictures, "chart": chart, "svg": svg, "sure": SURE}
    checked = sorted(zip(reports, again or [""] * len(reports), strict=True), key=lambda it: not it[0].failures)
    return environment.get_template("check.html").render(checked=checked, **functions, **drawings)


def _parts(report: Report) -> Iterator[tuple[str, list[Trial], dict[str, dict[str, Any]], list[str]]]:
    """Yield the name of the whole and of each component, its trials, the data of each check of energy, and the checks
    of the sampler that fail: then the efficiency means nothing, and is left out."""
    energy = [finding for finding in report.findings if finding.check in ("albedo", "efficiency") and finding.data]
    for name in dict.fromkeys([trial.part for trial in report.trials] + [finding.subject for finding in energy]):
        failing = [it.check for it in report.failures if it.subject == name and it.check in ("weight", "pdf", "chi2")]
        trials = [trial for trial in report.trials if trial.part == name]
        shown = [it for it in energy if it.subject == name and not (failing and it.check == "efficiency")]
        yield name, trials, {finding.check: finding.data for finding in shown}, failing


def _failures(report: Report) -> list[tuple[str, list[Finding]]]:
    """Return the checks that fail with their findings, in the order of checks: from causes to consequences."""
    return [(word, list(own)) for word, own in groupby(report.failures, key=lambda it: it.check)]


def _meaning(word: str) -> str:
    """Return what a check does, in a clause, empty if there is no such check."""
    told = CHECKS[word].__doc__ if word in CHECKS else ""
    return re.split(r"[.:;]\s", (told or "").replace("``", ""))[0].replace("Check", "checks")


def _others(finding: Finding) -> list[str]:
    """Return the faults that its message only counts."""
    return [fault for fault in finding.data.get("faults", []) if not finding.message.startswith(fault)]
