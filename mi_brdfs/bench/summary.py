"""The summary of the results in docs/bench.md, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from .cases import Case
from .figure import MISSED, Figure
from .scenes import BOX, SPHERE

HEAD = ["", "η", "η of the built-in", "time: sphere", "time: box", "time × variance: sphere", "time × variance: box"]

Sections = dict[str, list[Figure]]


def summary(figures: Sequence[Figure], setup: dict[str, str], cases: dict[str, dict[str, Any]]) -> str:
    """Return a table of the cases that are the same model as a built-in, and a list of the rest, without what was not
    measured. The arguments are those of :class:`~mi_brdfs.bench.Results`."""
    sections: Sections = {}
    for figure in figures:
        sections.setdefault(figure.section, []).append(figure)
    versions = ", ".join(f"{name} {setup[key]}" for name, key in
                         (("Mitsuba", "mitsuba"), ("Dr.Jit", "drjit"), ("LLVM", "llvm")) if key in setup)  # fmt: skip
    lines = [
        f"Measured by `mi-brdfs bench` with {versions}, in `{setup['variant']}` with {setup['threads']} threads.",
        "",
    ]
    rows = [row for case in cases.values() if (row := _row(sections, Case(**case)))]
    if rows:
        lines += [f"| {' | '.join(cells)} |" for cells in (HEAD, ["---"] * len(HEAD), *rows)] + [""]
    return "\n".join(lines + [f"* {sentence}" for sentence in _sentences(sections)]) + "\n"


def _row(sections: Sections, case: Case) -> list[str]:
    """Return the cells of a case, or none if nothing of it was measured."""
    if not case.same:
        return []
    ours, theirs = (_range(sections, subject) for subject in (case.name, case.beside))
    cells = [
        _figure(sections, section, case.beside, scene) for section in ("time", "variance") for scene in (SPHERE, BOX)
    ]
    plugin, *words = case.name.split(maxsplit=1)
    name = f"`{plugin}` {words[0] if words else ''}".strip()
    return [f"{name} / `{case.other['type']}`", ours, theirs, *cells] if any([ours, *cells]) else []


def _range(sections: Sections, subject: str) -> str:
    """Return the efficiencies of a row."""
    figures = [f for f in sections.get("efficiency", []) if f.subject == subject and f.name.endswith("°")]
    if not figures:
        return ""
    least, largest = (choose(figure.value for figure in figures) for choose in (min, max))
    return f"{least:.3f} to {largest:.3f}{MISSED if any(f.missed for f in figures) else ''}"


def _figure(sections: Sections, section: str, subject: str, name: str) -> str:
    return next((f.marked for f in sections.get(section, []) if (f.subject, f.name) == (subject, name)), "")


def _sentences(sections: Sections) -> Iterator[str]:
    judged = {name: [f for f in figures if f.targets] for name, figures in sections.items()}
    lobes = [f for f in judged.get("efficiency", []) if any(t.reason == "each lobe" for t in f.targets)]
    if lobes:
        worst = {f.name: f for f in sorted(lobes, key=lambda f: f.value, reverse=True)}
        told = ", ".join(f"{worst[name].marked} at {name}" for name in dict.fromkeys(f.name for f in lobes))
        yield f"The least efficiency η = E[w]²/E[w²] of a lobe of any model is {told}."
    if first := judged.get("first"):
        told = ", ".join(f"{figure.subject} {figure.marked}" for figure in first)
        yield f"The time to the first picture, traced and compiled, over the built-in's: {told}."
    if kernels := judged.get("recompiles"):
        changed = sum(f.value for f in sections["recompiles"] if not f.targets)
        compiled = sum(f.value for f in kernels)
        yield f"Changing {changed} parameters, and loading a scene again, compiles {compiled} kernels."
    if cycles := judged.get("cycles"):
        told = ", ".join(f"{figure.name} {figure.marked}" for figure in cycles)
        yield f"Over {cycles[0].subject} of loading, rendering and discarding a scene: {told}."
    if scalar := judged.get("scalar"):
        told = ", ".join(f"{figure.subject} {figure.marked}" for figure in scalar)
        yield f"The time in `scalar_rgb`, over the built-in's: {told}."
    figures = [figure for section in sections.values() for figure in section]
    targets, missed = sum(len(figure.targets) for figure in figures), sum(len(figure.missed) for figure in figures)
    yield f"Of {targets} targets {missed} are missed{MISSED}; `mi-brdfs bench` names them."
