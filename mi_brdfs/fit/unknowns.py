"""The unknowns of a fit, by a model's declarations: which numbers are free, and on which scale they are sought."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..model import Model
from ..parameters import Parameter, PerLobe, Quantity, nested
from ..parameters.messages import listed
from ..parameters.vocabulary import hint
from ..probe.arrays import Array
from ..probe.parameter_space import choices, present
from .observations import FitError

SMALLEST, LARGEST = 1e-3, 1e6
"""Where a search on a logarithmic scale begins if a range begins at 0, and ends if it has no end."""
EDGE = 1e-5
"""How near to its ends a share is sought, as a part of its range; so near, it counts as at the end."""
WITHIN = 1e-3
"""How near to them one starts: at an end its scale is flat."""


class Scale(NamedTuple):
    """u of x, x of u, and dx/du of x, for numbers with the sum of the ends of their range."""

    u: Callable[[Array, float], Array]
    x: Callable[[Array, float], Array]
    slope: Callable[[Array, float], Array]


SCALES = {
    "log": Scale(lambda x, _: np.log(x), lambda u, _: np.exp(u), lambda x, _: x),
    "logit": Scale(  # a share of the range
        lambda x, whole: np.log(x / whole / (1 - x / whole)),
        lambda u, whole: whole / (1 + np.exp(-u)),
        lambda x, whole: x * (1 - x / whole),
    ),
    "asinh": Scale(lambda x, _: np.arcsinh(x), lambda u, _: np.sinh(u), lambda x, _: np.sqrt(1 + x * x)),
    "turns": Scale(  # in radians, of which a part is short as it is on the others
        lambda x, _: 2 * np.pi * x, lambda u, _: u / (2 * np.pi), lambda x, _: np.full_like(x, 1 / (2 * np.pi))
    ),
}
"""By name: for positive numbers, shares, numbers of both signs, and rotations, whose range has no ends."""


@dataclass(frozen=True)
class Unknown:
    """A number that is sought, within ``low`` and ``high``."""

    quantity: Quantity
    """The parameter's; of the range of a share, ``low`` and ``high`` leave out ``EDGE``."""
    channel: int | None
    """Of a colour with several channels."""
    low: float
    high: float
    scale: str
    """One of ``SCALES``."""

    @property
    def name(self) -> str:
        return self.quantity.name

    @property
    def label(self) -> str:
        return self.name if self.channel is None else f"{self.name}.{'rgb'[self.channel]}"

    @property
    def ends(self) -> tuple[float, float]:
        """The ends of the range on the scale."""
        low, high = self.to_scale(np.array([self.low, self.high]))
        return float(low), float(high)

    def to_scale(self, x: ArrayLike) -> Array:
        return SCALES[self.scale].u(np.clip(np.asarray(x, np.float64), self.low, self.high), self.high + self.low)

    def start(self, x: ArrayLike) -> Array:
        """Return where on the scale a search begins that is to begin at a value."""
        if self.scale == "logit":
            whole = self.high + self.low
            x = np.clip(x, WITHIN * whole, (1 - WITHIN) * whole)
        return self.to_scale(x)

    def from_scale(self, u: Array) -> Array:
        return np.clip(SCALES[self.scale].x(u, self.high + self.low), self.low, self.high)

    def slope(self, x: Array) -> Array:
        """Return dx/du."""
        return SCALES[self.scale].slope(x, self.high + self.low)

    def shown(self, x: float) -> float:
        """Return a value as a plugin dict has it, without whole turns, and at an end of the range that end itself."""
        if self.scale == "turns":
            return x - round(x)
        if not self.at_end(x):
            return x
        k = int(abs(x - self.high) < abs(x - self.low))
        return self.quantity.limits[k] if self.scale == "logit" else (self.low, self.high)[k]

    def at_end(self, x: float) -> bool:
        """Return whether a value is at an end of the range."""
        u, (low, high) = float(self.to_scale(x)), self.ends
        return min(u - low, high - u) < 1e-3 * (high - low)


