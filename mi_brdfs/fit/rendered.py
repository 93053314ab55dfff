"""Pictures of a scene as a function of unknowns: residuals, and their derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import one_line
from ..probe.arrays import Array
from .observations import FitError
from .unknowns import LARGEST, Unknown

REACH = 2
"""The pixels on each side over whose mean a difference is relative."""
FLOOR = 0.1
"""What is added to it, as a part of the mean of the picture: dark pixels are noisy."""

BLOCK = 4
"""The side of a square of pixels that may have noise in common; if they have not, each counts by itself."""


@dataclass(frozen=True)
class Slot:
    """A traversed parameter that is sought. On the scale of its unknown it is a base plus a shift of each channel: the
    base of a number or a colour is 0, and the texels of a texture have one each."""

    key: str
    unknown: Unknown
    kind: type
    base: Array
    """Shape (channels,) or (height, width, channels)."""

    @property
    def channels(self) -> int:
        return self.base.shape[-1]

    @property
    def is_texture(self) -> bool:
        return self.base.ndim > 1

    def on_scale(self, shift: Array) -> Array:
        return np.clip(self.base + shift, *self.unknown.ends)

    def values(self, shift: Array) -> Array:
        return self.unknown.from_scale(self.on_scale(shift))

    def slopes(self, shift: Array) -> Array:
        """Return the derivatives of the values by their shift."""
        return self.unknown.slope(self.values(shift))

    def typed(self, values: Array) -> Any:
        """Return values as Mitsuba holds them; they are no literals, with which kernels would be compiled anew."""
        values = np.ascontiguousarray(values, np.float32)
        if self.is_texture or self.kind is mi.Float:
            return self.kind(values)
        return self.kind([mi.Float(values[k : k + 1]) for k in range(self.channels)])


class View:
    """A picture, and the sensor that took it."""

    def __init__(self, sensor: mi.Sensor, picture: Array):
        self.sensor = sensor
        usable = np.isfinite(picture).all(axis=-1, keepdims=True)
        self.picture = np.where(usable, picture, 0).astype(np.float64)
        grey = self.picture.mean(axis=-1, keepdims=True)
        share = np.maximum(_blurred(usable.astype(float)), 1e-9)
        level = np.abs(_blurred(grey)) / share + FLOOR * np.abs(grey.sum()) / usable.sum()
        self.root = usable / level

    def cut(self, image: mi.TensorXf) -> Array:
        """Return the channels of a rendering that the picture has."""
        return np.nan_to_num(np.array(image, np.float64)[..., : self.picture.shape[-1]])


def _blurred(image: Array) -> Array:
    """Return the means over squares of pixels, which the edges cut off."""
    size = 2 * REACH + 1
    padded = np.pad(image, [(REACH, REACH), (REACH, REACH), (0, 0)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size), axis=(0, 1))
    return windows.mean(axis=(-2, -1))


class Rendered:
    """The differences of a scene and its pictures by the shifts of slots, as flat arrays in which each pixel's
    difference is relative to the picture around it; their squares add to the mean over the usable pixels."""

    def __init__(
        self, scene: mi.Scene, integrator: Any, views: Sequence[View], slots: Sequence[Slot], spp: int, seed: int
    ):
        self.scene, self.params, self.integrator = scene, mi.traverse(scene), integrator
        self.views, self.slots, self.spp = views, list(slots), spp
        self._seed, self._drawn = seed, 0
        usable = sum(float(np.count_nonzero(view.root)) * view.picture.shape[-1] for view in views)
        self._roots = [view.root / np.sqrt(usable) for view in views]
        self._sweeps: list[list[int]] | None = None

    @property
    def places(self) -> list[slice]:
        """Where the shifts of each slot are among all."""
        ends = np.cumsum([slot.channels for slot in self.slots])
        return [slice(int(end) - slot.channels, int(end)) for slot, end in zip(self.slots, ends, strict=True)]

    @property
    def box(self) -> tuple[Array, Array]:
        """The ends of the shifts; texels are limited by themselves."""
        ends = np.array([(-LARGEST, LARGEST) if slot.is_texture else slot.unknown.ends for slot in self.slots
                         for _ in range(slot.channels)])  # fmt: skip
        return ends[:, 0], ends[:, 1]

    def groups(self, side: int) -> Array:
        """Return the number of the square of pixels, of a side, in which each residual is."""
        found, first = [], 0
        for view in self.views:
            height, width, channels = view.picture.shape
            row, column = np.indices((height, width)) // side
            number = row * (column.max() + 1) + column + first
            found.append(np.repeat(number.ravel(), channels))
            first = number.max() + 1
        return np.concatenate(found)

    def fresh(self) -> int:
        """Return a seed that no rendering had yet."""
        self._drawn += len(self.views)
        return (self._seed * 0x9E3779B1 + self._drawn) % (1 << 32)

    def put(self, point: Array) -> None:
        """Give the scene the values at a point."""
        for slot, place in zip(self.slots, self.places, strict=True):
            self.params[slot.key] = slot.typed(slot.values(point[place]))
        self.params.update()

    def residuals(self, point: Array, seed: int) -> Array:
        """Return the residuals at a point."""
        self.put(point)
        return np.concatenate([
            (root * (view.cut(self._render(view, seed + k, self.spp)) - view.picture)).ravel()
            for k, (view, root) in enumerate(zip(self.views, self._roots, strict=True))
        ])  # fmt: skip

    def _render(self, view: View, seed: int, spp: int) -> mi.TensorXf:
        return self.integrator.render(self.scene, view.sensor, seed=seed, spp=spp)

    def jacobian(self, point: Array, seed: int) -> Array:
        """Return the derivatives of the residuals by the shifts, shape (residuals, shifts), by forward
        differentiation; with half the samples of residuals, as two are averaged."""
        if self._sweeps is None:
            self._sweeps = [[k] for k in range(len(point))]
            self._sweeps = self._together(self.jacobian(point, seed))
        columns = np.zeros((sum(view.picture.size for view in self.views), len(point)))
        spp = max(self.spp // 2, 1)
        for sweep in self._sweeps:
            tangent = self._tangent(point, sweep, seed, spp)
            for channel, k in enumerate(sweep):  # of a sweep of one shift, all residuals are its own
                columns[channel :: len(sweep), k] = tangent[channel :: len(sweep)]
        return columns

    def _tangent(self, point: Array, sweep: list[int], seed: int, spp: int) -> Array:
        """Return the derivative of the residuals by some shifts together."""
        direction = np.isin(np.arange(len(point)), sweep).astype(float)
        found = []
        with self._differentiable(point):
            for slot, place in zip(self.slots, self.places, strict=True):
                dr.set_grad(self.params[slot.key], slot.typed(slot.slopes(point[place]) * direction[place]))
                dr.enqueue(dr.ADMode.Forward, self.params[slot.key])
            # Bitmaps hold copies of their values: integrators need the derivatives of these.
            dr.traverse(dr.ADMode.Forward, dr.ADFlag.ClearEdges)
            for k, (view, root) in enumerate(zip(self.views, self._roots, strict=True)):
                image = self._render_forward(view, seed + k, spp)
                found.append((root * view.cut(image)).ravel())
        return np.concatenate(found)

    def _render_forward(self, view: View, seed: int, spp: int) -> mi.TensorXf:
        try:
            return self.integrator.render_forward(self.scene, self.params, view.sensor, seed=seed, spp=spp)
        except RuntimeError as error:
            if "isolate_grad" not in one_line(error):
                raise
            # Every BSDF that lives is part of the kernels.
            raise FitError(
                "A parameter of another scene has derivatives, and a picture of it that was not differentiated: first "
                "call dr.disable_grad for that parameter, or dr.backward for that picture."
            ) from error

    def gradients(self, point: Array) -> list[Array]:
        """Return half the derivatives of the sum of squares by the base of each slot, by backward differentiation;
        with a quarter of the samples, as there are many steps."""
        self.put(point)
        seed, other, spp = self.fresh(), self.fresh(), max(self.spp // 4, 1)
        with dr.suspend_grad():
            images = [self._render(view, seed + k, spp) for k, view in enumerate(self.views)]
        with self._differentiable(point):
            for k, (view, root, image) in enumerate(zip(self.views, self._roots, images, strict=True)):
                given = np.zeros(image.shape, np.float32)
                given[..., : view.picture.shape[-1]] = root**2 * (view.cut(image) - view.picture)
                self.integrator.render_backward(
                    self.scene, self.params, mi.TensorXf(given), view.sensor, seed=other + k, spp=spp
                )
            found = [np.array(dr.grad(self.params[slot.key]), np.float64) for slot in self.slots]
        return [
            np.nan_to_num(gradient).reshape(slot.base.shape) * slot.slopes(point[place])
            for gradient, slot, place in zip(found, self.slots, self.places, strict=True)
        ]

    @contextmanager
    def _differentiable(self, point: Array) -> Iterator[None]:
        """Put a point, with derivatives of all of its values, so that one kernel serves all sweeps."""
        self.put(point)
        for slot in self.slots:
            dr.enable_grad(self.params[slot.key])
        self.params.update()
        try:
            yield
        finally:
            self.put(point)

    def _together(self, jacobian: Array) -> list[list[int]]:
        """Return the shifts of each sweep: the channels of a colour together, unless some channel of the pictures
        depends on another one of a colour."""
        seen = [jacobian[:, place].any() for place in self.places]
        paths = [slot.key.rsplit(".", 2)[0] for slot in self.slots]
        for path in paths:
            if not any(own for own, of in zip(seen, paths, strict=True) if of == path):
                raise FitError(f"{path} changes nothing in the pictures: its surface is not seen, or not lit.")
        alone = [[k] for k in range(jacobian.shape[1])]
        if any(view.picture.shape[-1] != 3 for view in self.views):
            return alone
        together = [[*range(place.start, place.stop)] for place in self.places]
        others = (jacobian[c::3, k] for own in together if len(own) == 3
                  for j, k in enumerate(own) for c in range(3) if c != j)  # fmt: skip
        if any(len(own) == 2 for own in together) or any(column.any() for column in others):
            return alone
        return together
