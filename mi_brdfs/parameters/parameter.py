"""What all parameters have in common."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Generic, NamedTuple, TypeVar, overload

import mitsuba as mi

from .reader import PropertyReader, Range

P = TypeVar("P", bound="Parameter")
V = TypeVar("V")


class ParameterRow(NamedTuple):
    """A line of the parameter table on a manual page."""

    name: str
    type: str
    default: str
    range: str
    text: str


class Quantity(NamedTuple):
    """A number or a colour that a parameter may be given as."""

    name: str
    limits: Range
    default: float | None
    text: str = ""
    colour: bool = False
    turns: bool = False
    """Whether it is a rotation: whole turns change nothing."""
    usual: Range | None = None
    """Where its values usually are, if that is not nearly all of its range."""
    sought: bool = True
    """Whether fits seek it."""
    starts: int = 0
    """The least number of starts of a fit that does, where the error has many valleys."""
    isotropic_as: str | None = None
    """Of an isotropic material the name of another one that it equals, or "" if it has its default."""


class Parameter:
    """A parameter of a plugin: as a class attribute its declaration, and as a bound copy its value in one instance.

    A declaration does not change: :meth:`bind` returns a copy that holds, besides, what the instance was given.
    """

    name: str
    """The attribute that it was assigned to."""
    words: Mapping[Any, Mapping[str, Parameter]] = {}
    """The words or flags that it may be, each with the parameters that it has beside it; of words the default first."""
    implied_words: tuple[str, ...] = ()
    """Those of them that are not given, but follow from which parameters are."""
    role: str | None = None
    """Of a colour "diffuse" or "specular", the scale of a lobe, which adds to the others; of a number or a colour
    "fresnel", if a Fresnel term has it."""

    def __init__(self, text: str):
        self.text = text
        self.number = ""
        """What follows each of its names where it belongs to one of several lobes: "_1", "_2" …"""
        self.textures: dict[str, mi.Texture] = {}
        """Once bound, its textures by property name. A parameter without a default that was not given has none."""
        self.ranges: dict[str, Range] = {}
        """What the values of these are limited to."""
        self.roles: dict[str, str] = {}
        """The roles of those that belong to its words or lobes."""
        self.chosen: dict[str, Any] = {}
        """Once bound, the choices made with it, by declared name."""

    def __set_name__(self, owner: type | None, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        members = ", ".join(f"{name}={value!r}" for name, value in vars(self).items())
        return f"{type(self).__name__}({members})"

    def replace(self: P, **members: Any) -> P:
        """Return a copy with some attributes replaced."""
        replaced = copy.copy(self)
        vars(replaced).update(members)
        return replaced

    def numbered(self: P, number: str) -> P:
        """Return the declaration for one of several lobes."""
        return self.replace(number=number)

    @property
    def names(self) -> list[str]:
        """The names of the properties that it may be given as, the usual one first."""
        return [self.name + self.number]

    @property
    def shown(self) -> list[str]:
        """These names as messages list them."""
        return self.names

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        """The ways to give it as numbers or colours, the usual one first: fits, the explorer, sweeps and searches know
        from these, and from the words, what to vary."""
        return []

    def quantities(self, pairs: bool) -> tuple[Quantity, ...]:
        """Return what it is usually given as, or if ``pairs`` are wanted, the pair along the tangents if any."""
        ways = self.spellings
        paired = [way for way in ways if len(way) > 1] if pairs else []
        return (paired or ways or [()])[0]

    @property
    def brought(self) -> tuple[Any, ...]:
        """The words that are given, of a kind of which others are implied."""
        return tuple(word for word in self.words if self.implied_words and word not in self.implied_words)

    @property
    def fit_words(self) -> tuple[Any, ...]:
        """Its words as fits try them: the first where none is given."""
        return tuple(self.words)

    @property
    def choices(self) -> tuple[Any, ...]:
        """All that it may be, where that is a choice: its words, or the names of a library."""
        return tuple(self.words)

    @property
    def tried(self) -> tuple[Any, ...]:
        """Values that show what it does; none if nobody needs a picture of them."""
        return ()

    def children(self) -> Iterable[Parameter]:
        """Return the parameters that belong to its words or lobes."""
        return [parameter for declared in self.words.values() for parameter in declared.values()]

    def rivals(self, name: str) -> list[str]:
        """Return the names that one of its names gives way to, where it comes from a preset."""
        return []

    def fill_in(self, reader: PropertyReader, declared: Iterable[Parameter]) -> None:
        """Give the properties that this one stands for, before any parameter is bound; most stand for none."""

    def bind(self, reader: PropertyReader) -> Parameter | str | bool:
        """Return a copy that holds what a plugin was given; a choice or a flag returns its value instead."""
        raise NotImplementedError(f"{type(self).__name__} does not define bind.")

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        """Return the value of a bound parameter at a surface interaction."""
        raise NotImplementedError(f"{type(self).__name__} does not define evaluate.")

    def placeholder(self) -> Any:
        """Return a value that a bound parameter may have, to build a model's lobes before there is a surface point."""
        return None

    def rows(self) -> list[ParameterRow]:
        """Return its lines in the table of the manual page."""
        raise NotImplementedError(f"{type(self).__name__} does not define rows.")


class Chosen(Parameter, Generic[V]):
    """A parameter that is read from a plugin instance: there an attribute of its name, found first, holds its value."""

    @overload
    def __get__(self: P, plugin: None, owner: type) -> P: ...
    @overload
    def __get__(self, plugin: Any, owner: type) -> V: ...
    def __get__(self, plugin: Any, owner: type) -> Any:
        return self


def nested(declared: Iterable[Parameter]) -> Iterator[Parameter]:
    """Yield parameters, each followed by those that belong to it."""
    for parameter in declared:
        yield parameter
        yield from nested(parameter.children())


class BoundParameters(dict[str, Parameter]):
    """Several parameters bound together, by declared name, with all their ``textures``, ``ranges`` and ``roles``.

    Choices are not among the parameters: ``chosen`` has their words and flags, also of what belongs to others, and
    ``words`` those that are declared here.
    """

    def __init__(self, declared: Iterable[Parameter], reader: PropertyReader):
        super().__init__()
        self.textures: dict[str, mi.Texture] = {}
        self.ranges: dict[str, Range] = {}
        self.roles: dict[str, str] = {}
        self.chosen: dict[str, Any] = {}
        self.words: dict[str, Any] = {}
        for parameter in declared:
            bound = parameter.bind(reader)
            if not isinstance(bound, Parameter):
                self.words[parameter.name] = self.chosen[parameter.name] = bound
                continue
            self[parameter.name] = bound
            self.textures |= bound.textures
            self.ranges |= bound.ranges
            self.roles |= dict.fromkeys(bound.ranges, bound.role) if bound.role else bound.roles
            self.chosen |= bound.chosen

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> dict[str, Any]:
        """Return the values at a surface interaction, by declared name, with the ``words``."""
        return self.words | {name: parameter.evaluate(si, active) for name, parameter in self.items()}

    def placeholders(self) -> dict[str, Any]:
        """Return values that these may have, by declared name, with the ``words``."""
        return self.words | {name: parameter.placeholder() for name, parameter in self.items()}
