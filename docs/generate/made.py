"""Pages and pictures as files that are current or stale."""

from __future__ import annotations

import hashlib
import inspect
import io
import tokenize
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from PIL import Image

ROOT = Path(__file__).parents[2]
DIGESTS = ROOT / "docs" / "digests.txt"
"""The digest of each picture's sources."""


@dataclass(frozen=True)
class Page:
    """A text file generated from other sources."""

    path: Path
    text: Callable[[], str]
    """Its current text."""

    def is_stale(self) -> bool:
        return not self.path.is_file() or self.path.read_text(encoding="utf-8") != self.text()

    def make(self) -> None:
        self.path.write_text(self.text(), encoding="utf-8")


@dataclass(frozen=True)
class Picture:
    """A picture, or a notebook with its pictures, stale once its sources have changed. Sources exclude the code of
    models and integrators: tests render the pictures anew and compare."""

    path: Path
    sources: Callable[[], Iterable[str | bytes]]
    """What it is made from."""
    draw: Callable[[Path], None]
    """Draws it into a file."""

    def is_stale(self) -> bool:
        return not self.path.is_file() or read_digests().get(_name(self.path)) != self._digest()

    def make(self) -> None:
        self.draw(self.path)
        write_digests(read_digests() | {_name(self.path): self._digest()})

    def _digest(self) -> str:
        digest = hashlib.sha256()
        for source in self.sources():
            digest.update(hashlib.sha256(source.encode() if isinstance(source, str) else source).digest())
        return digest.hexdigest()[:16]


def saved(draw: Callable[[], Image.Image], quality: int = 88) -> Callable[[Path], None]:
    """Return a function that draws a picture into a file, a JPEG with some quality."""

    def save(path: Path) -> None:
        path.parent.mkdir(exist_ok=True)
        draw().save(path, quality=quality, optimize=True)

    return save


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def read_digests() -> dict[str, str]:
    """Return the digests of the sources by picture."""
    lines = DIGESTS.read_text(encoding="utf-8").splitlines() if DIGESTS.is_file() else []
    return {name: digest for digest, name in map(str.split, lines)}


def write_digests(digests: dict[str, str]) -> None:
    """Write the digests, except for pictures that no longer exist."""
    lines = [f"{digests[name]}  {name}\n" for name in sorted(digests) if (ROOT / name).is_file()]
    DIGESTS.write_text("".join(lines), encoding="utf-8")


def code(module: ModuleType) -> str:
    """Return the code of a module without comments, docstrings and blank space."""
    tokens = tokenize.generate_tokens(io.StringIO(inspect.getsource(module)).readline)
    return "".join(
        token.string
        for token in tokens
        if token.type != tokenize.COMMENT and not token.string.isspace() and not token.string.startswith('"""')
    )
