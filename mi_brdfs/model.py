"""The contract of a model: declared parameters, and the lobes that they make."""

from __future__ import annotations

import inspect
from types import SimpleNamespace
from typing import ClassVar

import mitsuba as mi

from .lobes import Lobe
from .parameters import Given, Parameter, Row, Slot


class Model:
    """A BRDF model. A subclass is its paper in code: its docstring is the manual page, its class attributes declare
    the parameters (:mod:`mi_brdfs.parameters`), and :meth:`lobes` says what they mean.

    An instance belongs to one plugin instance. It holds the parameters that are textures as ``slots``, by declared
    name, with all their ``textures`` by property name; choices are attributes under their declared names.
    """

    plugins: ClassVar[tuple[str, ...]] = ()
    """The plugin's name in scenes, and its aliases; by default the class name in lower case."""

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        cls.plugins = cls.__dict__.get("plugins", (cls.__name__.lower(),))

    def __init__(self, props: mi.Properties):
        given = Given(self.plugins[0], props)
        declared = self.declared()
        given.reject_unknown([n for p in declared for n in p.names], [n for p in declared for n in p.shown])
        self.slots: dict[str, Slot] = {}
        for parameter in declared:
            bound = parameter.bind(given)
            if isinstance(bound, Slot):
                self.slots[parameter.name] = bound
            else:
                setattr(self, parameter.name, bound)
        self.textures = {name: texture for slot in self.slots.values() for name, texture in slot.textures.items()}
        for name in props.keys():
            props.mark_queried(name)

    @classmethod
    def declared(cls) -> list[Parameter]:
        """The declared parameters, in the order of declaration."""
        members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        return [value for value in members.values() if isinstance(value, Parameter)]

    def lobes(self, p) -> tuple[Lobe, ...]:
        """The lobes of the model at a surface point, where ``p`` holds the values of the declared parameters. Their
        number and kinds depend on nothing but the model's choices."""
        raise NotImplementedError

    def evaluate(self, si, active) -> SimpleNamespace:
        """The values of the parameters that are textures, at a surface interaction."""
        return SimpleNamespace(**{name: slot.evaluate(si, active) for name, slot in self.slots.items()})

    def placeholders(self) -> SimpleNamespace:
        """Stand-ins for these values, to learn of which lobes the model consists."""
        declared = [parameter for parameter in self.declared() if parameter.name in self.slots]
        return SimpleNamespace(**{p.name: p.placeholder(self.slots[p.name]) for p in declared})

    @classmethod
    def manual(cls) -> str:
        """The manual page: the docstring, and the table of parameters."""
        rows = [Row("parameter", "type", "default", "range", "meaning")]
        rows += [row for parameter in cls.declared() for row in parameter.rows()]
        widths = [max(len(row[column]) for row in rows) for column in range(4)]
        table = ["  ".join([*map(str.ljust, row[:4], widths), row.text]) for row in rows]
        return "\n".join([inspect.cleandoc(cls.__doc__), "", "Parameters", "----------", *table, ""])
