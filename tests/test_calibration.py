"""Fitted constants are as good as the best that their scripts find."""

import runpy
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "calibration"
QUICK = "toon", "schlick"
NO_FITS = "harness", "ablation"
SCRIPTS = sorted({path.stem for path in FOLDER.glob("*.py")}.difference(NO_FITS))


@pytest.mark.parametrize(
    "script", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCRIPTS]
)
def test_the_constants_are_as_good_as_the_best(script, llvm_rgb, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", [script, "--check"])
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(FOLDER / f"{script}.py"), run_name="__main__")
    assert not left.value.code
