"""Textures, texel by texel.

D. P. Kingma, J. Ba, Adam: A method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..probe.arrays import Array
from .rendered import Rendered

STEPS = 10
"""Steps for each that is told of."""
FIRST, LAST = 0.2, 0.01
"""The longest steps along an unknown, on its scale, in the beginning and at the end."""
MOMENTUM, MEMORY = 0.9, 0.99


def refine_textures(rendered: Rendered, point: Array, steps: int, on_step: Callable[[], None]) -> Array:
    """Give the textures of slots the texels that suit the pictures best, from where they are at a point, and return the
    point there: numbers and colours move along, and textures have no shift any more."""
    slots = rendered.slots
    bases = [slot.on_scale(point[place]) for slot, place in zip(slots, rendered.places, strict=True)]
    means, squares = ([np.zeros_like(base) for base in bases] for _ in range(2))
    rest = np.zeros_like(point)
    for step in range(1, STEPS * steps + 1):
        rendered.slots = [replace(slot, base=base) for slot, base in zip(slots, bases, strict=True)]
        rate = FIRST * (LAST / FIRST) ** (step / (STEPS * steps))
        for k, gradient in enumerate(rendered.gradients(rest)):
            means[k] = MOMENTUM * means[k] + (1 - MOMENTUM) * gradient
            squares[k] = MEMORY * squares[k] + (1 - MEMORY) * gradient**2
            mean, square = means[k] / (1 - MOMENTUM**step), squares[k] / (1 - MEMORY**step)
            bases[k] = np.clip(bases[k] - rate * mean / np.sqrt(square + 1e-30), *slots[k].ends)
        if step % STEPS == 0:
            on_step()
    rendered.slots = [replace(s, base=b) if s.is_texture else s for s, b in zip(slots, bases, strict=True)]
    return np.concatenate([
        np.zeros(slot.channels) if slot.is_texture else base for slot, base in zip(slots, bases, strict=True)
    ])  # fmt: skip
