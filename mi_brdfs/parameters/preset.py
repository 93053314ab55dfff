"""The parameter that names a published material."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import mitsuba as mi

from .messages import shown
from .parameter import Parameter, ParameterRow
from .published import closest, names, preset
from .reader import PropertyReader


class Preset(Parameter):
    """The name of a published material, whose values stand where no others are given."""

    def __init__(self) -> None:
        super().__init__("a published material, as mi-brdfs presets lists them; other parameters replace its values")

    def fill_in(self, reader: PropertyReader, declared: Iterable[Parameter]) -> None:
        """Give the properties the values of the named material: those of parameters that are not given, nor replaced
        by others that are."""
        if self.name not in reader:
            return
        values = self._values(reader)
        # The same word takes no place of another parameter.
        given = {name for name in reader.props.keys() if not self._is(reader.props[name], values.get(name))}
        for parameter in declared:
            for name in parameter.names:
                if name in values and name not in reader and given.isdisjoint(parameter.rivals(name)):
                    value = values[name]
                    reader.props[name] = mi.ScalarColor3d(value["value"]) if isinstance(value, dict) else value

    @staticmethod
    def _is(given: Any, value: Any) -> bool:
        return isinstance(given, str) and given == value

    def _values(self, reader: PropertyReader) -> dict:
        name, plugin = reader.text(self.name), reader.plugin
        wanted = f"it must be a material that `mi-brdfs presets --model {plugin}` lists"
        known = names()
        if name not in known:
            near = closest(name, names(plugin)) or closest(name, known)
            hint = f'did you mean "{near}"? {wanted[0].upper()}{wanted[1:]}' if near else wanted
            raise reader.error(self.name, f"= {shown(name)} is unknown; {hint}")
        values = preset(name)
        if values["type"] != plugin:
            raise reader.error(self.name, f"= {shown(name)} is a material of the plugin {values['type']}; {wanted}")
        return values

    def bind(self, reader: PropertyReader) -> Preset:
        return self.replace(chosen={self.name: reader.text(self.name)} if self.name in reader else {})

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> None:
        return None

    def placeholder(self) -> None:
        return None

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "string", "none", "see mi-brdfs presets", self.text)]
