"""Predicates of Mitsuba's variants."""

from __future__ import annotations

import mitsuba as mi


def is_scalar() -> bool:
    """Return whether the active variant computes one sample at a time, without Dr.Jit's arrays."""
    return (mi.variant() or "").startswith("scalar")


def is_measurable(variant: str | None) -> bool:
    """Return whether a BSDF can be measured in a variant: a vectorized, unpolarized one."""
    return variant is not None and not variant.startswith("scalar") and "polarized" not in variant
