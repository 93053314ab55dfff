"""What fits cost grows linearly in directions and materials, and repeated fits hold no more memory."""

import os
import sys

import drjit as dr
import fit_cost
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("llvm_rgb")]


@pytest.mark.skipif("MI_BRDFS_IDLE" not in os.environ, reason="measures time: set MI_BRDFS_IDLE=1 on an idle machine")
@pytest.mark.parametrize("measure", [fit_cost.steps, fit_cost.fits])
def test_cost_is_linear(measure):
    """A line through the times of more than a decade has no large deviations, in relative terms."""
    threads = dr.thread_count()
    dr.set_thread_count(1)
    assert measure() < 0.35
    dr.set_thread_count(threads)


@pytest.mark.skipif(sys.platform != "linux", reason="the memory that a process holds is read from /proc")
def test_memory_is_flat():
    resident = [held for held, _ in fit_cost.memory(["lambert", "low"], repeats=12)]
    assert max(resident[6:]) - min(resident[6:]) < 4
