"""Reports as one page of HTML that needs nothing else: what is wrong in sentences, pictures of it, and all findings."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import get_args

import mitsuba as mi

from .. import __version__
from .chart import chart
from .pictures import pictures
from .report import Finding, Report, Verdict
from .svg import DENSITY, DEVIATION, gradient

STYLE = """
:root { color-scheme: light dark; --ink: #222; --faint: #666; --line: #ccc; --paper: #fff; --bad: #b3261e;
  --albedo: #0072b2; --efficiency: #b35900 }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --faint: #999; --line: #444; --paper: #16181c;
  --bad: #ff8a80; --albedo: #56b4e9; --efficiency: #e69f00 } }
body { margin: 0 auto; padding: 1rem; max-width: 82rem; font: 1rem/1.45 system-ui, sans-serif; color: var(--ink);
  background: var(--paper) }
h1, h2, li, td:last-child { overflow-wrap: anywhere }
h2 { margin-top: 3rem; border-top: 1px solid var(--line); padding-top: 1rem }
a { color: inherit }
table { border-collapse: collapse; font-size: 0.9rem }
tr { border-top: 1px solid var(--line) }
td { padding: 0.15rem 1.2rem 0.15rem 0; vertical-align: top }
@media (max-width: 48rem) { td { display: inline-block } td:last-child { display: block } }
ul { margin: 0; padding-left: 1.2rem }
.summary { list-style: none; padding: 0 }
.summary li { margin: 0.5rem 0 }
.summary div { color: var(--faint); font-size: 0.85rem }
.fail { color: var(--bad) }
.fail { font-weight: 600 }
.skip, .info, figcaption, footer { color: var(--faint) }
figure { margin: 1rem 0 }
figcaption { font-size: 0.9rem }
.rows { display: grid; gap: 0.5rem 2rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 32rem), 1fr)) }
.rows p { margin: 0.5rem 0 0 }
.energy { display: flex; flex-wrap: wrap; gap: 1rem 2rem; align-items: center }
.energy figcaption { flex: 1 20rem }
svg { display: block; fill: currentColor; font-size: 10px }
.panels { width: 100% }
@media (max-width: 36rem) { .panels { font-size: 14px } }
.chart { flex: 1 20rem; max-width: 24rem }
.middle { text-anchor: middle }
.end { text-anchor: end }
image { image-rendering: pixelated }
path, circle { fill: none; vector-effect: non-scaling-stroke }
.ring { stroke: #808080; stroke-dasharray: 3 4 }
.horizon { stroke: #808080 }
.halo { stroke: #fff; stroke-width: 3 }
.mark { stroke: #000; stroke-width: 1.2 }
.grid { stroke: var(--line) }
.albedo { stroke: var(--albedo); stroke-width: 2 }
.efficiency { stroke: var(--efficiency); stroke-width: 2; stroke-dasharray: 6 3 }
.behind { stroke-width: 1 }
"""


def page(reports: Sequence[Report]) -> str:
    """Return the page, as text."""
    failed = sum(bool(report.failures) for report in reports)
    unjudged = sum(not report.judged for report in reports)
    heading = f"{len(reports)} BSDF{'s' if len(reports) != 1 else ''} checked, {failed or 'none'} failed"
    heading += f", {unjudged} not judged" if unjudged else ""
    sections = "\n".join(_section(report, f"bsdf-{k}") for k, report in enumerate(reports, 1))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{heading}</title>
<style>{STYLE}</style>
</head>
<body>
<header><h1>{heading}</h1></header>
<main>
{_summary(reports)}
<svg width="0" height="0" aria-hidden="true">{gradient("density", DENSITY)}{gradient("deviation", DEVIATION)}</svg>
{sections}
</main>
<footer><p>mi_brdfs {escape(__version__)}, Mitsuba {escape(mi.__version__)}</p></footer>
</body>
</html>
"""


def _summary(reports: Sequence[Report]) -> str:
    """Return a list with an item for each report: the outcome, and the checks by their verdicts."""
    items = []
    for k, report in enumerate(reports, 1):
        checks = dict.fromkeys(finding.check for finding in report.findings)
        verdicts = {verdict: [it for it in checks if report.verdict(it) == verdict] for verdict in get_args(Verdict)}
        told = [f"{verdict}: {', '.join(named)}" for verdict, named in verdicts.items() if named]
        items.append(
            f'<li><a href="#bsdf-{k}">{escape(report.name)}</a> <span class="{_kind(report)}">{report.outcome}</span>'
            f"<div>{escape('; '.join(told))}</div></li>"
        )
    return f'<ul class="summary">{"".join(items)}</ul>'


def _kind(report: Report) -> str:
    return "fail" if report.failures else "" if report.judged else "skip"


def _cell(verdict: Verdict) -> str:
    return f'<td class="{verdict}">{"FAIL" if verdict == "fail" else verdict}</td>'


def _section(report: Report, anchor: str) -> str:
    """Return all about one BSDF."""
    energy = [finding for finding in report.findings if finding.check in ("albedo", "efficiency") and finding.data]
    figures = []
    for part in dict.fromkeys([trial.part for trial in report.trials] + [finding.subject for finding in energy]):
        alt, trials = f"{report.name}, {part}", [trial for trial in report.trials if trial.part == part]
        curves = {finding.check: finding.data for finding in energy if finding.subject == part}
        figures += [f"<h3>{escape(part)}</h3>"]
        figures += [pictures(alt, trials)] if trials else []
        figures += [chart(alt, curves)] if curves else []
    rows = [
        f"<tr>{_cell(finding.verdict)}<td>{escape(finding.check)}</td><td>{escape(finding.subject)}</td>"
        f"<td>{escape(finding.sentence)}{_list(_others(finding))}</td></tr>"
        for finding in report.findings
    ]
    return f"""<section id="{anchor}">
<h2>{escape(report.name)}</h2>
{_outcome(report)}
{"".join(figures)}
<details><summary>All findings</summary>
<table><tbody>
{"".join(rows)}
</tbody></table>
</details>
</section>"""


def _outcome(report: Report) -> str:
    return f'<p class="{_kind(report)}">{report.outcome.capitalize()}.</p>{_list(report.sentences)}'


def _others(finding: Finding) -> list[str]:
    """Return the faults that its message only counts."""
    return [fault for fault in finding.data.get("faults", []) if not finding.message.startswith(fault)]


def _list(sentences: Sequence[str]) -> str:
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<ul>{items}</ul>" if items else ""
