"""The variant that a command uses."""

from __future__ import annotations

from typing import Annotated

import mitsuba as mi
import typer

from ..mitsuba import llvm
from ..variants import is_measurable
from .terminal import Exit, err, fail

AnyVariant = Annotated[
    str | None,
    typer.Option(help="Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb, whichever works, else scalar_rgb."),
]
"""The option --variant of commands that render."""

TracingVariant = Annotated[
    str | None, typer.Option(help="Vectorized and unpolarized. Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb.")
]
"""The option --variant of commands that measure."""


def set_variant(wanted: str | None) -> str:
    """Activate the requested variant, or the fastest that works, and return its name."""
    if wanted:
        _refuse(wanted)
        try:
            mi.set_variant(wanted)
        except ImportError:
            fail(f"{wanted} does not work on this machine; `mi-brdfs doctor` says why")
        return wanted
    for name in ("cuda_ad_rgb", "metal_ad_rgb", "llvm_ad_rgb"):
        if name not in mi.variants():
            continue
        if name.startswith("llvm") and (text := llvm.problem()):
            err.print(f"mi-brdfs: using scalar_rgb, which is slow: {text}")
            continue
        try:
            mi.set_variant(name)
            return name
        except ImportError:
            continue
    mi.set_variant("scalar_rgb")
    return "scalar_rgb"


def set_tracing_variant(wanted: str | None) -> str:
    """Do the same among the variants that check, plot and bench can use."""
    chosen = set_variant(wanted)
    if not is_measurable(chosen):
        fail(f"this needs a vectorized and unpolarized variant, not {chosen}", Exit.USAGE if wanted else Exit.ERROR)
    return chosen


def _refuse(variant: str) -> None:
    if variant not in mi.variants():
        fail(f"there is no variant {variant}; this Mitsuba has {', '.join(mi.variants())}")
    if variant.startswith("llvm") and (text := llvm.problem()):
        fail(text)
