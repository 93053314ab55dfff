"""Every classical BRDF as a Mitsuba 3 plugin.

``import mi_brdfs``, before or after ``mi.set_variant``, makes its plugins known by name in every variant, in XML and
dict scenes. :func:`list_models` names them, :func:`info` returns a manual page, :func:`preview_scene` a scene that
shows a material. :func:`presets` names published materials, :func:`preset` returns one. :func:`ranges` and
:func:`project` keep optimised parameters valid. ``denoise`` and ``display_image`` make a picture of what was rendered;
``explore`` opens a page with sliders, lobes and pictures; ``load_legacy`` loads a scene of Mitsuba 0.2 to 0.6.
"""

from .starting import prepare_command

prepare_command()  # before what takes time

import importlib  # noqa: E402
import re  # noqa: E402
import warnings  # noqa: E402
from typing import Any  # noqa: E402

from .mitsuba import llvm  # noqa: E402

llvm.point_to_extra()  # before Mitsuba is imported, which loads LLVM

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

if dr.thread_count() < 2:  # on one processor, where Mitsuba would wait for ever for its first bitmap
    dr.set_thread_count(2)

__version__ = "0.1.0"

_OLDEST, _TESTED = (3, 7, 1), (3, 9)
_version = tuple(int(number) for number in re.findall(r"\d+", mi.__version__)[:3])
if _version < _OLDEST:
    raise ImportError(f"mi_brdfs needs Mitsuba 3.7.1 or newer, this is {mi.__version__}: pip install -U mitsuba")
if _version[:2] > _TESTED:
    warnings.warn(f"mi_brdfs was tested with Mitsuba 3.7.1 to 3.9, this is {mi.__version__}.", stacklevel=2)
llvm.check(mi.variant())

from . import lobes, microfacet, parameters  # noqa: E402
from .mitsuba.guests import register_installed  # noqa: E402
from .mitsuba.registry import info, install, list_models, presets, register  # noqa: E402
from .model import Energy, EnergyWarning, Model  # noqa: E402
from .parameters.published import preset  # noqa: E402
from .ranges import project, ranges  # noqa: E402

install()

_LAZY = ("bench", "cluster", "fit", "gallery", "legacy", "plot", "sweep", "testing", "validation")
"""Modules that are imported when they are used: some need extras, and all take time."""
_ELSEWHERE = {
    "denoise": "rendering.output", "display_image": "rendering.output", "explore": "explorer", "load_legacy": "loading",
    "preview_scene": "preview",
}  # fmt: skip
"""Functions of such modules."""


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return importlib.import_module(f"{__name__}.{name}")
    if name in _ELSEWHERE:
        return getattr(importlib.import_module(f"{__name__}.{_ELSEWHERE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY, *_ELSEWHERE})


__all__ = [
    "Energy",
    "EnergyWarning",
    "Model",
    "__version__",
    "denoise",
    "display_image",
    "explore",
    "info",
    "list_models",
    "load_legacy",
    "lobes",
    "microfacet",
    "parameters",
    "preset",
    "presets",
    "preview_scene",
    "project",
    "ranges",
    "register",
]

register_installed()
