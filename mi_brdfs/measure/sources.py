"""BSDFs by the words that name them on the command line: plugins, XML, the materials of scene files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi


class BSDFSource(NamedTuple):
    """A BSDF by name, which any process can load."""

    name: str
    source: str
    """The type of a plugin, XML text, or the path of a scene."""
    material: int | None = None
    """Which of the scene's materials."""

    def load(self) -> dict[str, Any] | mi.BSDF:
        """Return the dict of a plugin that is given by its type, and else the BSDF, loaded in the active variant."""
        if self.source.endswith(".xml"):
            loaded = mi.load_file(self.source)
            return loaded if self.material is None else _materials(loaded)[self.material]
        return mi.load_string(_versioned(self.source)) if self.source.startswith("<") else {"type": self.source}


def find_sources(word: str) -> Iterator[BSDFSource]:
    """Yield the BSDFs that a word stands for: the type of a plugin, a ``<bsdf …>`` as text, or the path of a scene,
    whose materials count once each.

    Raises:
        ValueError: if it stands for none.
        Exception: what Mitsuba raises where it cannot be loaded.
    """
    path = Path(word)
    if word.endswith(".xml") and not path.is_file():
        raise ValueError(f"{path}: {'not a file' if path.exists() else 'no such file'}")
    source = BSDFSource(path.name if word.endswith(".xml") else word, word)
    loaded = source.load()
    loaded = mi.load_dict(loaded) if isinstance(loaded, dict) else loaded
    if isinstance(loaded, mi.Scene) and word.endswith(".xml"):
        names = [name_of(bsdf) for bsdf in _materials(loaded)]
        if not names:
            raise ValueError(f"{path}: the scene has no material")
        yield from (BSDFSource(f"{path.name}: {name}", word, k) for k, name in enumerate(names))
    elif isinstance(loaded, mi.BSDF):
        yield source._replace(name=name_of(loaded)) if word.startswith("<") else source
    else:
        raise ValueError(f"{source.name} is not a BSDF")


def name_of(bsdf: mi.BSDF) -> str:
    """Return the id of a BSDF, or the name of its class."""
    kind = type(bsdf).__name__
    return bsdf.id() or (bsdf.class_name() if kind == "BSDF" else kind)


def _materials(scene: mi.Scene) -> list[mi.BSDF]:
    """Return each material of a scene once."""
    found: list[mi.BSDF] = []
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        if bsdf is not None and not any(bsdf is other for other in found):
            found.append(bsdf)
    return found


def _versioned(text: str) -> str:
    """Return XML whose first element has a version, as Mitsuba demands."""
    head, _, rest = text.partition(">")
    return text if "version=" in head else f'{head.rstrip("/")} version="3.0.0"{"/" * head.endswith("/")}>{rest}'
