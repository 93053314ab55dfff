"""The base class of distributions, shadowing and Fresnel terms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

T = TypeVar("T", bound="Term")


class Term:
    """A term of a microfacet model. :func:`mi_brdfs.register` adds it to ``microfacet`` under its ``word``."""

    word: ClassVar[str | None] = None
    """Its word in the kit."""
    parameters: ClassVar[Mapping[str, Any]] = {}
    """The declarations (:mod:`mi_brdfs.parameters`) that go with the word, by name. The class is called with their
    values by name; an anisotropic one comes as NAME_u and NAME_v."""

    @classmethod
    def of_values(cls: type[T], values: Mapping[str, Any]) -> T:
        """Return the term for given values of its parameters."""
        spread: dict[str, Any] = {}
        for name, value in values.items():
            spread |= {f"{name}_u": value[0], f"{name}_v": value[1]} if isinstance(value, tuple) else {name: value}
        return cls(**spread)
