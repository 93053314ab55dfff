"""Parameters that have parameters of their own."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import mitsuba as mi

from .messages import listed
from .parameter import BoundParameters, Chosen, Parameter, ParameterRow
from .reader import PropertyReader


class OneOf(Chosen[str]):
    """One of several words, by default the first, each with parameters of its own.

    The word is an attribute of the model, like a :class:`Choice`. Evaluated, it has the parameters of the word as
    attributes.
    """

    word: str
    """Once bound, the chosen word."""
    own: BoundParameters
    """Once bound, its parameters."""

    def __init__(self, words: Mapping[str, Mapping[str, Parameter]], text: str):
        super().__init__(text)
        self.words: dict[str, Mapping[str, Parameter]] = {}  # of its own
        for word, declared in words.items():
            self.add(word, declared)

    def add(self, word: str, declared: Mapping[str, Parameter]) -> None:
        """Add a word with its parameters."""
        for name, parameter in declared.items():
            parameter.__set_name__(None, name)
        self.words[word] = declared

    def names_of(self, word: str) -> list[str]:
        """Return the names of the properties that belong to a word."""
        return [name for parameter in self.words[word].values() for name in parameter.names]

    @property
    def names(self) -> list[str]:
        return list(dict.fromkeys([self.name, *(name for word in self.words for name in self.names_of(word))]))

    def rivals(self, name: str) -> list[str]:
        return [] if name == self.name else [self.name]

    def bind(self, reader: PropertyReader) -> OneOf:
        word = self._word(reader)
        own = BoundParameters(self.words[word].values(), reader)
        chosen = own.chosen if word in self.implied_words else {self.name: word, **own.chosen}
        bound = {"textures": own.textures, "ranges": own.ranges, "roles": own.roles, "chosen": chosen}
        return self.replace(word=word, own=own, **bound)

    def _word(self, reader: PropertyReader) -> str:
        return self._given(reader, tuple(self.words))

    def _given(self, reader: PropertyReader, words: tuple[str, ...]) -> str:
        """Return the given one of some words, and raise if a parameter is given that belongs to another one of them."""
        word = reader.choice(self.name, words)
        allowed = self.names_of(word)
        for name in (name for other in words for name in self.names_of(other)):
            if name in reader and name not in allowed:
                has = f"has {listed(allowed, 'and')}" if allowed else "has no parameter"
                owners = listed((it for it in words if name in self.names_of(it)), quote=True)
                told = f'does not belong to {self.name} = "{word}", which {has} of its own, but to {owners}'
                raise reader.error(name, told)
        return word

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        return SimpleNamespace(**self.own.evaluate(si, active))

    def placeholder(self) -> Any:
        return SimpleNamespace(**self.own.placeholders())

    def rows(self) -> list[ParameterRow]:
        return self._rows(tuple(self.words), next(iter(self.words)))

    def _rows(self, given: tuple[str, ...], default: str) -> list[ParameterRow]:
        rows = [ParameterRow(self.name, "string", default, " | ".join(given), self.text)]
        users: dict[Parameter, list[str]] = {}
        for word in given:
            for parameter in self.words[word].values():
                users.setdefault(parameter, []).append(word)
        for parameter, words in users.items():
            rows += [row._replace(text=f"with {listed(words, 'and')}: {row.text}") for row in parameter.rows()]
        return rows


class OneTerm(OneOf):
    """One of several terms (:class:`mi_brdfs.microfacet.terms.Term`), by its word, with its parameters. Evaluated, a
    function that makes the term, of what else it needs."""

    def __init__(self, terms: Iterable[Any], text: str):
        super().__init__({}, text)
        self.terms: dict[str, Any] = {}
        for term in terms:
            self.add_term(term)

    def add_term(self, term: Any) -> None:
        self.add(term.word, term.parameters)
        self.terms[term.word] = term

    def _made_of(self, values: dict[str, Any]) -> Any:
        return functools.partial(self.terms[self.word].of_values, values)

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        return self._made_of(self.own.evaluate(si, active))

    def placeholder(self) -> Any:
        return self._made_of(self.own.placeholders())


class PerLobe(Parameter):
    """The parameters of one to ``most`` lobes of a kind: NAME_1, NAME_2 … Evaluated, a list of their values.

    Lobe i exists if any of its names is given. A single lobe may drop the number, and exists if nothing is given.
    """

    lobes: list[BoundParameters]
    """Once bound, the parameters of each lobe."""

    def __init__(self, most: int, **declared: Parameter):
        super().__init__("")
        self.declared = declared
        for name, parameter in declared.items():
            parameter.__set_name__(None, name)
        self.numbers = ["", *(f"_{i}" for i in range(1, most + 1))]

    def lobe(self, number: str) -> list[Parameter]:
        """Return the declarations of the lobe of a number, one of ``numbers``."""
        return [parameter.numbered(number) for parameter in self.declared.values()]

    def children(self) -> list[Parameter]:
        return [parameter for number in self.numbers for parameter in self.lobe(number)]

    def _names(self, number: str) -> list[str]:
        return [name for parameter in self.lobe(number) for name in parameter.names]

    @property
    def names(self) -> list[str]:
        return [name for number in self.numbers for name in self._names(number)]

    @property
    def shown(self) -> list[str]:
        return self._names("_i")

    def bind(self, reader: PropertyReader) -> PerLobe:
        lobes = [BoundParameters(self.lobe(number), reader) for number in self._given(reader)]
        for it in (it for lobe in lobes for it in lobe.values()):
            for name in it.textures.keys() - it.names:
                raise TypeError(f"{it.name}: {type(it).__name__} must read self.names[0], {it.names[0]}, not {name}")
        bound = {
            of: {name: value for lobe in lobes for name, value in getattr(lobe, of).items()}
            for of in ("textures", "ranges", "roles")
        }
        return self.replace(lobes=lobes, **bound)

    def _given(self, reader: PropertyReader) -> list[str]:
        """Return the numbers of the lobes that exist, and raise if they are not in order."""
        names = {number: [name for name in self._names(number) if name in reader] for number in self.numbers}
        first = {number: given[0] for number, given in names.items() if given}
        numbers = list(first) or [""]
        if "" in numbers and len(numbers) > 1:
            raise reader.error(first[""], f"excludes {first[numbers[1]]}; number the names of all lobes, or of none")
        for number, expected in zip(numbers, self.numbers[1:], strict=False):
            if number not in ("", expected):
                problem = f"leaves a gap; number the lobes from 1, so that this one is {expected[1:]}"
                raise reader.error(first[number], problem)
        return numbers

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> list[SimpleNamespace]:
        return [SimpleNamespace(**lobe.evaluate(si, active)) for lobe in self.lobes]

    def placeholder(self) -> list[SimpleNamespace]:
        return [SimpleNamespace(**lobe.placeholders()) for lobe in self.lobes]

    def rows(self) -> list[ParameterRow]:
        return [row for parameter in self.lobe("_i") for row in parameter.rows()]
