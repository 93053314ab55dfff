"""What fuzzing needs: hypothesis, and the ways to give a model its parameters. These come from the declarations alone,
so that new models are tried as they are."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import NamedTuple

from hypothesis import Phase, given, settings

from mi_brdfs.microfacet.terms import Distribution
from mi_brdfs.mitsuba.registry import brought_terms
from mi_brdfs.parameters import ConductorName, Index, OneTerm, PerLobe, Quantity, Rotation


def examples(count, drawn):
    """A decorator of a function to call with what a strategy draws, which is the same in every run. Failures tell the
    whole input, and are not searched for simpler ones."""
    configured = settings(
        max_examples=count, deadline=None, database=None, derandomize=True, print_blob=False, phases=[Phase.generate]
    )
    return lambda function: configured(given(drawn)(function))


class Options(NamedTuple):
    """Words by property name, and the quantities that go with them."""

    words: dict[str, str | bool]
    quantities: tuple[Quantity, ...] = ()

    def __or__(self, other: Options) -> Options:
        return Options(self.words | other.words, self.quantities + other.quantities)

    def without(self, *names: str) -> Options:
        return self._replace(quantities=tuple(it for it in self.quantities if it.name not in names))

    def __str__(self):
        words = [f"{name}={word}" for name, word in self.words.items()]
        return " ".join([*words, *(quantity.name for quantity in self.quantities)])


FILM = {"film_thickness": 300.0, "film_ior": 1.8}


def typical(quantity) -> float:
    """The default of a quantity, or else a value at which it does something."""
    if quantity.name in FILM:
        return FILM[quantity.name]
    if quantity.default is not None:
        return float(quantity.default)
    if quantity.turns:
        return 0.0
    if quantity.limits[1] <= 1:
        return 0.5
    return 1.5 if quantity.sought else 1.0  # indices inside and outside


def ways(parameters) -> list[Options]:
    """Ways to give some parameters together, as many as it takes for each alternative of each of them. Of distributions
    each way takes the one that waited longest, of those that its shadowing term is known for."""
    each = {it: alternatives(it) for it in parameters if it.name != "distribution"}
    waiting = [(it, way) for it in parameters if it.name == "distribution" for way in alternatives(it)]
    shadowing = next((it.terms for it in each if it.name == "shadowing" and isinstance(it, OneTerm)), {})
    found = []
    for k in range(max(1, len(waiting), *map(len, each.values()))):
        options = reduce(or_, (known[k % len(known)] for known in each.values()), Options({}))
        term = shadowing.get(options.words.get("shadowing"))
        for it, way in waiting:
            if term is None or term.suits(it.terms[way.words["distribution"]]):
                waiting.remove((it, way))
                waiting.append((it, way))
                options = way | options
                if term and it.terms[way.words["distribution"]].widened is Distribution.widened:
                    options = options.without("haze", "haze_spread")
                break
        schlick = any(it.name == "f0" for it in options.quantities)
        found.append(options.without(*FILM) if schlick else options)
    return found


def alternatives(parameter) -> list[Options]:
    """The ways to give a parameter, of its words those of the pack: what others bring, they test. A preset is not
    given: what it gives is what other parameters are given as."""
    if isinstance(parameter, PerLobe):  # one lobe without a number, and three: more compile long, and do nothing new
        counts = (parameter.numbers[:1], parameter.numbers[1:4])
        return [way for numbers in counts for way in ways(p for n in numbers for p in parameter.lobe(n))]
    known = [Options({}, spelling) for spelling in parameter.spellings]
    if getattr(parameter, "lone_default", False):
        known += [Options({}, (quantity,)) for quantity in parameter.spellings[1]]
    for word, declared in parameter.words.items():
        if (parameter.name, word) not in brought_terms():
            given = {} if word in parameter.implied_words else {parameter.name: word}
            known += [Options(given) | own for own in ways(declared.values())]
    if isinstance(parameter, ConductorName):
        known = [Options({parameter.name: "Au"})]
    elif isinstance(parameter, Index):
        known.append(Options({parameter.name: "water"}))
    elif isinstance(parameter, Rotation) or not known or not getattr(parameter, "sought", True):
        known.append(Options({}))
    return known
