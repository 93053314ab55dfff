"""Which LLVM is used, in processes of their own: it is chosen once per process, and a bad one ends the process."""

import glob
import os
import subprocess
import sys

import pytest

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
    env = {name: value for name, value in os.environ.items() if name != llvm.VARIABLE}
    env |= {llvm.VARIABLE: library} if library else {}
    return subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=120)


@needs_extra
@pytest.mark.parametrize(
    "imports",
    [
        "import mi_brdfs, mitsuba as mi",
        "import mitsuba as mi, mi_brdfs",
        "import mitsuba as mi; mi.set_variant('scalar_rgb'); import mi_brdfs",
    ],
)
def test_a_safe_llvm_is_used_in_every_order_of_imports(imports):
    says = "print(mi_brdfs.mitsuba.llvm.version()[0], mi_brdfs.mitsuba.llvm.problem())"
    run = python(f"{imports}\nmi.set_variant('llvm_ad_rgb')\n{RENDER}\n{says}")
    assert run.returncode == 0, run.stderr[-500:]
    major, problem = run.stdout.split()[-2:]
    assert int(major) >= 17 and problem == "None"
    assert run.stderr == ""


@needs_bad
def test_the_users_choice_is_kept_and_warned_of_once():
    switch = "mi.set_variant('llvm_ad_rgb'); mi.set_variant('scalar_rgb')\n"
    run = python(f"import mi_brdfs, mitsuba as mi\n{switch * 2}print(mi_brdfs.mitsuba.llvm.loaded_file())", library=BAD)
    assert os.path.realpath(run.stdout.strip()) == os.path.realpath(BAD)
    assert run.stderr.count(f"unset {llvm.VARIABLE}") == 1


@needs_bad
def test_no_warning_in_scalar_variants():
    assert python("import mi_brdfs, mitsuba as mi; mi.set_variant('scalar_rgb')", library=BAD).stderr == ""


@needs_bad
def test_an_active_variant_is_left_alone_but_warned_of():
    if python("import drjit as dr; assert dr.detail.llvm_version()[0] in (15, 16)").returncode:
        pytest.skip("the system's own LLVM is not one that aborts")
    run = python(
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); from mi_brdfs.mitsuba import llvm\n"
        "print(llvm.version()[0])"
    )
    assert run.stdout.strip() in ("15", "16")
    assert "import mi_brdfs first" in run.stderr or "pip install karellen-llvm-core" in run.stderr


@needs_bad
def test_arrays_that_exist_already_survive_the_import():
    run = python("from drjit.llvm import Float; a = Float(1, 2, 3); import mi_brdfs; print(a + 1)")
    assert run.returncode == 0 and run.stdout.strip() == "[2, 3, 4]", run.stderr


@needs_bad
def test_advice_without_the_extra():
    run = python(f"{NO_EXTRA}\nimport mi_brdfs; print(mi_brdfs.mitsuba.llvm.problem())", library=BAD)
    assert f"unset {llvm.VARIABLE}" in run.stdout and "pip install karellen-llvm-core" in run.stdout


@pytest.mark.parametrize(
    "system, machine, advice",
    [
        ("linux", "x86_64", "pip install karellen-llvm-core"),
        ("linux", "aarch64", "package manager"),
        ("darwin", "arm64", "metal_ad"),
        ("win32", "AMD64", "releases"),
    ],
)
def test_advice_suits_the_platform(system, machine, advice):
    assert advice in llvm.install_advice(system, machine)
