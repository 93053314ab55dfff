"""Find what works on this machine: a small render per backend, each in its own process, as a bad LLVM ends it."""

from __future__ import annotations

import platform
import signal
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import version as installed_version

from .mitsuba import llvm

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


@dataclass(frozen=True)
class BackendStatus:
    """The outcome of one backend's test render."""

    backend: str
    variants: tuple[str, ...]
    state: str
    """``works``, ``missing`` (no library or device), ``aborts`` (the process dies) or ``fails``."""
    detail: str = ""
    """The reason for a failure, or the library that works."""


def examine() -> list[BackendStatus]:
    """Try every backend of this build of Mitsuba."""
    import mitsuba as mi

    findings = []
    for backend in BACKENDS:
        variants = tuple(name for name in mi.variants() if name.startswith(backend))
        if variants:
            findings.append(_try(backend, variants))
    return findings


def next_step(findings: list[BackendStatus]) -> str:
    """Return a sentence that says what to do next."""
    if any(it.backend == "llvm" and it.state == "aborts" for it in findings):
        return f"Next: {llvm.cure()}"
    if any_fast(findings):
        return "Everything works. Next: mi-brdfs render SCENE.xml"
    return f"Only scalar variants work, and they are slow. Next: {llvm.cure()}"


def any_fast(findings: list[BackendStatus]) -> bool:
    """Return whether at least one vectorized backend works."""
    return any(it.state == "works" and it.backend != "scalar" for it in findings)


def versions() -> dict[str, str]:
    """Return the versions of the software that matters here."""
    packages = {name: installed_version(name) for name in ("mi_brdfs", "mitsuba", "drjit")}
    return {**packages, "python": platform.python_version(), "system": platform.platform(terse=True)}


def _try(backend: str, variants: tuple[str, ...]) -> BackendStatus:
    chosen = next((name for name in variants if name.endswith("_rgb")), variants[0])
    command = [sys.executable, "-c", PROBE, chosen]
    try:
        run = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return BackendStatus(backend, variants, "fails", f"no image within {TIMEOUT} seconds")
    if run.returncode == 0:
        return BackendStatus(backend, variants, "works", _last_line(run.stdout))
    if run.returncode < 0:
        name = signal.Signals(-run.returncode).name
        detail = f"the test render died of {name}; {_last_line(run.stdout)}".rstrip("; ")
        return BackendStatus(backend, variants, "aborts", detail)
    if run.returncode == MISSING:
        return BackendStatus(backend, variants, "missing", WHY_MISSING.get(backend, _last_line(run.stderr)))
    return BackendStatus(backend, variants, "fails", _last_line(run.stderr))


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1]
