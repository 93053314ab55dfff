"""Mitsuba's variants: predicates, and one for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mitsuba as mi


def is_scalar() -> bool:
    """Return whether the active variant computes one sample at a time, without Dr.Jit's arrays."""
    return (mi.variant() or "").startswith("scalar")


def is_measurable(variant: str | None) -> bool:
    """Return whether a BSDF can be measured in a variant: a vectorized, unpolarized one."""
    return variant is not None and not variant.startswith("scalar") and "polarized" not in variant


@contextmanager
def activated(variant: str) -> Iterator[None]:
    """Activate a variant, and then the former one if there was any, which Mitsuba's ``variant_context`` demands."""
    former = mi.variant()
    mi.set_variant(variant)
    try:
        yield
    finally:
        if former is not None:
            mi.set_variant(former)
