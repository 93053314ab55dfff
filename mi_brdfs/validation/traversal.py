"""The parameters of a BSDF as ``mi.traverse`` lists them: values set, restored, and differentiated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi

from .report import Finding
from .run import Run


def traced_floats(run: Run, check: str) -> tuple[mi.SceneParameters, list[str], list[Finding]]:
    """Return ``(params, keys, findings)``: the parameters that are floats, and what a check says of the others."""
    params = mi.traverse(run.probe.bsdf)
    keys, findings = [], []
    for key in params.keys():
        if not _is_traced(params, key):
            findings.append(Finding(check, key, "skip", "Not a number of floating point that Dr.Jit traces."))
        elif check in ("gradients", "active") and int(params.flags(key)) & int(mi.ParamFlags.NonDifferentiable):
            findings.append(Finding(check, key, "skip", "Declared not differentiable."))
        else:
            keys.append(key)
    return params, keys, findings


def _is_traced(params: mi.SceneParameters, key: str) -> bool:
    try:
        value = params[key]
    except TypeError:  # it may be None, which Mitsuba does not expect itself
        return False
    is_float = dr.is_arithmetic_v(value) and dr.is_float_v(value) and dr.is_jit_v(value)
    return is_float and not dr.is_matrix_v(value) and dr.width(value) > 0


def value_of(params: mi.SceneParameters, key: str) -> Any:
    """Return a copy of the value of a parameter."""
    return type(params[key])(params[key])


def set_value(params: mi.SceneParameters, key: str, value: Any) -> None:
    """Set a parameter to a copy of a value."""
    params[key] = type(params[key])(value)
    params.update()


def attach(params: mi.SceneParameters, key: str) -> None:
    """Make a parameter what derivatives are taken for."""
    value = type(params[key])(dr.detach(params[key]))
    dr.enable_grad(value)
    params[key] = value
    params.update()


@contextmanager
def restored(params: mi.SceneParameters, key: str) -> Iterator[Any]:
    """Yield the value of a parameter, and set the parameter to it in the end."""
    original = value_of(params, key)
    try:
        yield original
    finally:
        set_value(params, key, original)
