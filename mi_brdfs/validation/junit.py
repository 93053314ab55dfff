"""Reports as JUnit's XML, which servers of continuous integration read."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from ..parameters.messages import printable
from .report import Finding, Report


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
