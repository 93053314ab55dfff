"""Numbers, choices, flags and files."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from ..math import clamp, in_lanes
from .colours import constant_texture
from .messages import interval, number_or_none, shown
from .parameter import Chosen, Parameter, ParameterRow, Quantity
from .reader import PropertyReader, Range


class Spelling(NamedTuple):
    """Another way to give a number: as ``name`` within ``limits``, of which it is ``scale`` times the value."""

    name: str
    limits: Range
    scale: float
    text: str


class Number(Parameter):
    """A scalar within ``limits``.

    An ``anisotropic`` one may be given as the pair NAME_u and NAME_v instead, and evaluates to a pair, of the same
    object twice where it was given alone; with ``lone_default``, one of the pair alone leaves the other at the default.
    Another one that makes a model anisotropic says what it is in isotropic materials, ``isotropic_as`` a parameter or
    "", its default. One with another ``spelling`` may be given as that instead. Without a default it is None where it
    is not given; it may mean nothing unless the parameter ``beside`` it is given. Fits leave one that is not ``sought``
    as it is, unless asked for it, and so do searches for the largest albedo.
    """

    def __init__(
        self,
        default: float | None,
        limits: Range,
        text: str,
        *,
        anisotropic: bool = False,
        lone_default: bool = False,
        isotropic_as: str | None = None,
        spelling: Spelling | None = None,
        role: str | None = None,
        sought: bool = True,
        beside: str | None = None,
    ):
        super().__init__(text)
        self.role, self.sought, self.beside = role, sought, beside
        self.default, self.limits, self.spelling = default, limits, spelling
        self.anisotropic, self.lone_default, self.isotropic_as = anisotropic, lone_default, isotropic_as
        self.scale = 1.0

    @property
    def pair(self) -> list[str]:
        """The two names for the tangent directions."""
        return [f"{self.name}_{axis}{self.number}" for axis in "uv"] if self.anisotropic else []

    @property
    def other(self) -> str:
        """The name of its other spelling."""
        return self.spelling.name + self.number if self.spelling else ""

    @property
    def names(self) -> list[str]:
        return [self.name + self.number, *self.pair, *([self.other] if self.spelling else [])]

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        like = self.isotropic_as and self.isotropic_as + self.number
        alone = Quantity(self.names[0], self.limits, self.default, self.text, sought=self.sought, isotropic_as=like)
        found: list[tuple[Quantity, ...]] = [(alone,)]
        if self.anisotropic:
            ways = zip(self.pair, ("along dp_du", "across"), strict=True)
            found.append(tuple(Quantity(name, self.limits, self.default, f"{self.text}, {way}") for name, way in ways))
        if self.spelling:
            default = None if self.default is None else self.default / self.spelling.scale
            found.append((Quantity(self.other, self.spelling.limits, default, self.spelling.text),))
        return found

    @property
    def tried(self) -> tuple[float, ...]:
        if self.default is None:
            return ()
        low, high = self.limits
        if high - low <= 10 and not 0 < low < 1e-2 * high:
            return tuple(low + (high - low) * k / 4 for k in range(5))
        about = (float(f"{self.default * 3.0**k:.1g}") for k in range(-2, 3))
        return tuple(dict.fromkeys(min(max(value, low), high) for value in about))

    def rivals(self, name: str) -> list[str]:
        return [other for other in self.names if other != name]

    def bind(self, reader: PropertyReader) -> Number:
        single, given = self.names[0], [name for name in self.pair if name in reader]
        if self.default is None and not any(name in reader for name in self.names):
            return self.replace()
        if self.beside and self.beside + self.number not in reader:
            raise reader.error(single, f"needs {self.beside}{self.number} beside it")
        if self.spelling and self.other in reader:
            if single in reader:
                raise reader.error(single, f"excludes {self.other}; give either {single} or {self.other}")
            return self._holding(reader, [self.other], self.spelling.limits, scale=self.spelling.scale)
        if given and single in reader:
            raise reader.error(single, f"excludes {given[0]}; give either {single} or {' and '.join(self.pair)}")
        if len(given) == 1 and not self.lone_default:
            missing = next(name for name in self.pair if name not in reader)
            raise reader.error(given[0], f"needs {missing} beside it; give both, or {single} alone")
        return self._holding(reader, self.pair if given else [single], self.limits)

    def _holding(self, reader: PropertyReader, names: list[str], limits: Range, **members: Any) -> Number:
        """Return a copy bound to the properties of these names."""
        textures = {name: reader.number(name, self.default or 0, limits) for name in names}
        return self.replace(textures=textures, ranges=dict.fromkeys(names, limits), **members)

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        if not self.textures:
            return None
        found = {name: texture.eval_1(si, active) for name, texture in self.textures.items()}
        values = [in_lanes(clamp(value, *self.ranges[name]), si.wi) for name, value in found.items()]
        if self.scale != 1:
            values = [value * self.scale for value in values]
        return (values[0], values[-1]) if self.anisotropic else values[0]

    def placeholder(self) -> Any:
        if not self.textures:
            return None
        value = mi.Float(self.default or 0)
        if not self.anisotropic:
            return value
        return (value, value + 0.0) if len(self.textures) == 2 else (value, value)  # also in scalar variants another

    def rows(self) -> list[ParameterRow]:
        single, range_ = self.names[0], interval(*self.limits)
        rows = [ParameterRow(single, "number", number_or_none(self.default), range_, self.text)]
        if self.anisotropic:
            lone = f"; one alone leaves the other at {number_or_none(self.default)}" if self.lone_default else ""
            text = f"instead of {single}: its values along dp_du and across{lone}"
            rows.append(ParameterRow(", ".join(self.pair), "number", "-", range_, text))
        if self.spelling:
            text = f"instead of {single}: {self.spelling.text}"
            rows.append(ParameterRow(self.other, "number", "-", interval(*self.spelling.limits), text))
        return rows


class Index(Number):
    """An index of refraction: a number, a texture or a substance that Mitsuba knows, by default ``substance``."""

    LIMITS = (0.01, 100)

    def __init__(self, substance: str, text: str, *, sought: bool = True):
        super().__init__(None, self.LIMITS, text, role="fresnel", sought=sought)
        self.substance = substance

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        return [(Quantity(self.name, self.limits, None, self.text, usual=(1, 3), sought=self.sought),)]

    def bind(self, reader: PropertyReader) -> Index:
        if self.name in reader and not isinstance(reader.props[self.name], str):
            texture = reader.number(self.name, 1, self.limits)
        else:
            texture = constant_texture(self._known(reader))
        return self.replace(textures={self.name: texture}, ranges={self.name: self.limits})

    def _known(self, reader: PropertyReader) -> float:
        try:
            return mi.lookup_ior(reader.props, self.name, self.substance)
        except RuntimeError as error:
            known = str(error).partition("choices are:")[2].strip()
            problem = f"= {shown(reader.props[self.name])} is unknown; it must be a number or one of {known}"
            raise reader.error(self.name, problem) from None

    def placeholder(self) -> mi.Float:
        return mi.Float(1)

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "number or name", self.substance, interval(*self.limits), self.text)]


class Rotation(Parameter):
    """An optional turn of the tangent frame, in which the lobes are evaluated. Evaluated, its (cosine, sine)."""

    def __init__(self) -> None:
        super().__init__("turn of the tangent frame, counter-clockwise about n from dp_du, in turns (1 is 360°)")

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        return [(Quantity(self.name, (-1e4, 1e4), None, self.text, turns=True, usual=(-0.5, 0.5)),)]

    def bind(self, reader: PropertyReader) -> Rotation:
        if self.name not in reader:
            return self.replace()
        return self.replace(textures={self.name: reader.number(self.name, 0, (-1e4, 1e4))})

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[mi.Float, mi.Float] | None:
        if not self.textures:
            return None
        turns = in_lanes(self.textures[self.name].eval_1(si, active), si.wi)
        sin, cos = dr.sincos(dr.two_pi * (turns - dr.round(turns)))  # whole turns would take the digits
        return cos, sin

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "number", "none", "any", self.text)]


class Choice(Chosen[str]):
    """One of several words, by default the first: an attribute of the model, or of its lobe in a :class:`PerLobe`."""

    def __init__(self, choices: tuple[str, ...], text: str):
        super().__init__(text)
        self.words = {word: {} for word in choices}

    @property
    def tried(self) -> tuple[str, ...]:
        return self.choices

    def bind(self, reader: PropertyReader) -> str:
        return reader.choice(self.names[0], self.choices)

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.names[0], "string", self.choices[0], " | ".join(self.choices), self.text)]


class Flag(Chosen[bool]):
    """True or false: an attribute like a :class:`Choice`."""

    def __init__(self, default: bool, text: str):
        super().__init__(text)
        self.default = default
        self.words = {False: {}, True: {}}

    @property
    def fit_words(self) -> tuple[bool, bool]:
        return self.default, not self.default

    def bind(self, reader: PropertyReader) -> bool:
        return reader.flag(self.names[0], self.default)

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.names[0], "boolean", str(self.default).lower(), "true | false", self.text)]


class File(Chosen[str]):
    """The name of a file, which must be given: a path, or a name relative to where Mitsuba looks for files. It becomes
    an attribute of the plugin, a resolved path in words."""

    def bind(self, reader: PropertyReader) -> str:
        if self.name not in reader:
            raise reader.error(self.name, f"is missing; give the path of {self.text}")
        name = reader.text(self.name)
        if not name:
            raise reader.error(self.name, f"is empty; give the path of {self.text}")
        return str(mi.file_resolver().resolve(name))

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "string", "must be given", "a file", self.text)]
