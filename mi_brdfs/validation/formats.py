"""Reports for others: in a terminal, folded to the width, and as JUnit's XML for servers of continuous integration."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree

from ..parameters.messages import printable
from .report import Finding, Report

STYLES = {"FAILED": "bold red", "passed": "bold green", "not judged": "bold yellow", "fail": "red", "note": "yellow"}


def block(report: Report, width: int) -> Iterator[tuple[str, str]]:
    """Yield the lines of a block with their styles: the outcome, the checks by their verdicts, and the sentences."""
    yield from _folded(f"{report.name}: {report.outcome}", width, "", STYLES[report.outcome])
    for verdict, checks in report.by_verdict:
        word = "FAIL" if verdict == "fail" else verdict
        told = ", ".join(checks)
        if verdict == "skip":
            told = " ".join(f"{check}: {report.why_skipped(check)}" for check in checks)
        yield from _folded(f"  {word}  {told}", width, " " * 8, STYLES.get(verdict, "dim"))
    if first := report.first_to_fix:
        yield from _folded(f"  Fix {first} first; failures of later checks may follow from it.", width, " " * 4, "")
    for sentence in report.sentences:
        yield from _folded(f"  {sentence}", width, " " * 4, "")


def _folded(text: str, width: int, indent: str, style: str) -> Iterator[tuple[str, str]]:
    for line in textwrap.wrap(printable(text), width, subsequent_indent=indent, break_on_hyphens=False):
        yield line, style


def junit(reports: Sequence[Report]) -> str:
    """Return the XML: a test suite for each report, with a test case for each finding."""
    every = [finding for report in reports for finding in report.findings]
    root = ElementTree.Element("testsuites", {"name": "mi-brdfs check"} | _counts(every))
    for report in reports:
        suite = ElementTree.SubElement(root, "testsuite", {"name": printable(report.name)} | _counts(report.findings))
        for finding in report.findings:
            name = printable(f"{finding.check}, {finding.subject}")
            case = ElementTree.SubElement(suite, "testcase", classname=printable(report.name), name=name)
            if finding.verdict == "fail":
                failure = ElementTree.SubElement(case, "failure", message=printable(finding.message))
                failure.text = "\n".join(map(printable, [*finding.data.get("faults", []), finding.where]))
            elif finding.verdict == "skip":
                ElementTree.SubElement(case, "skipped", message=printable(finding.message))
            else:
                ElementTree.SubElement(case, "system-out").text = printable(finding.message)
    ElementTree.indent(root)
    return ElementTree.tostring(root, "utf-8", xml_declaration=True).decode() + "\n"


def _counts(findings: Sequence[Finding]) -> dict[str, str]:
    verdicts = [finding.verdict for finding in findings]
    counts = {"tests": len(verdicts), "failures": verdicts.count("fail"), "skipped": verdicts.count("skip")}
    return {name: str(count) for name, count in counts.items()}
