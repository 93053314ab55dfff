"""Fitted constants are as good as the best that their scripts find."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "calibration"
QUICK = "smith_beckmann", "toon", "schlick"
SEARCHES = ("largest_albedo",)  # what test_energy checks, more thoroughly: it takes hours
TABLES = ("ablation",)  # which fits nothing
SCRIPTS = sorted({path.stem for path in FOLDER.glob("*.py")} - {"harness", *SEARCHES, *TABLES})


@pytest.mark.parametrize(
    "script", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCRIPTS]
)
def test_the_constants_are_as_good_as_the_best(script):
    command = [sys.executable, FOLDER / f"{script}.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
