"""A model's values and derivatives for many settings at once: a kernel with a lane for each of their pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba import llvm
from ..mitsuba.errors import one_line
from ..mitsuba.fastest import fastest
from ..probe.arrays import Array, context, floats, held, interaction, numbers, per_lane, vectors
from ..probe.directions import hemisphere
from ..variants import activated
from .observations import FitError
from .unknowns import Configuration

LANES = 1 << 18
"""The most lanes of a kernel: memory does not grow with the number of materials."""


@contextmanager
def rgb_variant() -> Iterator[None]:
    """Activate an rgb variant with derivatives, unless one is: the one of the device that there is."""
    active = mi.variant()
    if active is not None and active.endswith("_ad_rgb"):
        yield
        return
    found = fastest()
    if found is None:
        raise FitError(f"A fit needs a variant with derivatives: {llvm.problem() or 'none works on this machine'}.")
    with activated(found):
        yield


class Lanes:
    """A configuration's plugin, with a texture for each of its unknowns.

    Settings are arrays of shape (P, unknowns), and pairs lists of P pairs of arrays ``(wi, wo)`` of shape (N, 3), where
    the N may differ. Values are f cosθo, of one channel or three.
    """

    def __init__(self, configuration: Configuration, channels: int):
        self.configuration, self.channels = configuration, channels
        self.textures = {name: per_lane() for name in configuration.names}
        try:
            self.bsdf = mi.load_dict({"type": configuration.plugin, **configuration.given, **self.textures})
        except RuntimeError as error:
            _, refused, sentence = str(error).rpartition("ParameterError: ")
            raise FitError(sentence.strip() if refused else one_line(error)) from None

    def batches(self, pairs: Sequence[tuple[Array, Array]]) -> Iterator[range]:
        """Yield ranges of settings that fit into a kernel together."""
        first, lanes = 0, 0
        for k, (wi, _) in enumerate(pairs):
            if k > first and lanes + len(wi) > LANES:
                yield range(first, k)
                first, lanes = k, 0
            lanes += len(wi)
        if first < len(pairs):
            yield range(first, len(pairs))

    def evaluate(
        self, settings: Array, pairs: Sequence[tuple[Array, Array]], derivatives: bool = True
    ) -> tuple[Array, Array]:
        """Return the values of all lanes, shape (lanes, channels), and the derivatives by the unknowns, shape (lanes,
        channels, unknowns), or none of them; float32."""
        sweeps = self._sweeps if derivatives else []
        counts = [len(wi) for wi, _ in pairs]
        si, wo = interaction(np.concatenate([wi for wi, _ in pairs])), vectors(np.concatenate([wo for _, wo in pairs]))
        dr.make_opaque(si)
        inputs = self._inputs(np.repeat(np.asarray(settings, np.float32), counts, axis=0), bool(sweeps))
        with held(self.textures, inputs):
            value = self.bsdf.eval(context(), si, wo, True)
            tangents = [self._tangent(value, inputs, sweep) for sweep in sweeps]
            value = dr.detach(value)
            dr.eval(value, tangents)
        found = self._array(value)
        jacobian = np.zeros((*found.shape, len(self.configuration.unknowns) if sweeps else 0), np.float32)
        for sweep, tangent in zip(sweeps, tangents, strict=True):
            columns = self._array(tangent)
            for channel, k in enumerate(sweep):  # of a sweep of one unknown, all channels are its own
                jacobian[:, channel :: len(sweep), k] = columns[:, channel :: len(sweep)]
        return found, jacobian

    def _array(self, value: mi.Color3f) -> Array:
        return np.ascontiguousarray(numbers(value)[:, : self.channels])

    def _typed(self, name: str, numbers: list[Any]) -> mi.Float | mi.Color3f:
        """Return the numbers of a parameter as its texture has them: of a colour one, or one for each channel."""
        if not self.configuration.is_colour(name):
            return mi.Float(numbers[0])
        return mi.Color3f(numbers if len(numbers) == 3 else numbers * 3)

    def _inputs(self, settings: Array, differentiable: bool) -> dict[str, mi.Float | mi.Color3f]:
        """Return the values of the textures for a setting in each lane."""
        inputs = {}
        for name in self.textures:
            value = self._typed(name, [floats(settings[:, k]) for k in self.configuration.indices(name)])
            dr.make_opaque(value)
            if differentiable:
                dr.enable_grad(value)
            inputs[name] = value
        return inputs

    def _tangent(self, value: mi.Color3f, inputs: dict[str, mi.Float | mi.Color3f], sweep: list[int]) -> mi.Color3f:
        """Return the derivative of the value by some unknowns together."""
        for name, each in inputs.items():
            dr.set_grad(each, self._typed(name, [float(k in sweep) for k in self.configuration.indices(name)]))
        tangent = dr.forward_to(value, flags=dr.ADFlag.ClearVertices)
        for each in (value, *inputs.values()):
            dr.clear_grad(each)
        return tangent

    @cached_property
    def _sweeps(self) -> list[list[int]]:
        """The unknowns of each sweep of differentiation: the channels of a colour together, unless some channel of the
        value changes with another one of the colour."""
        unknowns = self.configuration.unknowns
        names = dict.fromkeys(unknown.name for unknown in unknowns)
        together = [self.configuration.indices(name) for name in names]
        if len(together) == len(unknowns):
            return together
        ends = np.array([np.clip(unknown.ends, -3, 8) for unknown in unknowns])
        points = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * np.random.default_rng(1).uniform(0.2, 0.8, (8, len(unknowns)))
        colours = [(k, channel) for sweep in together if len(sweep) > 1 for channel, k in enumerate(sweep)]
        moved = np.stack([points, *(points + 0.5 * (np.arange(len(unknowns)) == k) for k, _ in colours)])
        settings = np.stack([u.from_scale(moved[..., k]) for k, u in enumerate(unknowns)], axis=-1)
        pairs = [(hemisphere(64, 1, 0.2), hemisphere(64, 2, 0.2))] * (8 * len(moved))
        values, _ = self.evaluate(settings.reshape(len(pairs), -1), pairs, derivatives=False)
        first, *others = values.reshape(len(moved), 8 * 64, -1)
        for (_, channel), other in zip(colours, others, strict=True):
            if not np.array_equal(np.delete(first, channel, axis=1), np.delete(other, channel, axis=1), equal_nan=True):
                return [[k] for k in range(len(unknowns))]
        return together
