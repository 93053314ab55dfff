"""What a plugin costs over time: no kernels compiled on updates, no time or memory lost on loading."""

import sys

import pytest
from benchmarks import resources
from catalogue import SMOOTH, mostly_slow

pytestmark = pytest.mark.usefixtures("llvm_rgb")


@pytest.mark.parametrize("name", mostly_slow(SMOOTH))
def test_neither_updates_nor_loading_again_compile_a_kernel(name):
    parameters, changed, loaded = resources.fresh_kernels(SMOOTH[name])
    assert parameters and (changed, loaded) == (0, 0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the resident memory from /proc")
def test_loading_300_times_loses_neither_time_nor_memory():
    """The last rounds over all models take as long as the first. A machine that is busier at the end slows them, too:
    then the next process tells. Memory grows by less than 5 MB."""
    for _ in range(3):
        slower, growth = resources.cycles()
        assert not growth.missed
        if slower.value < 1.15:
            break
    assert slower.value < 1.15
