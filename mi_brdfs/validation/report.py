"""What a check found, also as a block of text for a terminal, and as JUnit's XML for continuous integration."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args
from xml.etree import ElementTree

import numpy as np

from ..parameters.messages import printable
from .trial import Trial

Verdict = Literal["fail", "note", "pass", "skip", "info"]
"""The gravest first."""
INSTEAD = "Check a rough BSDF in its place, as roughconductor is for conductor."
"""What to do where a BSDF has delta functions only."""


CAUSES = "finite", "horizon", "support", "eval_pdf", "weight", "pdf", "chi2"
"""Checks whose faults others see, too."""


@dataclass(frozen=True)
class Finding:
    """The verdict of one check on one part of a BSDF."""

    check: str
    """The name of the check, one of ``mi_brdfs.validation.CHECKS``."""
    subject: str
    """What was checked: the whole, or one of its components or parameters."""
    verdict: Verdict
    """``fail``, ``note`` if it passes but the user should know of it, ``pass``, ``skip`` if it could not be checked, or
    ``info`` if there is nothing to judge."""
    message: str
    """One sentence: what is wrong and by how much, or how good it is."""
    data: dict[str, Any] = field(default_factory=dict)
    """The numbers behind it."""
    at: dict[str, Any] = field(default_factory=dict)
    """What reproduces a failure, as far as it has this: the directions ``wi`` and ``wo`` of the local frame, and the
    ``seed`` of the uniform variates, ``numpy.random.default_rng(seed).random((n, 3), dtype="float32")``."""

    @property
    def where(self) -> str:
        """What reproduces it, as a sentence."""
        return f"At {', '.join(f'{name} = {_exact(value)}' for name, value in self.at.items())}." if self.at else ""

    @property
    def sentence(self) -> str:
        """The message, with what reproduces it."""
        return f"{self.message} {self.where}".rstrip()


@dataclass(frozen=True)
class Report:
    """All findings on one BSDF."""

    name: str
    findings: list[Finding]
    trials: list[Trial] = field(default_factory=list, repr=False, compare=False)
    """The histograms that the checks of the sampler were made of."""

    @property
    def judged(self) -> bool:
        """Whether anything was judged."""
        return any(finding.verdict in ("pass", "note", "fail") for finding in self.findings)

    @property
    def passed(self) -> bool:
        """Whether something was judged, and nothing failed."""
        return self.judged and not self.failures

    @property
    def failures(self) -> list[Finding]:
        """The findings that failed, what to fix first in front."""
        first = self.first_to_fix
        return sorted(self._failed(), key=lambda it: it.check != first)

    def _failed(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.verdict == "fail"]

    @property
    def first_to_fix(self) -> str:
        """The first check that failed for what may be the fault of those that failed after it, or none."""
        failing = list(dict.fromkeys(finding.check for finding in self._failed()))
        return next((check for check in failing[:-1] if check in CAUSES), "")

    @property
    def why_not_judged(self) -> str:
        """A sentence for the user if nothing passed or failed, and else none."""
        if self.judged:
            return ""
        told = list(dict.fromkeys(finding.message for finding in self.findings))
        if all(finding.check == "components" for finding in self.findings):
            told.append(INSTEAD)
        return " ".join(["Nothing was judged.", *told])

    @property
    def outcome(self) -> str:
        """The verdict on the BSDF in a word or two."""
        return "passed" if self.passed else "FAILED" if self.judged else "not judged"

    def verdict(self, check: str) -> Verdict | None:
        """Return the gravest verdict of a check, or None if it was not made."""
        found = [finding.verdict for finding in self.of(check)]
        return next((verdict for verdict in get_args(Verdict) if verdict in found), None)

    @property
    def by_verdict(self) -> list[tuple[Verdict, list[str]]]:
        """The names of the checks by their verdicts, the gravest first."""
        checks = dict.fromkeys(finding.check for finding in self.findings)
        every = ((verdict, [it for it in checks if self.verdict(it) == verdict]) for verdict in get_args(Verdict))
        return [(verdict, named) for verdict, named in every if named]

    def why_skipped(self, check: str) -> str:
        """Return why a check of the verdict ``skip`` was not made."""
        return next(finding.message for finding in self.of(check) if finding.verdict == "skip")

    def of(self, check: str) -> list[Finding]:
        """Return the findings of one check."""
        return [finding for finding in self.findings if finding.check == check]

    @property
    def sentences(self) -> list[str]:
        """What a user should read: failures with what reproduces them, notes, and why nothing was judged."""
        notable = [*self.failures, *(finding for finding in self.findings if finding.verdict == "note")]
        told = [f"{finding.check}, {finding.subject}: {finding.sentence}" for finding in notable]
        return [*told, *([self.why_not_judged] if self.why_not_judged else [])]

    def to_dict(self) -> dict[str, Any]:
        """Return the report in types that JSON has."""
        findings = [asdict(finding) for finding in self.findings]
        return {"name": self.name, "passed": self.passed, "judged": self.judged, "findings": findings}

    def __str__(self) -> str:
        rows = [(f.verdict, f.check, f.subject, f.sentence) for f in self.findings]
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
        lines = ["  ".join([*map(str.ljust, row, widths), row[3]]) for row in rows]
        return "\n".join([f"{self.name}: {self.outcome}", *lines])


def _exact(value: Any) -> str:
    """Return a direction, in the digits of float32, or another value."""
    if isinstance(value, list):
        return f"[{', '.join(str(np.float32(number)) for number in value)}]"
    return str(value)


# --- In a terminal, and as XML --------------------------------------------------------------------------------------


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
