import signal

import pytest

from mi_brdfs.mitsuba.registry import MODELS

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

mi.set_variant("scalar_rgb")  # variant_context needs one to return to


def pytest_addoption(parser):
    parser.addoption(
        "--derivative-lanes", type=int, default=1 << 16, help="inputs for which fuzzing takes the derivatives of a BSDF"
    )


@pytest.fixture
def derivative_lanes(request):
    return request.config.getoption("derivative_lanes")


@pytest.fixture
def llvm_rgb():
    """The variant that most tests run in."""
    with mi.variant_context("llvm_ad_rgb"):
        yield


@pytest.fixture
def as_before():
    """Names of plugins go back to whom they belonged to; Mitsuba itself cannot forget one."""
    models = dict(MODELS)
    yield
    MODELS.clear()
    MODELS.update(models)


OTHERS = ("llvm_ad_spectral", "llvm_ad_mono_polarized", "scalar_rgb", "scalar_spectral")


@pytest.fixture(params=["llvm_ad_rgb", *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS)])
def variant(request):
    """Each kind of variant in turn; the one that users have most by default."""
    with mi.variant_context(request.param):
        yield request.param


@pytest.fixture
def ctrl_c():
    """Ctrl-C interrupts this process and those that it starts, even if a shell started the tests in the background and
    had them ignore it."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous)
