"""Reports as one page of HTML that needs nothing else: what is wrong in sentences, pictures of it, and all findings."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

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
h1, h2, li, th:first-child, td:last-child { overflow-wrap: anywhere }
h2 { margin-top: 3rem; border-top: 1px solid var(--line); padding-top: 1rem }
a { color: inherit }
.wide { overflow-x: auto }
table { border-collapse: collapse; font-size: 0.9rem }
th, td { padding: 0.15rem 0.6rem; text-align: left; vertical-align: top }
thead th { border-bottom: 1px solid var(--line) }
ul { margin: 0; padding-left: 1.2rem }
.fail { color: var(--bad) }
td.fail, span.fail { font-weight: 600 }
.skip, .info, .none, figcaption, footer { color: var(--faint) }
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
    failed = sum(not report.passed for report in reports)
    heading = f"{len(reports)} BSDF{'s' if len(reports) != 1 else ''} checked, {failed or 'none'} failed"
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
    """Return a table with a row for each report, a column for each check."""
    checks = list(dict.fromkeys(finding.check for report in reports for finding in report.findings))
    heads = "".join(f'<th scope="col">{escape(check)}</th>' for check in checks)
    rows = []
    for k, report in enumerate(reports, 1):
        cells = "".join(_cell(report.verdict(check)) for check in checks)
        rows.append(f'<tr><th scope="row"><a href="#bsdf-{k}">{escape(report.name)}</a></th>{cells}</tr>')
    return _table(rows, f'<thead><tr><th scope="col">BSDF</th>{heads}</tr></thead>')


def _cell(verdict: Verdict | None) -> str:
    return f'<td class="{verdict or "none"}">{"FAIL" if verdict == "fail" else verdict or "-"}</td>'


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
        f"<td>{escape(finding.message)}{_list(_others(finding))}</td></tr>"
        for finding in report.findings
    ]
    return f"""<section id="{anchor}">
<h2>{escape(report.name)}</h2>
{_outcome(report)}
{"".join(figures)}
<details><summary>All findings</summary>
{_table(rows)}
</details>
</section>"""


def _outcome(report: Report) -> str:
    if not report.passed:
        return _list([f"{f.check}, {f.subject}: {f.message}" for f in report.failures], "fail")
    return f"<p>{escape(report.why_not_judged or 'Passed.')}</p>"


def _others(finding: Finding) -> list[str]:
    """Return the faults that its message only counts."""
    return [fault for fault in finding.data.get("faults", []) if not finding.message.startswith(fault)]


def _list(sentences: Sequence[str], kind: str = "") -> str:
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f'<ul class="{kind}">{items}</ul>' if items else ""


def _table(rows: Sequence[str], head: str = "") -> str:
    return f'<div class="wide"><table>{head}<tbody>\n{"".join(rows)}\n</tbody></table></div>'