def unknown_of(quantity: Quantity, channel: int | None = None) -> Unknown:
    """Return an unknown on the scale that suits a declared range: shares up to 1, and of a range of which a part is
    usual, on a logit scale, positive numbers on a logarithmic one."""
    low, high = quantity.limits
    if quantity.turns:
        low, high, scale = -math.inf, math.inf, "turns"
    elif low < 0:
        low, high, scale = max(low, -LARGEST), min(high, LARGEST), "asinh"
    elif low == 0 and (high <= 1 or quantity.usual):
        low, high, scale = EDGE * high, (1 - EDGE) * high, "logit"
    elif math.isinf(high):
        low, high, scale = max(low, 1 / LARGEST), LARGEST, "log"
    else:
        low, scale = max(low, SMALLEST * min(high, 1)), "log"
    return Unknown(quantity, channel, low, high, scale)


@dataclass(frozen=True)
class Configuration:
    """A model with its choices, what is fixed, and the unknowns."""

    model: type[Model]
    given: dict[str, Any]
    """The words and fixed parameters, as the plugin takes them."""
    words: dict[str, Any]
    """The choices among these that the model leaves open, and the one of the Fresnel term."""
    unknowns: tuple[Unknown, ...]
    tied: dict[str, str]
    """Parameters that are equal to another one."""
    fixed: tuple[str, ...] = ()
    """Parameters that isotropic materials say nothing about, left at their defaults."""

    @property
    def plugin(self) -> str:
        return self.model.plugins[0]

    @property
    def title(self) -> str:
        """The plugin's name, and the choices that differ from the defaults."""
        usual = default_words(self.model)
        chosen = (f"{name}={word}" for name, word in self.words.items() if usual.get(name) != word)
        return " ".join([self.plugin, *chosen])

    def indices(self, name: str) -> list[int]:
        """Return where the unknowns of a parameter are, one or one a channel."""
        name = self.tied.get(name, name)
        return [k for k, unknown in enumerate(self.unknowns) if unknown.name == name]

    @property
    def names(self) -> list[str]:
        """The parameters that are sought, with those that are tied to them."""
        return [*dict.fromkeys(unknown.name for unknown in self.unknowns), *self.tied]

    def is_colour(self, name: str) -> bool:
        return self.unknowns[self.indices(name)[0]].quantity.colour

    def shown(self, x: Array) -> list[float]:
        """Return values of the unknowns as the plugin dict has them."""
        return [float(f"{unknown.shown(float(value)):.7g}") for unknown, value in zip(self.unknowns, x, strict=True)]

    def bsdf(self, x: Array) -> dict[str, Any]:
        """Return the plugin dict for values of the unknowns."""
        values, shown = dict[str, Any](), self.shown(x)
        for name in self.names:
            numbers = [shown[k] for k in self.indices(name)]
            values[name] = numbers[0] if len(numbers) == 1 else {"type": "rgb", "value": numbers}
        return {"type": self.plugin, **self.given, **values}

    def isotropic(self) -> Configuration:
        """Return it for isotropic materials, without the unknowns that have nothing to say of them."""
        likes = {u.name: u.quantity.isotropic_as for u in self.unknowns}
        tied = {name: like for name, like in likes.items() if like and like in likes}
        fixed = tuple(name for name, like in likes.items() if like == "")
        kept = tuple(u for u in self.unknowns if u.name not in {*tied, *fixed})
        return replace(self, unknowns=kept, tied={**self.tied, **tied}, fixed=fixed)


def default_words(model: type[Model]) -> dict[str, Any]:
    """Return the word of each choice that stands where none is given."""
    return {name: words[0] for name, words in _choices(model).items()}


def _choices(model: type[Model]) -> dict[str, tuple[Any, ...]]:
    """Return the words of each choice, the default first."""
    return {it.name: it.fit_words for it in nested(model.declared()) if it.fit_words}


