"""What the command line can name for a check: plugins, XML, the materials of scene files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi

from .report import Report
from .runner import check, name_of


class Target(NamedTuple):
    """A BSDF by name, which any process can load."""

    name: str
    source: str
    """The type of a plugin, XML text, or the path of a scene."""
    material: int | None = None
    """Which of the scene's materials."""

    def load(self) -> dict[str, Any] | mi.BSDF:
        if self.source.endswith(".xml"):
            loaded = mi.load_file(self.source)
            return loaded if self.material is None else _materials(loaded)[self.material]
        return mi.load_string(_versioned(self.source)) if self.source.startswith("<") else {"type": self.source}

    def check(self, only: list[str] | None = None, **given) -> Report:
        """The report on it, in the active variant."""
        return check(self.load(), name=self.name, only=only, **given)


def find_targets(word: str) -> Iterator[Target]:
    """The BSDFs that a word stands for: the type of a plugin, a ``<bsdf …>`` as text, or the path of a scene, whose
    materials count once each.

    Raises:
        ValueError: if it stands for none.
        Exception: what Mitsuba raises where it cannot be loaded.
    """
    path = Path(word)
    if word.endswith(".xml") and not path.is_file():
        raise ValueError(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    target = Target(path.name if word.endswith(".xml") else word, word)
    loaded = target.load()
    loaded = mi.load_dict(loaded) if isinstance(loaded, dict) else loaded
    if isinstance(loaded, mi.Scene) and word.endswith(".xml"):
        names = [name_of(bsdf) for bsdf in _materials(loaded)]
        if not names:
            raise ValueError(f"{path}: the scene has no material")
        yield from (Target(f"{path.name}: {name}", word, k) for k, name in enumerate(names))
    elif isinstance(loaded, mi.BSDF):
        yield target._replace(name=name_of(loaded)) if word.startswith("<") else target
    else:
        raise ValueError(f"{target.name} is not a BSDF")


def _materials(scene: mi.Scene) -> list[mi.BSDF]:
    """Each material of a scene once."""
    found: list[mi.BSDF] = []
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        if bsdf is not None and not any(bsdf is other for other in found):
            found.append(bsdf)
    return found


def _versioned(text: str) -> str:
    """XML whose first element has a version, as Mitsuba demands."""
    head, _, rest = text.partition(">")
    return text if "version=" in head else f'{head.rstrip("/")} version="3.0.0"{"/" * head.endswith("/")}>{rest}'
