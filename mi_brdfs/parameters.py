"""Parameters: declared once per model, and from that parsed, checked, exposed and documented.

A model lists its parameters as class attributes. Each declaration knows the property names that it answers to, turns
a plugin's properties into a *slot*, and describes itself for the manual page:

    class Ward(Model):
        diffuse_reflectance = Reflectance(0.5, "albedo of the diffuse lobe")
        alpha               = Number(0.1, (1e-4, 1), "roughness", anisotropic=True)
        variant             = Choice(("balanced", "ward"), "normalization of the lobe")

Every number and colour becomes a Mitsuba texture, whatever it was given as: then a new value does not compile a new
kernel, can be optimised, and can vary over the surface. Literal values are checked against the declared range here;
textured and optimised ones are limited to it where they are evaluated.
"""

from __future__ import annotations

import copy
import difflib
import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

import drjit as dr
import mitsuba as mi

from .math import clamp
from .microfacet.fresnel import Conductor, Dielectric, Schlick, Unit

Range = tuple[float, float]


class ParameterError(ValueError):
    """A parameter that a plugin cannot accept; the message is one sentence that says what it would."""


class Row(NamedTuple):
    """A line of the parameter table on a manual page."""

    name: str
    type: str
    default: str
    range: str
    text: str


# --- What was given -------------------------------------------------------------------------------------------------


class Given:
    """The properties that a plugin was given, read with errors that name plugin, parameter, value and remedy."""

    def __init__(self, plugin: str, props: mi.Properties):
        self.plugin, self.props = plugin, props

    def __contains__(self, name: str) -> bool:
        return name in self.props

    def error(self, name: str, problem: str) -> ParameterError:
        return ParameterError(f"{self.plugin}: {name} {problem}.")

    def reject_unknown(self, known: list[str], shown: list[str]):
        """Raise if a property was given that is none of the ``known`` ones, of which messages list the ``shown``."""
        for name in self.props.keys():
            if name in known:
                continue
            if name.startswith("_arg_") and shown:
                raise ParameterError(
                    f"{self.plugin}: {_kind(self.props[name])} is nested without a name; "
                    f"give it the name of the parameter it is meant for, {listed(shown)}."
                )
            if not known:
                raise ParameterError(f"{self.plugin}: unknown parameter {brief(name)}; it has no parameters.")
            closest = difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]
            raise ParameterError(
                f"{self.plugin}: unknown parameter {brief(name)}; did you mean {closest}? Known are {', '.join(shown)}."
            )

    def number(self, name: str, default: float, limits: Range) -> mi.Texture:
        """The texture of a scalar parameter."""
        allowed = f"a number in {_interval(limits)} or a texture"
        if name in self:
            value = self.props[name]
            if isinstance(value, mi.Texture):
                if value.class_name() in _SPECTRA:
                    raise self.error(name, f"is a colour; it must be {allowed}")
            else:
                self._check(name, value, [value], limits, allowed)
        return self.props.get_unbounded_texture(name, default)

    def colour(self, name: str, default: float, limits: Range) -> mi.Texture:
        """The texture of a reflectance or another spectral parameter."""
        allowed = f"a number, rgb or spectrum within {_interval(limits)} or a texture"
        if name in self and (values := self.numbers(name)) is not None:
            self._check(name, self.props[name], values, limits, allowed)
        bounded = limits[1] <= 1
        return (self.props.get_texture if bounded else self.props.get_unbounded_texture)(name, default)

    def scaled_colour(self, name: str, default: float, limits: Range) -> dict[str, mi.Texture]:
        """The texture of a colour and, where that holds at most 1, another of what it is to be multiplied by: spectral
        variants upsample an rgb colour to a reflectance, which Mitsuba clips."""
        texture = self.colour(name, default, limits)
        if not mi.is_spectral or limits[1] <= 1 or name not in self:
            return {name: texture}
        if texture.class_name().startswith("BitmapTexture") and mi.traverse(texture)["data"].shape[2] == 3:
            warnings.warn(
                f"{self.plugin}: {name} is a bitmap of colours, of which Mitsuba's spectral variants clip to 1 what is "
                "larger; give a bitmap of one channel if it has such values.",
                stacklevel=2,
            )
        values = self.numbers(name)
        if self.props.type(name) != mi.Properties.Type.Color or max(values) <= 1:
            return {name: texture}
        scale = 2 * max(values)  # as for light: spectra of reflectances below a half are smooth
        return {name: _colour_of([value / scale for value in values]), _scale_of(name): _constant(scale)}

    def numbers(self, name: str) -> list | None:
        """What a colour was given as, or none of a texture."""
        value, kind = self.props[name], self.props.type(name)
        if isinstance(value, mi.Texture):
            return None
        if kind == mi.Properties.Type.Spectrum:
            return list(value.values)
        return list(value) if kind == mi.Properties.Type.Color else [value]

    def _check(self, name: str, value, numbers, limits: Range, allowed: str):
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                raise self.error(name, f"= {_shown(value)} is {_kind(value)}; it must be {allowed}")
            if not math.isfinite(number) or not limits[0] <= number <= limits[1]:
                raise self.error(name, f"= {_shown(value)} is not allowed; it must be {allowed}")

    def choice(self, name: str, choices: tuple[str, ...]) -> str:
        """One of several words; the first is the default."""
        if name not in self:
            return choices[0]
        value = self.props[name]
        if not isinstance(value, str) or value not in choices:
            raise self.error(name, f"= {_shown(value)} is unknown; it must be one of {listed(choices, quote=True)}")
        return value

    def flag(self, name: str, default: bool) -> bool:
        """True or false."""
        if name not in self:
            return default
        value = self.props[name]
        if not isinstance(value, bool):
            raise self.error(name, f"= {_shown(value)} is {_kind(value)}; it must be true or false")
        return value

    def text(self, name: str) -> str:
        value = self.props[name]
        if not isinstance(value, str):
            raise self.error(name, f"= {_shown(value)} is {_kind(value)}; it must be a name")
        return value


