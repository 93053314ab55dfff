"""The parameter that names a file."""

from __future__ import annotations

import mitsuba as mi

from .parameter import Chosen, ParameterRow
from .reader import PropertyReader


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
