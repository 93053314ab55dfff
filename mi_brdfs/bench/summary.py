"""The README's summary of what was measured, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator

from .cases import Case
from .report import MISSED, Results
from .scenes import BOX, SPHERE

HEAD = ["", "η", "η of the built-in", "time: sphere", "box", "time × variance: sphere", "box"]


def summary(results: Results) -> str:
    """The cases beside the same model of Mitsuba's in a table, and the rest in a list. What was not measured is left
    out."""
    setup = results.setup
    versions = ", ".join(f"{name} {setup[key]}" for name, key in
                         (("Mitsuba", "mitsuba"), ("Dr.Jit", "drjit"), ("LLVM", "llvm")) if key in setup)  # fmt: skip
    lines = [
        f"Measured by `mi-brdfs bench` with {versions}, in `{setup['variant']}` with {setup['threads']} threads.",
        "",
    ]
    rows = [row for case in results.cases.values() if (row := _row(results, Case(**case)))]
    if rows:
        lines += [f"| {' | '.join(cells)} |" for cells in (HEAD, ["---"] * len(HEAD), *rows)] + [""]
    return "\n".join(lines + [f"* {sentence}" for sentence in _sentences(results)]) + "\n"


def _row(results: Results, case: Case) -> list[str]:
    """The cells of a case, or none if nothing of it was measured."""
    if not case.same:
        return []
    ours, theirs = (_range(results, subject) for subject in (case.name, case.beside))
    cells = [
        _figure(results, section, case.beside, scene) for section in ("time", "variance") for scene in (SPHERE, BOX)
    ]
    plugin, *words = case.name.split(maxsplit=1)
    name = f"`{plugin}` {words[0] if words else ''}".strip()
    return [f"{name} / `{case.builtin['type']}`", ours, theirs, *cells] if any([ours, *cells]) else []


def _range(results: Results, subject: str) -> str:
    """The efficiencies of a row."""
    figures = [f for f in results.of("efficiency") if f.subject == subject and f.name.endswith("°")]
    if not figures:
        return ""
    least, largest = (choose(figure.value for figure in figures) for choose in (min, max))
    return f"{least:.3f} to {largest:.3f}{MISSED if any(f.missed for f in figures) else ''}"


def _figure(results: Results, section: str, subject: str, name: str) -> str:
    return next((f.marked for f in results.of(section) if (f.subject, f.name) == (subject, name)), "")


def _sentences(results: Results) -> Iterator[str]:
    judged = {name: [f for f in results.of(name) if f.targets] for name in results.sections}
    lobes = [f for f in judged.get("efficiency", []) if any(t.reason == "each lobe" for t in f.targets)]
    if lobes:
        worst = {f.name: f for f in sorted(lobes, key=lambda f: f.value, reverse=True)}
        told = ", ".join(f"{worst[name].marked} at {name}" for name in dict.fromkeys(f.name for f in lobes))
        yield f"The least efficiency η = E[w]²/E[w²] of a lobe of any model is {told}."
    if first := judged.get("first"):
        told = ", ".join(f"{figure.subject} {figure.marked}" for figure in first)
        yield f"The time to the first picture, traced and compiled, over the built-in's: {told}."
    if kernels := judged.get("recompiles"):
        changed = sum(f.value for f in results.of("recompiles") if not f.targets)
        compiled = sum(f.value for f in kernels)
        yield f"Changing {changed} parameters, and loading a scene again, compiles {compiled} kernels."
    if cycles := judged.get("cycles"):
        told = ", ".join(f"{figure.name} {figure.marked}" for figure in cycles)
        yield f"Over {cycles[0].subject} of loading, rendering and discarding a scene: {told}."
    if scalar := judged.get("scalar"):
        told = ", ".join(f"{figure.subject} {figure.marked}" for figure in scalar)
        yield f"The time in `scalar_rgb`, over the built-in's: {told}."
    targets = sum(len(figure.targets) for figure in results.figures)
    yield f"Of {targets} targets {len(results.missed)} are missed{MISSED}; `mi-brdfs bench` names them."
