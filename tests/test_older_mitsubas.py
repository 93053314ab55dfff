"""Mitsubas before the one that is installed."""

import os
import subprocess
import sys
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
    """The environment variables with which this Python finds an older Mitsuba first."""
    folder = tmp_path_factory.mktemp("mitsuba")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--target", folder, f"mitsuba=={request.param}"]
    installed = subprocess.run(command, capture_output=True, text=True)
    if installed.returncode:
        pytest.skip(f"Mitsuba {request.param} cannot be installed: {installed.stderr.strip().splitlines()[-1]}")
    found = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, "-c", "import mitsuba; print(mitsuba.__version__)"]
    version = subprocess.run(command, capture_output=True, text=True, env=found)
    assert version.stdout.strip() == request.param, version.stderr
    return found


@pytest.mark.slow
@pytest.mark.skipif(llvm.extra_library() is None, reason="the llvm extra is not installed")
def test_models_are_the_same(older):
    what = [f"{TESTS}/{it}" for it in WHAT]
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *what]
    run = subprocess.run(command, cwd=TESTS.parent, capture_output=True, text=True, env=older)
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-1000:]
