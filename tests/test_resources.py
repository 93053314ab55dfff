"""What a plugin costs over time: no kernels compiled on updates, no time or memory lost on loading."""

import sys

import drjit as dr
import mitsuba as mi
import pytest
from benchmarks import resources
from catalogue import SMOOTH, first_of_each, mostly_slow

from mi_brdfs.probe.arrays import launched_kernels
from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.probe.directions import hemisphere
from mi_brdfs.probe.variates import random

pytestmark = pytest.mark.usefixtures("llvm_rgb")


OF_THE_KIT = [name for name in SMOOTH if name.startswith(("microfacet", "walter", "nishino"))]


@pytest.mark.parametrize("name", mostly_slow(dict.fromkeys([*first_of_each(SMOOTH).values(), *OF_THE_KIT])))
def test_neither_updates_nor_loading_again_compile_a_kernel(name):
    """One configuration of each plugin, and all of those whose terms have tables or parameters of their own: with other
    words, such as those of a normalization, the same parameters are given the same way."""
    parameters, changed, loaded = resources.fresh_kernels(SMOOTH[name])
    assert parameters and (changed, loaded) == (0, 0)


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", pytest.param("llvm_ad_spectral", marks=pytest.mark.slow)])
def test_any_number_of_directions_has_the_same_kernels(variant):
    """A mean over wavelengths is none over lanes, too."""
    with mi.variant_context(variant), dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        probe = BSDFProbe(mi.load_dict({"type": "phong", "diffuse_reflectance": 0.3, "specular_reflectance": 0.2}))

        def launched(size):
            return launched_kernels(lambda: probe.sample(probe.whole, hemisphere(size, 1), random(size, 2)))

        assert launched(100) == launched(1000)


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
