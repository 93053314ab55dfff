"""Repeated fits hold no more memory."""

import sys

import fit_cost
import pytest


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.skipif(sys.platform != "linux", reason="the memory that a process holds is read from /proc")
def test_memory_is_flat():
    resident = [held for held, _ in fit_cost.memory(["lambert", "low"], repeats=12)]
    assert max(resident[6:]) - min(resident[6:]) < 4
