"""The package as installed: versions, import time, style."""

import importlib.metadata
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

import mi_brdfs

ROOT = Path(__file__).parent.parent


def python(code: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)


def test_version():
    assert importlib.metadata.version("mi_brdfs") == mi_brdfs.__version__


@pytest.mark.parametrize(
    "version, outcome",
    [
        ("3.6.4", "ImportError: mi_brdfs needs Mitsuba 3.7.1 or newer, this is 3.6.4: pip install -U mitsuba"),
        ("3.7.0", "ImportError"),
        ("2.99.0", "ImportError"),
        ("3.7.1", ""),
        ("3.9.1", ""),
        ("3.10.0", "UserWarning: mi_brdfs was tested with Mitsuba 3.7.1 to 3.9, this is 3.10.0."),
        ("4.0.0.dev1", "UserWarning"),
    ],
)
def test_mitsuba_versions(version, outcome):
    """Compared as numbers: 3.10 is newer than 3.9."""
    done = python(f"import mitsuba; mitsuba.__version__ = '{version}'; import mi_brdfs")
    assert outcome in done.stderr if outcome else not done.stderr
    assert (done.returncode != 0) == ("ImportError" in outcome)


def test_import_is_fast():
    """At most 0.2 s over Mitsuba's own, of the processor's time, which other processes disturb least, and in the median
    of alternating pairs."""
    extra = []
    for _ in range(7):
        measured = [
            float(python(f"import time; t = time.process_time(); import {name}; print(time.process_time() - t)").stdout)
            for name in ("mitsuba", "mi_brdfs")
        ]
        extra.append(measured[1] - measured[0])
    assert statistics.median(extra) < 0.2


def test_style():
    done = subprocess.run([sys.executable, "-m", "ruff", "check", str(ROOT)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_types():
    done = subprocess.run([sys.executable, "-m", "mypy", "--no-incremental"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_are_shipped():
    assert (Path(mi_brdfs.__file__).parent / "py.typed").exists()
