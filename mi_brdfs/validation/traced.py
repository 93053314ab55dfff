"""The parameters of a BSDF that Dr.Jit traces, one by one, as ``mi.traverse`` lists them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..probe.arrays import Array
from .report import Finding
from .run import Run


class Parameter(NamedTuple):
    """A parameter whose floats are traced."""

    params: mi.SceneParameters
    key: str

    @property
    def value(self) -> Any:
        """A copy of its value."""
        return type(self.params[self.key])(self.params[self.key])

    def set(self, value: Any) -> None:
        """Set it to a copy of a value."""
        self.params[self.key] = type(self.params[self.key])(value)
        self.params.update()

    def attach(self) -> Any:
        """Make it what derivatives are taken for, until it is set, and return that: a plugin may hold what it computes
        of it, as ``principled`` does."""
        value = dr.detach(self.value)
        dr.enable_grad(value)
        self.params[self.key] = value
        self.params.update()
        return value

    @contextmanager
    def restored(self) -> Iterator[Any]:
        """Yield its value, and set it to that in the end."""
        original = self.value
        try:
            yield original
        finally:
            self.set(original)


def gradient(attached: Any) -> Array:
    """Return the derivatives for the entries of an attached parameter, in float64."""
    return np.array(dr.grad(attached), np.float64).ravel()


def traced_floats(run: Run, check: str, differentiable: bool = False) -> tuple[list[Parameter], list[Finding]]:
    """Return the parameters that are floats, which a check needs to be ``differentiable`` or not, and what it says of
    the others."""
    params = mi.traverse(run.probe.bsdf)
    found, findings = [], []
    for key in params.keys():
        if not _is_traced(params, key):
            findings.append(Finding(check, key, "skip", "Not a number of floating point that Dr.Jit traces."))
        elif differentiable and int(params.flags(key)) & int(mi.ParamFlags.NonDifferentiable):
            findings.append(Finding(check, key, "skip", "Declared not differentiable."))
        else:
            found.append(Parameter(params, key))
    if not found and not findings:
        findings.append(Finding(check, "whole", "skip", "It has no parameters."))
    return found, findings


def _is_traced(params: mi.SceneParameters, key: str) -> bool:
    try:
        value = params[key]
    except TypeError:  # it may be None, which Mitsuba does not expect itself
        return False
    is_float = dr.is_arithmetic_v(value) and dr.is_float_v(value) and dr.is_jit_v(value)
    return is_float and not dr.is_matrix_v(value) and dr.width(value) > 0