_SPECTRA = ("SRGBReflectanceSpectrum", "SRGBEmitterSpectrum", "RegularSpectrum", "IrregularSpectrum")


def _kind(value) -> str:
    """A word or two for what a value is."""
    if isinstance(value, bool):
        return "a boolean"
    if isinstance(value, str):
        return "a string"
    if isinstance(value, mi.Texture):
        return "a texture"
    if isinstance(value, mi.Object):
        return "a BSDF" if isinstance(value, mi.BSDF) else f"a {value.class_name()}"
    if isinstance(value, (int, float)):
        return "a number"
    kind = type(value).__name__
    return next((known for part, known in _KINDS.items() if part in kind), f"a {kind}")


_KINDS = {"Color": "a colour", "Spectrum": "a spectrum", "Array3": "a vector", "Transform": "a transform"}


def _shown(value) -> str:
    """A value as it appears in a message, on one line."""
    if isinstance(value, mi.Object):
        return value.class_name()
    if hasattr(value, "wavelengths"):
        shown = ", ".join(f"{number:g}" for number in value.values[:6])
        return f"[{shown}, …]" if len(value.values) > 6 else f"[{shown}]"
    shown = brief(f"{value:.6g}" if isinstance(value, float) else str(value))
    return f'"{shown}"' if isinstance(value, str) else shown


def brief(text: str) -> str:
    """A text of whoever wrote the scene, on one line, of moderate length and without what a terminal would obey."""
    text = "".join(character if character.isprintable() else "�" for character in " ".join(text.split()))
    return text if len(text) <= 80 else f"{text[:80]}…"


def _interval(limits: Range) -> str:
    low, high = limits
    return f"[{low:g}, {high:g}]" if math.isfinite(high) else f"[{low:g}, ∞)"


