"""What is the same everywhere on a surface, computed once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi


@dataclass
class Uniform:
    """Numbers that kernels read instead of computing them in each lane, if they are the same everywhere on a surface.
    Each costs a kernel about a dozen operations, as it is loaded for every lane: what takes fewer is better computed.
    Called with a name and numbers, it returns those that it has ``kept`` of that name, or else the numbers: also while
    derivatives are sought, which those that are kept have not, and where these are ``stale``."""

    kept: dict[str, list[Any]] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    settling: bool = False
    stale: bool = False
    values: list[Any] = field(default_factory=list)
    """Those of the textures, when numbers were kept."""

    def __call__(self, name: str, numbers: Any) -> Any:
        self.names.add(name)
        if self.settling and all(dr.width(number) == 1 for number in numbers):
            self.kept[name] = [dr.detach(number) for number in numbers]
        kept = None if self.settling or self.stale or dr.grad_enabled(numbers) else self.kept.get(name)
        # As copies: a zero that nobody else holds takes the width of what it is multiplied by.
        return numbers if kept is None else [dr.detach(number) for number in kept]

    def compare(self, textures: Mapping[str, mi.Texture]) -> None:
        """Find out whether textures have other values since numbers were kept: of one that several BSDFs share, Mitsuba
        tells a single one of them."""
        self.stale = bool(self.kept) and _indices(_values(textures)) != _indices(self.values)

    def settle(self, textures: Mapping[str, mi.Texture], compute: Callable[[], Any]) -> None:
        """Keep what is asked for in a computation at two points of the surface, of which some numbers are arrays of
        two. No kernel may be recorded then."""
        self.kept.clear()
        self.values = _values(textures)
        self.settling = True
        try:
            compute()
        finally:
            self.settling = False
        dr.eval(self.kept)


def _values(textures: Mapping[str, mi.Texture]) -> list[Any]:
    found = (params[key] for params in map(mi.traverse, textures.values()) for key in params.keys())
    return [dr.detach(value) for value in found if dr.is_jit_v(value)]


def _indices(values: list[Any]) -> list[int]:
    """Return what Dr.Jit calls its variables, which are others once a value is set."""
    return list(dr.detail.collect_indices(values))
