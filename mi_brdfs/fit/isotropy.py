"""Which parameters an isotropic material says nothing about: those that make a model anisotropic."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ..probe.directions import hemisphere
from .lanes import Lanes
from .unknowns import Configuration

PAIRS, TURN = 64, 0.65
"""The pairs of directions that are compared with themselves, turned by this angle in radians."""
PLACES = 0.3, 0.7
"""Where each parameter is tried, as parts of its range on its scale."""
TOLERANCE = 1e-3
"""The largest relative difference that is rounding."""


def isotropic(configuration: Configuration) -> Configuration:
    """Return a configuration whose values do not change as both directions turn about the normal.

    Numbers that would change that are left at their defaults, but pairs of them that would not if equal are tied: so
    it is with Lafortune's Cx and Cy.
    """
    names = [u.name for u in configuration.unknowns if not u.colour]
    if not names:
        return configuration
    lanes, indices = Lanes(configuration, 3), {name: configuration.indices(name)[0] for name in names}
    base = np.array([
        u.default if u.default is not None else float(u.from_scale(np.mean(np.clip(u.ends, -3, 3))))
        for u in configuration.unknowns
    ])  # fmt: skip
    base = np.array([np.clip(x, u.low, u.high) for x, u in zip(base, configuration.unknowns, strict=True)])

    def turns(settings: list[np.ndarray]) -> np.ndarray:
        """Return whether each of some settings is anisotropic."""
        wi, wo = hemisphere(PAIRS, 1, 0.2), hemisphere(PAIRS, 2, 0.2)
        wo[::2] = wi[::2] * [-1, -1, 1] + 0.05 * wo[::2]  # near the mirror direction, where glossy lobes are
        wo /= np.linalg.norm(wo, axis=1, keepdims=True)
        cos, sin = np.cos(TURN), np.sin(TURN)
        turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        pairs = [(np.concatenate([wi, wi @ turn]), np.concatenate([wo, wo @ turn]))] * len(settings)
        values, _ = lanes.evaluate(np.array(settings), pairs, derivatives=False)
        straight, turned = np.moveaxis(values.reshape(len(settings), 2, PAIRS, -1), 1, 0)
        scale = np.maximum(np.abs(straight), 1e-3 * np.abs(straight).max(axis=1, keepdims=True))
        return np.asarray((np.abs(straight - turned) > TOLERANCE * scale).any(axis=(1, 2)))

    def moved(*together: str) -> list[np.ndarray]:
        """Return the base with some parameters at the same other places."""
        settings = []
        for part in PLACES:
            setting, unknown = base.copy(), configuration.unknowns[indices[together[0]]]
            low, high = unknown.ends
            setting[[indices[name] for name in together]] = unknown.from_scale(np.array(low + part * (high - low)))
            settings.append(setting)
        return settings

    found = turns([base, *(setting for name in names for setting in moved(name))])
    if found[0]:  # no matter what they are
        return configuration
    tried = np.any(found[1:].reshape(len(names), len(PLACES)), axis=1)
    breaking = [name for name, breaks in zip(names, tried, strict=True) if breaks]
    limits = {name: (configuration.unknowns[indices[name]].low, configuration.unknowns[indices[name]].high)
              for name in breaking}  # fmt: skip
    alike = [(a, b) for a, b in combinations(breaking, 2) if limits[a] == limits[b]]
    tied: dict[str, str] = {}
    if alike:
        found = turns([setting for pair in alike for setting in moved(*pair)])
        broken = np.any(found.reshape(len(alike), len(PLACES)), axis=1)
        for (a, b), apart in zip(alike, broken, strict=True):
            if not apart and a not in tied and b not in tied:
                tied[b] = a
    dropped = [name for name in breaking if name not in tied and name not in tied.values()]
    return configuration.without(dropped, tied)