def _default(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def listed(words, last: str = "or", quote: bool = False) -> str:
    """Words as a sentence lists them."""
    words = [f'"{word}"' if quote else word for word in words]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


# --- Slots: parameters of one plugin instance -----------------------------------------------------------------------


@dataclass
class Slot:
    """A parameter of a plugin instance: its textures by property name, and how to evaluate them at a point."""

    textures: dict[str, Any] = field(default_factory=dict)
    anisotropic = False
    words: ClassVar[dict[str, str]] = {}
    """The choices among these parameters."""

    @property
    def ranges(self) -> dict[str, Range]:
        """What the values of its textures are limited to, by property name."""
        return {}

    def evaluate(self, si, active):
        raise NotImplementedError


class AbsentSlot(Slot):
    """A parameter without a default that was not given; evaluated, None."""

    def evaluate(self, si, active):
        return None


@dataclass
class NumberSlot(Slot):
    """One or two numbers; evaluated, times ``scale``, and a pair for the two tangent directions if the parameter is
    ``paired``."""

    limits: Range = (0, 1)
    paired: bool = False
    scale: float = 1

    @property
    def anisotropic(self) -> bool:
        return len(self.textures) == 2

    @property
    def ranges(self) -> dict[str, Range]:
        return dict.fromkeys(self.textures, self.limits)

    def evaluate(self, si, active):
        values = [clamp(texture.eval_1(si, active), *self.limits) for texture in self.textures.values()]
        if self.scale != 1:
            values = [value * self.scale for value in values]
        if self.paired:
            return values[0], values[-1]
        return values[0]


@dataclass
class ColourSlot(Slot):
    limits: Range = (0, 1)

    @property
    def ranges(self) -> dict[str, Range]:
        return {next(iter(self.textures)): self.limits}

    def evaluate(self, si, active):
        return clamp(evaluate_colour(self.textures, next(iter(self.textures)), si, active), *self.limits)


@dataclass
class FresnelSlot(Slot):
    """The Fresnel term of the parameters given; evaluated, a function of the cosine."""

    kind: str = "none"

    @property
    def ranges(self) -> dict[str, Range]:
        return {name: FresnelSet.RANGES[name] for name in FresnelSet.SETS.get(self.kind, ())}

    def evaluate(self, si, active):
        def colour(name):
            return clamp(evaluate_colour(self.textures, name, si, active), *FresnelSet.RANGES[name])

        def number(name):
            return clamp(self.textures[name].eval_1(si, active), *FresnelSet.RANGES[name])

        if self.kind == "conductor":
            return Conductor(colour("eta"), colour("k"))
        if self.kind == "schlick":
            return Schlick(colour("f0"))
        if self.kind == "dielectric":
            return Dielectric(number("int_ior") / number("ext_ior"))
        return Unit()


@dataclass
class LobesSlot(Slot):
    """The parameters of several lobes, as slots (or words) by declared name for each; evaluated, a list of their
    values."""

    lobes: list[dict[str, Slot | str | bool]] = field(default_factory=list)

    @property
    def anisotropic(self) -> bool:
        return any(slot.anisotropic for lobe in self.lobes for slot in slots_among(lobe.values()))

    @property
    def ranges(self) -> dict[str, Range]:
        return ranges_of(slot for lobe in self.lobes for slot in slots_among(lobe.values()))

    def evaluate(self, si, active):
        return [
            SimpleNamespace(**{name: _evaluated(own, si, active) for name, own in lobe.items()}) for lobe in self.lobes
        ]


@dataclass
class OneOfSlot(Slot):
    """A choice and the parameters that go with it, as slots (or words) by declared name; evaluated, a namespace of
    their values, and the chosen word as ``choice``."""

    name: str = ""
    choice: str = ""
    own: dict[str, Slot | str | bool] = field(default_factory=dict)

    @property
    def anisotropic(self) -> bool:
        return any(slot.anisotropic for slot in slots_among(self.own.values()))

    @property
    def ranges(self) -> dict[str, Range]:
        return ranges_of(slots_among(self.own.values()))

    @property
    def words(self) -> dict[str, str]:
        return {self.name: self.choice} | {name: word for name, word in self.own.items() if isinstance(word, str)}

    def evaluate(self, si, active):
        return SimpleNamespace(**{name: _evaluated(own, si, active) for name, own in self.own.items()})


class RotationSlot(Slot):
    """The turn of the tangent frame; evaluated, its (cosine, sine)."""

    anisotropic = True

    def evaluate(self, si, active):
        turns = self.textures["rotation"].eval_1(si, active)
        sin, cos = dr.sincos(dr.two_pi * (turns - dr.round(turns)))  # whole turns would take the digits
        return cos, sin


def textures_of(slots: Iterable[Slot]) -> dict[str, Any]:
    """The textures of several slots together, by property name."""
    return {name: texture for slot in slots for name, texture in slot.textures.items()}


def slots_among(bound: Iterable[Slot | str | bool]) -> list[Slot]:
    """The slots among what parameters were bound to: choices are words."""
    return [it for it in bound if isinstance(it, Slot)]


def _evaluated(bound: Slot | str | bool, si, active):
    return bound.evaluate(si, active) if isinstance(bound, Slot) else bound


def _placeholder(parameter: Parameter, bound: Slot | str | bool):
    return parameter.placeholder(bound) if isinstance(bound, Slot) else bound


def ranges_of(slots: Iterable[Slot]) -> dict[str, Range]:
    """What the textures of several slots are limited to, by property name."""
    return {name: limits for slot in slots for name, limits in slot.ranges.items()}


def evaluate_colour(textures: dict[str, Any], name: str, si, active):
    """The colour of a property, whether its texture has a scale beside it or not."""
    colour, scale = textures[name].eval(si, active), textures.get(_scale_of(name))
    return colour if scale is None else colour * scale.eval_1(si, active)


def _scale_of(name: str) -> str:
    """The name under which the scale of a colour appears beside it."""
    return f"{name}_scale"


# --- Declarations ---------------------------------------------------------------------------------------------------


class Parameter:
    """A declared parameter of a model. ``names`` lists the properties it answers to, the usual one first; ``shown``
    does so for people."""

    number = ""
    """What follows each of the names, if the parameter belongs to one of several lobes: "_1", "_2" …"""

    def __init__(self, text: str):
        self.text = text

    def __set_name__(self, owner, name):
        self.name = name

    @property
    def names(self) -> list[str]:
        return [self.name + self.number]

    @property
    def shown(self) -> list[str]:
        return self.names

    def numbered(self, number: str) -> Parameter:
        """The same declaration for one of several lobes."""
        parameter = copy.copy(self)
        parameter.number = number
        return parameter

    def bind(self, given: Given):
        """The slot (or, for a choice, the word) that the given properties make of this parameter."""
        raise NotImplementedError

    def placeholder(self, slot: Slot):
        """What the evaluated slot may look like, to build a model's lobes before there is a surface point."""
        raise NotImplementedError

    def rows(self) -> list[Row]:
        """What the manual page says of it."""
        raise NotImplementedError


class Spelling(NamedTuple):
    """Another way to give a number: as ``name`` within ``limits``, of which it is ``scale`` times the value."""

    name: str
    limits: Range
    scale: float
    text: str


class Number(Parameter):
    """A scalar within ``limits``. An ``anisotropic`` one may be given as the pair NAME_u and NAME_v instead, and
    evaluates to a pair; with ``lone_default``, one of the pair alone leaves the other at the default. One with another
    ``spelling`` may be given as that instead. Without a default it is None where it is not given."""

    def __init__(
        self,
        default: float | None,
        limits: Range,
        text: str,
        *,
        anisotropic=False,
        lone_default=False,
        spelling: Spelling | None = None,
    ):
        super().__init__(text)
        self.default, self.limits, self.spelling = default, limits, spelling
        self.anisotropic, self.lone_default = anisotropic, lone_default

    @property
    def pair(self) -> list[str]:
        return [f"{self.name}_{axis}{self.number}" for axis in "uv"] if self.anisotropic else []

    @property
    def names(self) -> list[str]:
        return [self.name + self.number, *self.pair, *([self.other] if self.spelling else [])]

    @property
    def other(self) -> str:
        return self.spelling.name + self.number

    def bind(self, given: Given) -> Slot:
        if self.default is None and not any(name in given for name in self.names):
            return AbsentSlot()
        if self.spelling and self.other in given:
            if self.names[0] in given:
                raise given.error(self.names[0], f"excludes {self.other}; give either {self.names[0]} or {self.other}")
            _, limits, scale, _ = self.spelling
            return NumberSlot({self.other: given.number(self.other, 0, limits)}, limits, scale=scale)
        single, names = self.names[0], [name for name in self.pair if name in given]
        if names and single in given:
            raise given.error(single, f"excludes {names[0]}; give either {single} or {' and '.join(self.pair)}")
        if len(names) == 1 and not self.lone_default:
            missing = next(name for name in self.pair if name not in given)
            raise given.error(names[0], f"needs {missing} beside it; give both, or {single} alone")
        textures = {
            name: given.number(name, self.default or 0, self.limits) for name in (self.pair if names else [single])
        }
        return NumberSlot(textures, self.limits, self.anisotropic)

    def placeholder(self, slot):
        if isinstance(slot, AbsentSlot):
            return None
        value = mi.Float(self.default or 0)
        return (value, value) if self.anisotropic else value

    def rows(self) -> list[Row]:
        rows = [Row(self.names[0], "number", _default(self.default), _interval(self.limits), self.text)]
        if self.anisotropic:
            lone = f"; one alone leaves the other at {self.default:g}" if self.lone_default else ""
            rows.append(
                Row(", ".join(self.pair), "number", "-", _interval(self.limits),
                    f"instead of {self.names[0]}: its values along dp_du and across{lone}")
            )  # fmt: skip
        if self.spelling:
            text = f"instead of {self.names[0]}: {self.spelling.text}"
            rows.append(Row(self.other, "number", "-", _interval(self.spelling.limits), text))
        return rows


class Colour(Parameter):
    """A spectral quantity within ``limits``. Without a default it is None where it is not given."""

    def __init__(self, default: float | None, limits: Range, text: str):
        super().__init__(text)
        self.default, self.limits = default, limits

    def bind(self, given: Given) -> Slot:
        (name,) = self.names
        if self.default is None and name not in given:
            return AbsentSlot()
        return ColourSlot(given.scaled_colour(name, self.default or 0, self.limits), self.limits)

    def placeholder(self, slot):
        return None if isinstance(slot, AbsentSlot) else mi.UnpolarizedSpectrum(self.default or 0)

    def rows(self) -> list[Row]:
        return [Row(self.names[0], "colour", _default(self.default), _interval(self.limits), self.text)]


class Reflectance(Colour):
    """A colour in [0, 1]."""

    def __init__(self, default: float | None, text: str):
        super().__init__(default, (0, 1), text)


class Choice(Parameter):
    """One of several words, the first by default."""

    def __init__(self, choices: tuple[str, ...], text: str):
        super().__init__(text)
        self.choices = choices

    def bind(self, given: Given) -> str:
        return given.choice(self.name + self.number, self.choices)

    def rows(self) -> list[Row]:
        return [Row(self.name + self.number, "string", self.choices[0], " | ".join(self.choices), self.text)]


class OneOf(Parameter):
    """One of several words, the first by default, each with parameters of its own. Evaluated, it has these as
    attributes, and the word as ``choice``."""

    def __init__(self, words: dict[str, dict[str, Parameter]], text: str):
        super().__init__(text)
        self.words = words
        for declared in words.values():
            for name, parameter in declared.items():
                parameter.__set_name__(None, name)

    @property
    def names(self) -> list[str]:
        own = [name for declared in self.words.values() for p in declared.values() for name in p.names]
        return list(dict.fromkeys([self.name, *own]))

    def bind(self, given: Given) -> OneOfSlot:
        choice = given.choice(self.name, tuple(self.words))
        declared = self.words[choice]
        allowed = [name for parameter in declared.values() for name in parameter.names]
        for name in self.names[1:]:
            if name in given and name not in allowed:
                has = f"has {listed(allowed, 'and')}" if allowed else "has no parameter"
                raise given.error(name, f'does not belong to {self.name} = "{choice}", which {has} of its own')
        own = {name: parameter.bind(given) for name, parameter in declared.items()}
        return OneOfSlot(textures_of(slots_among(own.values())), self.name, choice, own)

    def placeholder(self, slot):
        declared = self.words[slot.choice]
        return SimpleNamespace(**{name: _placeholder(declared[name], own) for name, own in slot.own.items()})

    def rows(self) -> list[Row]:
        rows = [Row(self.name, "string", next(iter(self.words)), " | ".join(self.words), self.text)]
        users: dict[Parameter, list[str]] = {}
        for word, declared in self.words.items():
            for parameter in declared.values():
                users.setdefault(parameter, []).append(word)
        for parameter, words in users.items():
            rows += [row._replace(text=f"with {listed(words, 'and')}: {row.text}") for row in parameter.rows()]
        return rows


class PerLobe(Parameter):
    """The parameters of one to ``most`` lobes of a kind: NAME_1, NAME_2 … Lobe i exists if any of its names is given.
    A single lobe may drop the number, and exists if nothing is given."""

    def __init__(self, most: int, **declared: Parameter):
        super().__init__("")
        self.declared = declared
        for name, parameter in declared.items():
            parameter.__set_name__(None, name)
        self.numbers = ["", *(f"_{i}" for i in range(1, most + 1))]

    def _lobe(self, number: str) -> list[Parameter]:
        return [parameter.numbered(number) for parameter in self.declared.values()]

    def _names(self, number: str) -> list[str]:
        return [name for parameter in self._lobe(number) for name in parameter.names]

    @property
    def names(self) -> list[str]:
        return [name for number in self.numbers for name in self._names(number)]

    @property
    def shown(self) -> list[str]:
        return self._names("_i")

    def bind(self, given: Given) -> LobesSlot:
        first = {number: next((n for n in self._names(number) if n in given), None) for number in self.numbers}
        numbers = [number for number in self.numbers if first[number]] or [""]
        if "" in numbers and len(numbers) > 1:
            raise given.error(first[""], f"excludes {first[numbers[1]]}; number the names of all lobes, or of none")
        for number, expected in zip(numbers, self.numbers[1:], strict=False):
            if number not in ("", expected):
                problem = f"leaves a gap; number the lobes from 1, so that this one is {expected[1:]}"
                raise given.error(first[number], problem)
        lobes = [{p.name: p.bind(given) for p in self._lobe(number)} for number in numbers]
        return LobesSlot(textures_of(slot for lobe in lobes for slot in slots_among(lobe.values())), lobes)

    def placeholder(self, slot):
        return [
            SimpleNamespace(**{name: _placeholder(p, lobe[name]) for name, p in self.declared.items()})
            for lobe in slot.lobes
        ]

    def rows(self) -> list[Row]:
        return [row for parameter in self._lobe("_i") for row in parameter.rows()]


class Flag(Parameter):
    """True or false."""

    def __init__(self, default: bool, text: str):
        super().__init__(text)
        self.default = default

    def bind(self, given: Given) -> bool:
        return given.flag(self.name + self.number, self.default)

    def rows(self) -> list[Row]:
        return [Row(self.name + self.number, "boolean", str(self.default).lower(), "true | false", self.text)]


class FresnelSet(Parameter):
    """The Fresnel term: of a conductor (eta and k, or a material's name), Schlick's (f0), of a dielectric (int_ior
    over ext_ior), or none (F = 1)."""

    INDEX, EXTINCTION = (0.01, 100), (0, 100)
    RANGES: ClassVar = {"eta": INDEX, "k": EXTINCTION, "f0": (0, 1), "int_ior": INDEX, "ext_ior": INDEX}
    SETS: ClassVar = {
        "conductor": ("eta", "k"),
        "material": ("material",),
        "schlick": ("f0",),
        "dielectric": ("int_ior", "ext_ior"),
    }

    def __init__(self):
        super().__init__("Fresnel reflectance")

    @property
    def names(self) -> list[str]:
        return [name for names in self.SETS.values() for name in names]

    def bind(self, given: Given) -> FresnelSlot:
        chosen = {kind: [n for n in names if n in given] for kind, names in self.SETS.items()}
        chosen = {kind: names for kind, names in chosen.items() if names}
        if len(chosen) > 1:
            first, second = (names[0] for names in list(chosen.values())[:2])
            raise given.error(
                first, f"excludes {second}; give one of eta and k, material, f0, int_ior and ext_ior, or none for F = 1"
            )
        if "conductor" in chosen:
            for name, other in (("eta", "k"), ("k", "eta")):
                if other not in given:
                    raise given.error(name, f"needs {other} beside it")
            textures = (given.scaled_colour(name, 0, self.RANGES[name]) for name in ("eta", "k"))
            return FresnelSlot({key: texture for each in textures for key, texture in each.items()}, "conductor")
        if "material" in chosen:
            return self._material(given)
        if "schlick" in chosen:
            return FresnelSlot({"f0": given.colour("f0", 0, (0, 1))}, "schlick")
        if "dielectric" in chosen:
            return FresnelSlot(
                {"int_ior": self._ior(given, "int_ior", "bk7"), "ext_ior": self._ior(given, "ext_ior", "air")},
                "dielectric",
            )
        return FresnelSlot()

    def _ior(self, given: Given, name: str, default: str) -> mi.Texture:
        """An index of refraction: a number, a texture, or the name of a substance that Mitsuba knows."""
        if name in given and not isinstance(given.props[name], str):
            return given.number(name, 1, self.INDEX)
        try:
            index = mi.lookup_ior(given.props, name, default)
        except RuntimeError as error:
            known = str(error).partition("choices are:")[2].strip()
            problem = f"= {_shown(given.props[name])} is unknown; it must be a number or one of {known}"
            raise given.error(name, problem) from None
        return _constant(index)

    def _material(self, given: Given) -> FresnelSlot:
        material = given.text("material")
        if material == "none":
            return FresnelSlot()
        folder = Path(mi.__file__).parent / "data" / "ior"
        known = sorted(path.name.removesuffix(".eta.spd") for path in folder.glob("*.eta.spd"))
        if material not in known:
            closest = difflib.get_close_matches(material, known, n=3, cutoff=0.0)
            raise given.error(
                "material",
                f"= {_shown(material)} is unknown; the closest of Mitsuba's {len(known)} conductors are "
                f'{listed(closest, quote=True)}, and "none" means F = 1',
            )
        return FresnelSlot({name: _measured(folder / f"{material}.{name}.spd") for name in ("eta", "k")}, "conductor")

    def placeholder(self, slot):
        return Unit()

    def rows(self) -> list[Row]:
        return [
            Row("eta, k", "colour", "-", f"{_interval(self.INDEX)}, {_interval(self.EXTINCTION)}",
                "complex index of refraction of a conductor, relative to the exterior"),
            Row("material", "string", "none", "Mitsuba's conductors | none", "a conductor by name; none means F = 1"),
            Row("f0", "colour", "-", "[0, 1]", "Schlick's approximation with this reflectance at normal incidence"),
            Row("int_ior, ext_ior", "number or name", "bk7, air", _interval(self.INDEX),
                "indices of refraction of a dielectric, inside and outside"),
        ]  # fmt: skip


class Rotation(Parameter):
    """An optional turn of the tangent frame."""

    def __init__(self):
        super().__init__("turn of the tangent frame, counter-clockwise about n from dp_du, in turns (1 is 360°)")

    def bind(self, given: Given) -> Slot:
        if self.name not in given:
            return AbsentSlot()
        return RotationSlot({self.name: given.number(self.name, 0, (-1e4, 1e4))})

    def placeholder(self, slot):
        return None

    def rows(self) -> list[Row]:
        return [Row(self.name, "number", "none", "any", self.text)]


def _constant(value: float) -> mi.Texture:
    props = mi.Properties()
    props["value"] = value
    return props.get_unbounded_texture("value")


def _measured(path: Path) -> mi.Texture:
    """The texture of a measured spectrum: as it is in spectral variants, as the rgb colour or luminance that Mitsuba's
    own conductors make of it in the others."""
    wavelengths, values = mi.spectrum_from_file(str(path))
    if mi.is_spectral:
        listed = {"wavelengths": wavelengths, "values": values}
        return mi.load_dict(
            {"type": "irregular"} | {name: ", ".join(map(repr, numbers)) for name, numbers in listed.items()}
        )
    return _colour_of(mi.spectrum_list_to_srgb(wavelengths, values, bounded=False, d65=False))


def _colour_of(rgb) -> mi.Texture:
    props = mi.Properties()
    props["value"] = mi.ScalarColor3d(rgb)
    return props.get_unbounded_texture("value")
