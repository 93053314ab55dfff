"""Steps where residuals and derivatives are noisy, as those of renderings are: Levenberg–Marquardt's for numbers and
colours, and Adam's for textures, texel by texel.

Expectations of the former are without bias: the residuals and their derivatives come of different random numbers, and
of each there are two, so that no product has the square of a noise in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from ..probe.arrays import Array
from .rendered import BLOCK, Rendered
from .solver import DAMPING, STRONGER, WEAKER, damped_steps

TRIES = 4
"""How often a step is shortened that gains nothing, before its place is looked at anew."""
LEAST_DAMPING = 1e-4
LEAST = 0.02
"""The part of JᵀJ that is at least kept where all of it may be noise, in any direction."""
SHORT = 0.02
"""The longest step along an unknown, on its scale, after which nothing more is to be gained from a few samples."""
PATIENCE, GAIN = 3, 0.9
"""Nor is there after so many steps that did not lower the cost by this factor."""
LOOKS = 6
"""How often the place of the last step is looked at."""

TEXEL_STEPS = 10
"""Steps of Adam for each that is told of."""
FIRST, LAST = 0.2, 0.01
"""The longest of these along an unknown, on its scale, in the beginning and at the end."""
MOMENTUM, MEMORY = 0.9, 0.99


class Look(NamedTuple):
    """What is seen at a point: a pair of independent residuals, each a mean over some seeds, and of Jacobians."""

    seeds: tuple[list[int], list[int]]
    residuals: tuple[Array, Array]
    jacobians: tuple[Array, Array]

    @property
    def jacobian(self) -> Array:
        return np.asarray(sum(self.jacobians) / 2)

    @property
    def matrix(self) -> Array:
        """JᵀJ of two noisy J, whose products have the square of no noise. Where it is much less than that of their
        mean, or negative, it is a small part of this."""
        one, other = self.jacobians
        cross = one.T @ other
        cross = (cross + cross.T) / 2
        mean = self.jacobian
        whole = mean.T @ mean
        scale = np.sqrt(np.maximum(np.diag(whole), 1e-300))
        lengths, axes = np.linalg.eigh(whole / np.outer(scale, scale))
        roots = np.sqrt(np.maximum(lengths, 1e-12 * lengths.max()))
        parts, directions = np.linalg.eigh((axes / roots).T @ (cross / np.outer(scale, scale)) @ (axes / roots))
        kept = (axes * roots) @ directions
        return np.asarray((kept * np.clip(parts, LEAST, 1)) @ kept.T * np.outer(scale, scale))

    @property
    def cost(self) -> float:
        first, second = self.residuals
        return float(first @ second)

    @property
    def gradient(self) -> Array:
        first, second = self.residuals
        return np.asarray(self.jacobian.T @ (first + second) / 2)

    def step(self, point: Array, damping: float, box: tuple[Array, Array]) -> Array:
        batch = damped_steps(point[None], self.gradient[None], self.matrix[None], np.array([damping]), *box)
        return np.asarray(np.clip(point + batch[0], *box) - point)


def descend(
    rendered: Rendered, point: Array, steps: int, on_step: Callable[[float], None] = lambda cost: None
) -> tuple[Array, bool]:
    """Return ``(point, converged)`` after at most ``steps`` steps; ``on_step`` is called with the cost before each."""
    damping, costs = DAMPING, list[float]()
    point = np.clip(point, *rendered.box)
    for _ in range(steps):
        look = _look(rendered, point)
        on_step(look.cost)
        costs.append(look.cost)
        step, damping = _gaining(rendered, look, point, damping)
        point = point + step
        stalled = len(costs) > PATIENCE and min(costs[-PATIENCE:]) > GAIN * min(costs[:-PATIENCE])
        if stalled or (step.any() and np.abs(step).max() < SHORT):
            return point, True
    return point, False


def finish(rendered: Rendered, point: Array) -> tuple[Array, Array, float]:
    """Return ``(point, sigma, cost)`` after one more step, with more samples than the others: the standard deviations
    are on the scales of the unknowns, NaN for those at an end of their range or without influence. Of two estimates the
    larger one counts: by the residuals, whose noise may be common to near pixels (MacKinnon and White 1985), and
    by what the step would be without one of the looks, as noise of the derivatives leaves no residuals: the jackknife
    (B. Efron, C. Stein, The jackknife estimate of variance, Annals of Statistics 9(3), 1981)."""
    looks = [_look(rendered, point) for _ in range(LOOKS)]
    look = _together(looks)
    step, _ = _gaining(rendered, look, point, LEAST_DAMPING)
    end, (low, high) = point + step, rendered.box
    free = np.flatnonzero((end > low) & (end < high) & look.jacobian.any(axis=0))
    sigma = np.full(len(point), np.nan)
    if len(free):
        mean, jacobian = sum(look.residuals) / 2 + look.jacobian @ step, look.jacobian[:, free]
        bread = np.linalg.pinv(look.matrix[np.ix_(free, free)])
        groups = (rendered.groups(1), 1.0), (rendered.groups(BLOCK), 0.5)
        near = [_by_residuals(jacobian, mean, bread, *each) for each in groups]
        # Pixels that decide a number by themselves leave no residual to judge it by: then that of all counts.
        alike = bread * (mean @ mean) / max(np.count_nonzero(mean) - len(free), 1)
        others = (_together([it for it in looks if it is not out]) for out in looks)
        steps = np.array([it.step(point, LEAST_DAMPING, rendered.box)[free] for it in others])
        variances = *near, np.diag(alike), (LOOKS - 1) * steps.var(axis=0)
        sigma[free] = np.sqrt(np.max(variances, axis=0))
    return end, sigma, look.cost


def _by_residuals(jacobian: Array, residuals: Array, bread: Array, groups: Array, power: float) -> Array:
    """Return the variances of a step by residuals that have noise in common within groups: HC3 with the power 1, and
    with a half HC2, for groups of which few have weight."""
    columns = [*(jacobian * residuals[:, None]).T, ((jacobian @ bread) * jacobian).sum(axis=1)]
    *scores, leverage = (np.bincount(groups, column) for column in columns)
    weighed = np.stack(scores) / np.maximum(1 - leverage, 0.1) ** power  # one with weight pulls the step to itself
    return np.asarray(np.diag(bread @ (weighed @ weighed.T) @ bread))


def _gaining(rendered: Rendered, look: Look, point: Array, damping: float) -> tuple[Array, float]:
    """Return a step that lowers the cost, or none, and the damping of the next one."""
    for _ in range(TRIES):
        step = look.step(point, damping, rendered.box)
        first, second = (_residuals(rendered, point + step, seeds) for seeds in look.seeds)
        if first @ second < look.cost:
            return step, max(damping * WEAKER, LEAST_DAMPING)
        damping *= STRONGER
    return np.zeros_like(point), damping


def _look(rendered: Rendered, point: Array) -> Look:
    seeds = [rendered.fresh()], [rendered.fresh()]
    first, second = (_residuals(rendered, point, own) for own in seeds)
    one, other = (rendered.jacobian(point, rendered.fresh()) for _ in range(2))
    return Look(seeds, (first, second), (one, other))


def _residuals(rendered: Rendered, point: Array, seeds: list[int]) -> Array:
    return np.mean([rendered.residuals(point, seed) for seed in seeds], axis=0)


def _together(looks: Sequence[Look]) -> Look:
    """Return one look for several at a point."""
    firsts, seconds = zip(*(look.seeds for look in looks), strict=True)
    residuals, jacobians = _means([look.residuals for look in looks]), _means([look.jacobians for look in looks])
    return Look(([*chain(*firsts)], [*chain(*seconds)]), residuals, jacobians)


def _means(pairs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    first, second = zip(*pairs, strict=True)
    return np.mean(first, axis=0), np.mean(second, axis=0)


def refine_textures(rendered: Rendered, point: Array, steps: int, on_step: Callable[[], None]) -> Array:
    """Give the textures of slots the texels that suit the pictures best, from where they are at a point, and return the
    point there: numbers and colours move along, and textures have no shift any more.

    D. P. Kingma, J. Ba, Adam: A method for stochastic optimization, ICLR 2015, arXiv:1412.6980.
    """
    slots = rendered.slots
    bases = [slot.on_scale(point[place]) for slot, place in zip(slots, rendered.places, strict=True)]
    means, squares = ([np.zeros_like(base) for base in bases] for _ in range(2))
    rest = np.zeros_like(point)
    for step in range(1, TEXEL_STEPS * steps + 1):
        rendered.slots = [replace(slot, base=base) for slot, base in zip(slots, bases, strict=True)]
        rate = FIRST * (LAST / FIRST) ** (step / (TEXEL_STEPS * steps))
        for k, gradient in enumerate(rendered.gradients(rest)):
            means[k] = MOMENTUM * means[k] + (1 - MOMENTUM) * gradient
            squares[k] = MEMORY * squares[k] + (1 - MEMORY) * gradient**2
            mean, square = means[k] / (1 - MOMENTUM**step), squares[k] / (1 - MEMORY**step)
            bases[k] = np.clip(bases[k] - rate * mean / np.sqrt(square + 1e-30), *slots[k].unknown.ends)
        if step % TEXEL_STEPS == 0:
            on_step()
    rendered.slots = [replace(s, base=b) if s.is_texture else s for s, b in zip(slots, bases, strict=True)]
    return np.concatenate([
        np.zeros(slot.channels) if slot.is_texture else base for slot, base in zip(slots, bases, strict=True)
    ])  # fmt: skip
