"""What becomes of plugins of Mitsuba 0.6 that take more than another name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .document import Element
    from .upgrade import Work

RULES: dict[tuple[str, str], Callable[[Work, Element], Element | None]] = {}
"""The functions that change a plugin of a kind and a type, whose parts are those of Mitsuba 3, in place, or return what
replaces it. Under "" and a kind is the one for all its other types."""


def rule(kind: str, *types: str) -> Callable:
    def declare(function: Any) -> Any:
        RULES.update({(kind, type): function for type in types})
        return function

    return declare
