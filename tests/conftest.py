import gc
import os
import signal
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: threads that wait for work take CPU time of others

import pytest
from catalogue import OTHER_VARIANTS

from mi_brdfs.mitsuba.registry import KIT, MODELS

import drjit as dr  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip
import mitsuba as mi  # isort: skip

ELSE = "scalar_rgb"
"""The variant of tests that ask for none."""

mi.set_variant(ELSE)

if "PYTEST_XDIST_WORKER" in os.environ and sys.platform == "linux":
    # Threads of Dr.Jit that wait for work are busy: let them not take the cores of those that compile.
    others = set(os.listdir("/proc/self/task"))
    dr.set_thread_count(dr.thread_count())  # starts them; with one alone, Mitsuba waits for ever for a file in EXR
    for thread in set(os.listdir("/proc/self/task")) - others:
        os.setpriority(os.PRIO_PROCESS, int(thread), 19)


def pytest_collection_finish():
    """Have collections of garbage look at what tests make, not at all that has been imported: that takes 50 ms."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def llvm_rgb():
    """The variant that most tests run in."""
    mi.set_variant("llvm_ad_rgb")


@pytest.fixture
def no_lanes_left():
    """Every BSDF that lives is part of the kernels of its variant, and arrays of many lanes can be in none."""
    yield
    gc.collect()


@pytest.fixture
def as_before():
    """Names of plugins and words of the kit go back to whom they belonged to; Mitsuba itself cannot forget one. And
    BSDFs go whose errors keep them alive: pictures call them, too."""
    tables = [MODELS, *(table for choice in KIT.values() for table in (choice.words, choice.terms))]
    former = [dict(table) for table in tables]
    yield
    for table, was in zip(tables, former, strict=True):
        table.clear()
        table.update(was)
    gc.collect()


@pytest.fixture(scope="module", params=["llvm_ad_rgb", *OTHER_VARIANTS])
def variant_name(request):
    """Of a module, so that its tests run variant by variant."""
    return request.param


@pytest.fixture
def variant(variant_name):
    """Each kind of variant in turn; the one that users have most by default."""
    mi.set_variant(variant_name)
    return variant_name


IN_VARIANTS = {"llvm_rgb", "variant_name"}


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item, nextitem):
    """Stay in a variant while the next test asks for one, too: changing to one of LLVM's takes as long as a test."""
    if IN_VARIANTS & set(item.fixturenames) and not IN_VARIANTS & set(getattr(nextitem, "fixturenames", ())):
        mi.set_variant(ELSE)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def ctrl_c():
    """Ctrl-C interrupts this process and those that it starts, even if a shell started the tests in the background and
    had them ignore it."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)
