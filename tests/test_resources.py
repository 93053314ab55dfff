"""What a plugin costs over time: no kernels compiled on updates, no time or memory lost on loading."""

import sys

import pytest
from benchmarks import resources
from catalogue import SMOOTH, first_of_each, mostly_slow

pytestmark = pytest.mark.usefixtures("llvm_rgb")


OF_THE_KIT = [name for name in SMOOTH if name.startswith(("microfacet", "walter", "nishino"))]


@pytest.mark.parametrize("name", mostly_slow(dict.fromkeys([*first_of_each(SMOOTH).values(), *OF_THE_KIT])))
def test_neither_updates_nor_loading_again_compile_a_kernel(name):
    """One configuration of each plugin, and all of those whose terms have tables or parameters of their own: with other
    words, such as those of a normalization, the same parameters are given the same way."""
    parameters, changed, loaded = resources.fresh_kernels(SMOOTH[name])
    assert parameters and (changed, loaded) == (0, 0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")
def test_loading_300_times_loses_neither_time_nor_memory():
    """The last rounds over all models take as long as the first. A machine that is busier at the end slows them, too:
    then the next process tells. Memory grows by less than 5 MB."""
    for _ in range(3):
        slower, growth = resources.cycles()
        assert not growth.missed
        if slower.value < 1.15:
            break
    assert slower.value < 1.15
