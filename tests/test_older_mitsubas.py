"""Mitsubas before the one that is installed, each in an environment of its own."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from catalogue import FIRST_ROWS

from mi_brdfs.mitsuba import llvm

TESTS = Path(__file__).parent
WHAT = (
    *(f"test_values.py::test_matches_the_reference[{row.name}]" for row in FIRST_ROWS.values()),
    "test_contracts.py",
    "test_parameters.py",
    "test_registry.py",
    "test_malformed.py::test_unknown_names",
    "test_malformed.py::test_mitsuba_judges_unknown_names",
)


@pytest.fixture(scope="module", params=["3.7.1", "3.8.0"])
def older(request, tmp_path_factory):
    """A Python that has an older Mitsuba, and else what this one has."""
    folder = tmp_path_factory.mktemp("mitsuba")
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    command = [python, "-m", "pip", "install", "--quiet", f"mitsuba=={request.param}"]
    installed = subprocess.run(command, capture_output=True, text=True)
    if installed.returncode:
        pytest.skip(f"Mitsuba {request.param} cannot be installed: {installed.stderr.strip().splitlines()[-1]}")
    where = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    packages = Path(subprocess.run(where, capture_output=True, text=True, check=True).stdout.strip())
    # Come after the environment's own, so that its Mitsuba and Dr.Jit are found first.
    (packages / "others.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n")
    version = subprocess.run(
        [python, "-c", "import mitsuba; print(mitsuba.__version__)"], capture_output=True, text=True
    )
    assert version.stdout.strip() == request.param, version.stderr
    return python


@pytest.mark.slow
@pytest.mark.skipif(llvm.extra_library() is None, reason="the llvm extra is not installed")
def test_models_are_the_same(older):
    command = [older, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *(f"{TESTS}/{what}" for what in WHAT)]
    run = subprocess.run(command, cwd=TESTS.parent, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]
