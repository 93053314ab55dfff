"""What fits cost grows linearly in directions and materials, and repeated fits hold no more memory."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent / "fit_cost.py"

pytestmark = pytest.mark.slow


def figures(*arguments, last):
    """What the script prints: the number that ``last`` precedes, of each line that has one."""
    done = subprocess.run([sys.executable, SCRIPT, *arguments], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return [float(line.split(last)[1].split()[0].rstrip("%")) for line in done.stdout.splitlines() if last in line]


@pytest.mark.skipif("MI_BRDFS_IDLE" not in os.environ, reason="measures time: set MI_BRDFS_IDLE=1 on an idle machine")
@pytest.mark.parametrize("what", ["steps", "fits"])
def test_cost_is_linear(what):
    """A line through the times of more than a decade has no large deviations, in relative terms."""
    by_directions, by_materials = figures(what, last="within ")
    assert by_directions < 35 and by_materials < 35


@pytest.mark.skipif(sys.platform != "linux", reason="the memory that a process holds is read from /proc")
def test_memory_is_flat():
    resident = figures("memory", last=": ")
    assert len(resident) == 20 and max(resident[10:]) - min(resident[10:]) < 16
