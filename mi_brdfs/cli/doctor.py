"""``mi-brdfs doctor``: a small render per backend, each in its own process, as a bad LLVM ends it."""

from __future__ import annotations

import platform
import signal
import subprocess
import sys
from importlib.metadata import version as installed_version

import typer
from rich.table import Table
from rich.text import Text

from ..mitsuba import llvm
from .app import command
from .terminal import Exit, out, print_table

BACKENDS = ("scalar", "llvm", "cuda", "metal")
TIMEOUT = 180  # seconds; the first CUDA render on a machine compiles for a while

MISSING = 3  # exit status of a probe whose backend is missing
WHY_MISSING = {"llvm": "no LLVM library found", "cuda": "no NVIDIA GPU, or no driver for it", "metal": "no Apple GPU"}

PROBE = f"""
import sys
import mi_brdfs, mitsuba as mi
from mi_brdfs.mitsuba import llvm
try:
    mi.set_variant(sys.argv[1])
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit({MISSING})
if sys.argv[1].startswith("llvm"):
    print("LLVM", llvm.dotted(llvm.version()), llvm.loaded_file() or "", flush=True)
scene = mi.load_dict({{
    "type": "scene", "integrator": {{"type": "path"}}, "light": {{"type": "constant"}},
    "sensor": {{"type": "perspective", "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
               "film": {{"type": "hdrfilm", "width": 16, "height": 16}}}},
    "ball": {{"type": "sphere", "material": {{"type": "roughplastic"}}}}}})
mean = sum(mi.render(scene, spp=4).array) / (16 * 16 * 3)
if not 0.1 < mean < 2:
    sys.exit(f"the test image is wrong (mean {{mean}})")
"""


@command("Develop", "doctor")
def doctor() -> None:
    """Show which variants work on this machine, which LLVM is used, and how to enable the others."""
    import mitsuba as mi

    table, states = Table("backend", "state", "", box=None, pad_edge=False), dict[str, str]()
    colours = {"works": "green", "missing": "yellow"}
    for backend in BACKENDS:
        if variants := [name for name in mi.variants() if name.startswith(backend)]:
            states[backend], detail = _try(backend, variants)
            table.add_row(backend, Text(states[backend], colours.get(states[backend], "red")), detail)
            table.add_row("", "", Text(" ".join(variants), "dim"))
    for name, version in versions().items():
        out.print(f"{name} {version}")
    print_table(table)
    is_fast = any(state == "works" for backend, state in states.items() if backend != "scalar")
    if states.get("llvm") == "aborts":
        out.print(f"Next: {llvm.cure()}")
    elif is_fast:
        out.print("Everything works. Next: mi-brdfs render SCENE.xml")
    else:
        out.print(f"Only scalar variants work, and they are slow. Next: {llvm.cure()}")
    if not is_fast:
        raise typer.Exit(Exit.ERROR)


def versions() -> dict[str, str]:
    """Return the versions of the software that matters here."""
    packages = {name: installed_version(name) for name in ("mi_brdfs", "mitsuba", "drjit")}
    return {**packages, "python": platform.python_version(), "system": platform.platform(terse=True)}


def _try(backend: str, variants: list[str]) -> tuple[str, str]:
    """Return whether a backend ``works``, is ``missing`` (no library or device), ``aborts`` (the process dies) or
    ``fails``, and the library that works, or the reason for a failure."""
    chosen = next((name for name in variants if name.endswith("_rgb")), variants[0])
    probe = [sys.executable, "-c", PROBE, chosen]
    try:
        run = subprocess.run(probe, capture_output=True, text=True, errors="replace", timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return "fails", f"no image within {TIMEOUT} seconds"
    if run.returncode == 0:
        return "works", _last_line(run.stdout)
    if run.returncode < 0:
        name = signal.Signals(-run.returncode).name
        return "aborts", f"the test render died of {name}; {_last_line(run.stdout)}".rstrip("; ")
    if run.returncode == MISSING:
        return "missing", WHY_MISSING.get(backend, _last_line(run.stderr))
    return "fails", _last_line(run.stderr)


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1]
