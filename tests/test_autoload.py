"""Mitsuba 3.10 imports the modules of the entry points ``mitsuba`` when a variant becomes active for the first time,
and reloads them after each change: what it does then, done here with the Mitsuba that is installed."""

import pytest
from test_llvm import BROKEN, RENDER, RESTART, TRY, late, needs_bad, needs_extra, python, too_late

from mi_brdfs.mitsuba import llvm

AUTOLOAD = """
import importlib, traceback, warnings
from importlib.metadata import entry_points
import mitsuba as mi

modules = None

def load_plugins():
    global modules
    first, modules = modules is None, modules or [entry.value for entry in entry_points(group="mitsuba")]
    for k, module in enumerate(modules):
        try:
            modules[k] = importlib.import_module(module) if first else importlib.reload(module)
        except Exception:
            del modules[k]
            warnings.warn(traceback.format_exc())

def set_variant(*names, change=mi.set_variant):
    before = mi.variant()
    change(*names)
    if mi.variant() != before:
        load_plugins()

mi.set_variant = set_variant
"""
SHOW = "print(type(mi.load_dict({'type': 'ward'})).__name__, mi.variant())"


def test_plugins_are_there_without_an_import():
    """In each variant, with what else was registered, and without a word; an ``import mi_brdfs`` changes nothing."""
    own = "import mi_brdfs\nclass Mine(mi_brdfs.Model):\n    'Mine.'\nmi_brdfs.register(Mine)"
    run = python(
        f"{AUTOLOAD}\nmi.set_variant('scalar_rgb')\n{SHOW}\nward = type(mi.load_dict({{'type': 'ward'}}))\n"
        f"mi.set_variant('scalar_spectral')\n{SHOW}\n{own}\nmi.set_variant('scalar_rgb')\n{SHOW}\n"
        "print('mine' in mi_brdfs.list_models(), mi_brdfs is modules[0], type(mi.load_dict({'type': 'ward'})) is ward)"
    )
    assert run.stdout.splitlines() == ["Ward scalar_rgb", "Ward scalar_spectral", "Ward scalar_rgb", "True True True"]
    assert run.stderr == ""


@pytest.mark.slow
@needs_extra
def test_llvm_works_where_dr_jit_has_found_a_safe_one():
    run = python(
        f"{AUTOLOAD}\nmi.set_variant('llvm_ad_rgb')\n{RENDER}\n{SHOW}\nmi.set_variant('scalar_rgb')\n{SHOW}",
        library=llvm.extra_library(),
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[1:] == ["Ward llvm_ad_rgb", "Ward scalar_rgb"] and run.stderr == ""


@pytest.mark.slow
@needs_extra
@too_late
def test_a_choice_of_llvm_that_comes_too_late(before):
    """Scalar variants work; a change to LLVM is refused with the way out."""
    run = late(before, f"{AUTOLOAD}\nmi.set_variant('scalar_rgb')\n{TRY}\n{SHOW}")
    assert run.returncode == 0, run.stderr
    told = run.stdout.splitlines()
    assert told[0].endswith(RESTART) and told[1:] == ["in scalar_rgb", "Ward scalar_rgb"]
    assert run.stderr == ""


@pytest.mark.slow
@needs_extra
@needs_bad
def test_an_llvm_variant_that_aborts_comes_first():
    """Mitsuba warns then that it could not load us, with the way out. A later import works."""
    run = late(
        BROKEN, f"{AUTOLOAD}\nmi.set_variant('llvm_ad_rgb')\nmi.set_variant('scalar_rgb')\nimport mi_brdfs\n{SHOW}"
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout == "Ward scalar_rgb\n"
    assert run.stderr.count(RESTART) == 1


@pytest.mark.slow
@needs_extra
def test_an_import_before_mitsuba_still_chooses_the_llvm():
    run = python(
        f"import mi_brdfs\n{AUTOLOAD}\nmi.set_variant('scalar_rgb'); mi.set_variant('llvm_ad_rgb')\n{RENDER}\n{SHOW}"
    )
    assert run.stdout.endswith("Ward llvm_ad_rgb\n") and run.stderr == "", run.stderr
