"""Which LLVM is used, in processes of their own: it is chosen once per process, and a bad one ends the process."""

import glob
import os
import subprocess
import sys

import pytest
from support import environment

from mi_brdfs.mitsuba import llvm

BAD = next(iter(glob.glob("/usr/lib/*/libLLVM-1[56].so*")), None)

needs_extra = pytest.mark.skipif(llvm.extra_library() is None, reason="the llvm extra is not installed")
needs_bad = pytest.mark.skipif(BAD is None or not llvm._has_avx512(), reason="no LLVM here that aborts")

RENDER = """
scene = mi.cornell_box()
scene["sensor"]["film"].update(width=16, height=16)
print("mean", sum(mi.render(mi.load_dict(scene), spp=1).array))
"""
NO_EXTRA = """
import importlib.metadata as metadata
def files(name):
    raise metadata.PackageNotFoundError(name)
metadata.files = files
"""


def python(code: str, library: str | None = None) -> subprocess.CompletedProcess:
    env = environment(library)
    return subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=120)


ABSENT = """
import os
os.environ["DRJIT_LIBLLVM_PATH"] = "/nowhere/libLLVM.so"
import drjit
drjit.detail.llvm_version()  # it looks now
del os.environ["DRJIT_LIBLLVM_PATH"]
"""
"""Dr.Jit was imported before us, on a machine without LLVM."""
BROKEN = """
import drjit
if drjit.detail.llvm_version()[0] not in (15, 16):
    raise SystemExit("skip: the system's own LLVM is not one that aborts")
"""
"""The same, on one with an LLVM that aborts."""
too_late = pytest.mark.parametrize("before", [ABSENT, pytest.param(BROKEN, marks=needs_bad)], ids=["absent", "broken"])
RESTART = "restart Python and import mi_brdfs first, before mitsuba."
SAY = "print('in', mi.variant())"
TRY = f"""
try:
    mi.set_variant("llvm_ad_rgb")
except ImportError as error:
    print(error)
{SAY}
"""


def late(before: str, code: str) -> subprocess.CompletedProcess:
    """Run ``code`` after Dr.Jit has found what ``before`` says. Standard error is what comes after that."""
    run = python(f"{before}\nimport sys; print('---', file=sys.stderr, flush=True)\nimport mitsuba as mi\n{code}")
    before_that, _, run.stderr = run.stderr.partition("---\n")
    if before_that.startswith("skip: "):
        pytest.skip(before_that[6:].strip())
    return run


@needs_extra
def test_the_extra_is_used():
    says = "print(mi_brdfs.mitsuba.llvm.version()[0], mi_brdfs.mitsuba.llvm.problem())"
    run = python(f"import mi_brdfs, mitsuba as mi\nmi.set_variant('llvm_ad_rgb')\n{RENDER}\n{says}")
    assert run.returncode == 0, run.stderr[-500:]
    major, problem = run.stdout.split()[-2:]
    assert int(major) >= 17 and problem == "None"
    assert run.stderr == ""


@pytest.mark.slow
@needs_extra
@too_late
def test_scalar_variants_work_after_a_late_import(before):
    """Without a word, whichever comes first, the import or the variant."""
    imports = ["import mi_brdfs", "mi.set_variant('scalar_rgb')"][:: 1 if before == ABSENT else -1]
    run = late(before, f"{'; '.join(imports)}\n{RENDER}\nprint(mi.load_dict({{'type': 'ward'}}))")
    assert run.returncode == 0 and "Ward[" in run.stdout
    assert run.stderr == ""


@pytest.mark.slow
@needs_extra
@too_late
def test_llvm_variants_are_refused_after_a_late_import(before):
    """And Mitsuba stays where it is, or takes the next best."""
    run = late(
        before,
        f"import mi_brdfs\n{TRY}\nmi.set_variant('llvm_ad_rgb', 'scalar_rgb'); {SAY}\n"
        f"mi.set_variant('scalar_spectral')\n{TRY}\nprint(mi.load_dict({{'type': 'ward'}}))",
    )
    assert run.returncode == 0, run.stderr
    told = run.stdout.splitlines()
    assert told[0].endswith(RESTART) and told[3] == told[0]
    assert [told[k] for k in (1, 2, 4)] == ["in None", "in scalar_rgb", "in scalar_spectral"]
    assert told[5] == "Ward[" and run.stderr == ""


@pytest.mark.slow
@needs_extra
@needs_bad
def test_an_active_llvm_variant_refuses_the_import():
    """Nothing is left behind: in another variant the import works, and Mitsuba returns to it from LLVM."""
    run = late(
        BROKEN,
        "mi.set_variant('llvm_ad_rgb')\ntry:\n    import mi_brdfs\nexcept ImportError as error:\n    print(error)\n"
        f"{SAY}\nmi.set_variant('scalar_rgb')\nimport mi_brdfs, mi_brdfs.validation\n{TRY}\n"
        "with mi.variant_context('scalar_spectral'):\n    print(mi.load_dict({'type': 'ward'}))\n",
    )
    assert run.returncode == 0, run.stderr
    told = run.stdout.splitlines()
    assert told[0].endswith(RESTART) and told[1] == "in llvm_ad_rgb"
    assert told[2] == told[0] and told[3] == "in scalar_rgb"
    assert "Ward[" in run.stdout and run.stderr == ""


@pytest.mark.slow
@needs_bad
def test_the_users_choice_is_kept_and_warned_of_once():
    """Not in scalar variants."""
    switch = "mi.set_variant('llvm_ad_rgb'); mi.set_variant('scalar_rgb')\n"
    scalar = "import mi_brdfs, mitsuba as mi, sys; mi.set_variant('scalar_rgb'); print('---', file=sys.stderr)\n"
    run = python(f"{scalar}{switch * 2}print(mi_brdfs.mitsuba.llvm.loaded_file())", library=BAD)
    assert run.stderr.startswith("---\n")
    assert os.path.realpath(run.stdout.strip()) == os.path.realpath(BAD)
    assert run.stderr.count(f"unset {llvm.VARIABLE}") == 1


@pytest.mark.slow
@needs_bad
def test_without_the_extra_it_is_warned_of():
    """As there is nothing better to be had."""
    run = late(
        BROKEN, f"{NO_EXTRA}\nmi.set_variant('llvm_ad_rgb'); import mi_brdfs; print(mi.load_dict({{'type': 'ward'}}))"
    )
    assert run.returncode == 0 and "Ward[" in run.stdout
    assert run.stderr.count("UserWarning") == run.stderr.count("pip install karellen-llvm-core") == 1
    chosen = python(f"{NO_EXTRA}\nimport mi_brdfs; print(mi_brdfs.mitsuba.llvm.problem())", library=BAD)
    assert f"unset {llvm.VARIABLE}" in chosen.stdout and "pip install karellen-llvm-core" in chosen.stdout
