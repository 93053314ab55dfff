"""Which LLVM library the ``llvm_*`` variants compile with, and whether it is safe on this machine.

Dr.Jit looks for LLVM once, in a thread started by ``import drjit`` (so by ``import mitsuba``), and takes what
``DRJIT_LIBLLVM_PATH`` names or else the system's. Mitsuba 3.9 refuses LLVM before 15; on machines with AVX-512,
15 and 16 abort the whole process in an ordinary render (``Cannot select: fminimum``). Mitsuba 3.7 and 3.8 do neither.
"""

from __future__ import annotations

import os
import platform
import sys
import warnings
from functools import cache

PACKAGE = "karellen-llvm-core"  # what the extra `mi_brdfs[llvm]` installs
VARIABLE = "DRJIT_LIBLLVM_PATH"
ABORTING_MAJORS = (15, 16)


def point_to_extra() -> None:
    """Make Dr.Jit use the library of the ``llvm`` extra, if it has not looked for LLVM yet.

    Call it before ``import mitsuba``. A ``DRJIT_LIBLLVM_PATH`` set by the user, and a missing extra, leave everything
    as it is. Where Dr.Jit was imported first and found no LLVM or one that aborts, it stays with that; then ``llvm_*``
    variants are refused from here on (:class:`TooLate`).
    """
    if os.environ.get(VARIABLE):
        return
    if "drjit" not in sys.modules:
        if library := extra_library():
            os.environ[VARIABLE] = library
    elif (version() is None or problem()) and extra_library() and TooLate not in sys.meta_path:
        sys.meta_path.insert(0, TooLate)


class TooLate:
    """An import hook that refuses the modules of ``llvm_*`` variants, which ``mi.set_variant`` imports, with a sentence
    that says how to get them. Mitsuba then stays in the variant that it is in, or takes the next one of several."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        if name.startswith("mitsuba.llvm"):
            raise ImportError(problem() or f"Dr.Jit found no LLVM: {cure()}.")


def check(variant: str | None) -> None:
    """Refuse a variant in which rendering would abort the process, by an ImportError if a restart cures that, as where
    Dr.Jit was imported before it could take the library of the ``llvm`` extra, and else warn once."""
    if variant and variant.startswith("llvm") and (text := problem()):
        if TooLate in sys.meta_path:
            raise ImportError(text)
        _warn_once(text)


def version() -> tuple[int, int, int] | None:
    """The version of the LLVM in use, or None where Dr.Jit found none."""
    import drjit as dr

    found = dr.detail.llvm_version()
    return tuple(found) if found[0] > 0 else None


def extra_library() -> str | None:
    """Path of the library that the ``llvm`` extra brought, or None where it is not installed."""
    from importlib.metadata import PackageNotFoundError, files  # 25 ms: only when needed

    try:
        installed = files(PACKAGE) or []
    except PackageNotFoundError:
        return None
    return next((os.path.realpath(str(file.locate())) for file in installed if file.name == "libLLVM.so"), None)


def loaded_file() -> str | None:
    """Path of the LLVM library in this process, as far as the system tells (Linux)."""
    try:
        with open("/proc/self/maps", encoding="utf-8") as lines:
            return next((line.split()[-1] for line in lines if "libLLVM" in line), None)
    except OSError:
        return None


def problem() -> str | None:
    """One sentence with the cure if the LLVM in use aborts the process on this machine, else None."""
    import drjit as dr

    found, since_3_9 = version(), tuple(map(int, dr.__version__.split(".")[:2])) > (1, 3)
    if found is None or found[0] not in ABORTING_MAJORS or not since_3_9 or not _has_avx512():
        return None
    return f"LLVM {dotted(found)} aborts the process when it renders on this machine (AVX-512): {cure()}."


def cure() -> str:
    """What to do where the LLVM in use is missing or unsafe."""
    chosen, library = os.environ.get(VARIABLE), extra_library()
    if chosen and os.path.realpath(chosen) != library:
        return f"unset {VARIABLE} (it names {chosen})" + ("" if library else f", then {install_advice()}")
    if library:
        return "restart Python and import mi_brdfs first, before mitsuba"
    return install_advice()


def install_advice(system: str = sys.platform, machine: str = platform.machine()) -> str:
    """What to do on this platform to get an LLVM that works."""
    if system == "darwin":
        return "brew install llvm (or use the metal_ad_* variants, which need none)"
    if system == "win32":
        return "install LLVM from https://github.com/llvm/llvm-project/releases"
    if system == "linux" and machine == "x86_64":
        return f"pip install {PACKAGE}"
    return "install LLVM 17 or later with the system's package manager"


def dotted(found: tuple[int, int, int]) -> str:
    """``(23, 1, 4)`` as ``23.1.4``."""
    return ".".join(map(str, found))


@cache
def _has_avx512() -> bool:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        return False  # not Linux: no affected machine known
    return "avx512f" in flags.split()


@cache
def _warn_once(text: str) -> None:
    warnings.warn(text, stacklevel=4)
