"""The variant to use where none is asked for."""

from __future__ import annotations

from contextlib import suppress

import mitsuba as mi

from ..starting import signals_held
from ..variants import activated
from . import llvm


def fastest() -> str | None:
    """Return the name of the fastest rgb variant with derivatives that works on this machine, or None."""
    for name in ("cuda_ad_rgb", "metal_ad_rgb", "llvm_ad_rgb"):
        if name in mi.variants() and not (name.startswith("llvm") and llvm.problem()):
            # Ctrl-C would make an ImportError of this import, and another variant would be taken.
            with suppress(ImportError), signals_held(), activated(name):
                return name
    return None