def configurations(
    model: type[Model], given: Mapping[str, Any], tied: Mapping[str, str], lobes: int, channels: int, anisotropic: bool
) -> list[Configuration]:
    """Return a model's configurations: one for each combination of the words of its choices that are given as a tuple,
    with the default of those that are not given. Names that it does not have are left out. Numbers and colours that are
    "free" are sought even if fits leave them as they are. Raise a FitError if there is no such word, or nothing is
    left to fit."""
    name, known = model.plugins[0], known_names(model)
    given = {key: value for key, value in given.items() if key in known}
    tied = {key: value for key, value in tied.items() if {key, value} <= known}
    if both := tied.keys() & set(tied.values()):
        raise FitError(f"{name}: {min(both)} is tied, and another one to it; tie them to one that is sought.")
    words = dict[str, tuple[Any, ...]]()
    for choice, allowed in _choices(model).items():
        wanted = given.get(choice, allowed[0])
        words[choice] = wanted if isinstance(wanted, tuple) else (wanted,)
        for word in words[choice]:
            if word not in allowed:
                raise FitError(f"{name}: {choice} = {word!r} is unknown; it is {listed(map(str, allowed))}.")
    freed = {key for key, value in given.items() if isinstance(value, str) and value == "free" and key not in words}
    fixed = {key: value for key, value in given.items() if key not in {*words, *freed}}
    implied = {parameter.name: parameter.implied_words for parameter in nested(model.declared())}
    for parameter in model.declared():
        if isinstance(parameter, PerLobe) and lobes >= len(parameter.numbers):
            raise FitError(f"There can be {len(parameter.numbers) - 1} lobes at most, not {lobes}.")
    found = []
    for combination in _combinations(model.declared(), words, fixed):
        free = (it for it in present(model.declared(), combination, lobes) if not it.words)
        unknowns = [u for parameter in free for u in _unknowns_of(parameter, fixed, freed, channels, anisotropic)]
        usable = {u.name for u in unknowns}
        if missing := {*tied, *tied.values()} - usable:
            raise FitError(
                f"{name}: {sorted(missing)[0]} is tied, but not free here; free are {listed(usable, 'and')}."
            )
        unknowns = [u for u in unknowns if u.name not in tied]
        if not unknowns:
            raise FitError(f"{name} has nothing to fit: all its parameters are given.")
        plain = {key: word for key, word in combination.items() if word not in implied.get(key, ())}
        passed = {k: v.item() if isinstance(v, np.generic) else v for k, v in fixed.items() if v is not None}
        found.append(Configuration(model, {**plain, **passed}, combination, tuple(unknowns), dict(tied)))
    # A choice may mean nothing beside another one.
    return [
        it for k, it in enumerate(found) if all((it.given, it.unknowns) != (o.given, o.unknowns) for o in found[:k])
    ]


def known_names(model: type[Model]) -> set[str]:
    """Return the names of all parameters of a model, and of the choice among Fresnel terms if it has one."""
    return {*_choices(model), *(name for parameter in model.declared() for name in parameter.names)}


def check_names(models: Iterable[type[Model]], names: Iterable[str]) -> None:
    """Raise a FitError for a name that is no parameter of any of some models."""
    models = list(models)
    known = {name for model in models for name in known_names(model)}
    for wrong in names:
        if wrong not in known:
            question, plugins = hint(wrong, known, ""), ", ".join(model.plugins[0] for model in models)
            raise FitError(f"{plugins}: there is no parameter {wrong}" + (f"; {question}" if question else "."))


def _combinations(
    declared: list[Parameter], words: Mapping[str, tuple[Any, ...]], fixed: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return all combinations of words, each with those of the choices that belong to its words."""
    combinations: list[dict[str, Any]] = choices(declared, words)
    for parameter in nested(declared):
        if parameter.implied_words:
            given = (word for word, own in parameter.words.items() if any(fixed.get(name) is not None for name in own))
            own = next(given, None)
            allowed = words[parameter.name] if own is None else (own,)
            combinations = [one | {parameter.name: word} for one in combinations for word in allowed]
    return combinations


def _unknowns_of(
    parameter: Parameter, fixed: Mapping[str, Any], freed: set[str], channels: int, anisotropic: bool
) -> Iterator[Unknown]:
    """Yield the unknowns of a parameter: none if it is given under any name, but the other one of a pair of which one
    is, and both of a pair for anisotropic data."""
    given, quantities = fixed.keys() & {*parameter.names}, parameter.quantities(pairs=anisotropic)
    if given:
        pair = parameter.quantities(pairs=True)
        halved = len(given) == 1 and given < {it.name for it in pair} and fixed[min(given)] is not None
        quantities = tuple(it for it in pair if halved and it.name not in given)
    for quantity in quantities:
        if (quantity.sought or quantity.name in freed) and (anisotropic or not quantity.turns):
            for channel in range(channels) if quantity.colour and channels > 1 else (None,):
                yield unknown_of(quantity, channel)
