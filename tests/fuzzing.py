"""What fuzzing needs: hypothesis, and the ways to give a model its parameters. These come from the declarations alone,
so that new models are tried as they are."""

from __future__ import annotations

from functools import reduce, singledispatch
from operator import or_
from typing import NamedTuple

from hypothesis import Phase, given, settings

from mi_brdfs.models.microfacet import BROUGHT
from mi_brdfs.parameters import Choice, Colour, Flag, FresnelSet, Number, OneOf, PerLobe, Preset, Rotation


def examples(count, drawn):
    """A decorator of a function to call with what a strategy draws, which is the same in every run. Failures tell the
    whole input, and are not searched for simpler ones."""
    configured = settings(
        max_examples=count, deadline=None, database=None, derandomize=True, print_blob=False, phases=[Phase.generate]
    )
    return lambda function: configured(given(drawn)(function))


class Quantity(NamedTuple):
    """A number or a colour that may be given."""

    name: str
    limits: tuple[float, float]
    default: float
    colour: bool = False


class Options(NamedTuple):
    """Words by property name, and the quantities that go with them."""

    words: dict[str, str | bool]
    quantities: tuple[Quantity, ...] = ()

    def __or__(self, other: Options) -> Options:
        return Options(self.words | other.words, self.quantities + other.quantities)

    def __str__(self):
        words = [f"{name}={word}" for name, word in self.words.items()]
        return " ".join([*words, *(quantity.name for quantity in self.quantities)])


def ways(parameters) -> list[Options]:
    """Ways to give some parameters together, as many as it takes for each alternative of each of them."""
    each = [alternatives(parameter) for parameter in parameters]
    count = max((len(known) for known in each), default=1)
    return [reduce(or_, (known[k % len(known)] for known in each), Options({})) for k in range(count)]


@singledispatch
def alternatives(parameter) -> list[Options]:
    """The ways to give a parameter."""
    raise NotImplementedError(f"{type(parameter).__name__}: say here how it is given")


@alternatives.register
def _(number: Number):
    spellings = [number.names[:1]]
    if number.anisotropic:
        spellings += [number.pair, *([name] for name in number.pair if number.lone_default)]
    known = [Options({}, tuple(Quantity(n, number.limits, number.default or 0) for n in names)) for names in spellings]
    if number.spelling:
        default = number.default / number.spelling.scale
        known.append(Options({}, (Quantity(number.other, number.spelling.limits, default),)))
    return known


@alternatives.register
def _(colour: Colour):
    (name,) = colour.names
    return [Options({}, (Quantity(name, colour.limits, colour.default or 0, colour=True),))]


@alternatives.register
def _(choice: Choice):
    return [Options({choice.name: word}) for word in choice.choices]


@alternatives.register
def _(flag: Flag):
    return [Options({flag.name: value}) for value in (False, True)]


@alternatives.register
def _(one_of: OneOf):
    """Of the pack's own words: what others bring, they test."""
    words = {word: declared for word, declared in one_of.words.items() if (one_of.name, word) not in BROUGHT}
    return [Options({one_of.name: word}) | own for word, declared in words.items() for own in ways(declared.values())]


@alternatives.register
def _(lobes: PerLobe):
    """One lobe without a number, and three: more compile long, and do nothing new."""
    counts = (lobes.numbers[:1], lobes.numbers[1:4])
    return [way for numbers in counts for way in ways(p.numbered(n) for n in numbers for p in lobes.declared.values())]


@alternatives.register
def _(fresnel: FresnelSet):
    f0 = Quantity("f0", (0, 1), 0.5, colour=True)
    eta, k = Quantity("eta", fresnel.INDEX, 1.5, colour=True), Quantity("k", fresnel.EXTINCTION, 1, colour=True)
    inside, outside = Quantity("int_ior", fresnel.INDEX, 1.5), Quantity("ext_ior", fresnel.INDEX, 1)
    return [
        Options({}),
        Options({}, (eta, k)),
        Options({"material": "Au"}),
        Options({}, (f0,)),
        Options({}, (inside, outside)),
        Options({"int_ior": "water"}, (outside,)),
    ]


@alternatives.register
def _(rotation: Rotation):
    return [Options({}, (Quantity(rotation.name, (-1e4, 1e4), 0),)), Options({})]


@alternatives.register
def _(preset: Preset):
    """Without one: what it gives is what other parameters are given as."""
    return [Options({})]
