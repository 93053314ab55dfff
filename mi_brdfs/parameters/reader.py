"""The properties that Mitsuba hands to a plugin, read with errors that say what is wrong and what would be right."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import mitsuba as mi
import numpy as np

from .messages import brief, interval, kind_of, listed, shown
from .vocabulary import hint

Range = tuple[float, float]
"""The lowest and the highest value that a parameter may have; the latter may be infinite."""

_SPECTRA = ("SRGBReflectanceSpectrum", "SRGBEmitterSpectrum", "RegularSpectrum", "IrregularSpectrum")


class ParameterError(ValueError):
    """A parameter that a plugin cannot accept. The message is one sentence that says what it would."""


class PropertyReader:
    """Reads the properties ``props`` of the plugin called ``plugin``.

    Its methods raise a :class:`ParameterError` that names plugin, parameter, value and remedy.
    """

    def __init__(self, plugin: str, props: mi.Properties):
        self.plugin, self.props = plugin, props
        self.constants: dict[str, list[float]] = {}
        """The colours read so far that are numbers or rgb, one or three channels, by property name."""

    def __contains__(self, name: str) -> bool:
        return name in self.props

    def error(self, name: str, problem: str) -> ParameterError:
        return ParameterError(f"{self.plugin}: {name} {problem}.")

    def take(self, known: list[str], shown: list[str]) -> None:
        """Mark the properties that are ``known`` as queried, and leave the others to Mitsuba, which refuses them after
        the constructor, or warns, as ``ParserConfig.unused_properties`` says. Its message shows their values, so give
        them one that says what would be right; it lists the names in ``shown``."""
        for name in self.props.keys():
            if name in known:
                self.props.mark_queried(name)
            else:
                self.props[name] = self._unknown(name, known, shown)

    def _unknown(self, name: str, known: list[str], shown: list[str]) -> str:
        if name.startswith("_arg_") and shown:
            return (
                f"{self.plugin}: {kind_of(self.props[name])} is nested without a name; "
                f"give it the name of the parameter it is meant for, {listed(shown)}."
            )
        if not known:
            return f"{self.plugin}: unknown parameter {brief(name)}; it has no parameters."
        question = hint(name, known, "")
        beginning = f"; {question} Known are" if question else "; known are"
        return f"{self.plugin}: unknown parameter {brief(name)}{beginning} {', '.join(shown)}."

    def number(self, name: str, default: float, limits: Range) -> mi.Texture:
        """Return the texture of a number."""
        allowed = f"a number in {interval(*limits)} or a texture"
        if name in self:
            value = self.props[name]
            if isinstance(value, mi.Texture):
                if value.class_name() in _SPECTRA:
                    raise self.error(name, f"is a colour; it must be {allowed}")
            else:
                self._check(name, [value], limits, allowed)
        return self.props.get_unbounded_texture(name, default)

    def colour(self, name: str, default: float, limits: Range) -> mi.Texture:
        """Return the texture of a colour."""
        allowed = f"a number, rgb or spectrum within {interval(*limits)} or a texture"
        values: list[Any] | None = [default]
        if name in self and (values := self.colour_values(name)) is not None:
            self._check(name, values, limits, allowed)
        spectral = name in self and self.props.type(name) == mi.Properties.Type.Spectrum
        if values is not None and not (spectral and len(values) > 1):
            self.constants[name] = values
        bounded = limits[1] <= 1
        return (self.props.get_texture if bounded else self.props.get_unbounded_texture)(name, default)

    def colour_values(self, name: str) -> list[Any] | None:
        """Return the values of a given number, rgb colour or spectrum, and None for a texture."""
        value, kind = self.props[name], self.props.type(name)
        if isinstance(value, mi.Texture):
            return None
        if kind == mi.Properties.Type.Spectrum:
            return list(value.values)
        return list(value) if kind == mi.Properties.Type.Color else [value]

    def _check(self, name: str, numbers: Iterable[Any], limits: Range, allowed: str) -> None:
        value = self.props[name]
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                raise self.error(name, f"= {shown(value)} is {kind_of(value)}; it must be {allowed}")
            at_limit = number in np.array(limits, np.float32).tolist()  # as colours are kept, which may be beyond it
            if not math.isfinite(number) or not (limits[0] <= number <= limits[1] or at_limit):
                raise self.error(name, f"= {shown(value)} is not allowed; it must be {allowed}")

    def choice(self, name: str, words: tuple[str, ...]) -> str:
        """Return the given one of several words, by default the first."""
        if name not in self:
            return words[0]
        value = self.props[name]
        if not isinstance(value, str) or value not in words:
            raise self.error(name, f"= {shown(value)} is unknown; it must be one of {listed(words, quote=True)}")
        return value

    def flag(self, name: str, default: bool) -> bool:
        return self._given(name, bool, "true or false") if name in self else default

    def text(self, name: str) -> str:
        return self._given(name, str, "a name")

    def _given(self, name: str, kind: type, allowed: str) -> Any:
        value = self.props[name]
        if not isinstance(value, kind):
            raise self.error(name, f"= {shown(value)} is {kind_of(value)}; it must be {allowed}")
        return value
