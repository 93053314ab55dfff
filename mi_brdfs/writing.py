"""Files that are written as a whole or not at all."""

from __future__ import annotations

import errno
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a name beside ``path``, with the same ending, for a file that replaces it once it is complete; after an
    error, ``path`` is as before. What is no regular file, such as ``/dev/stdout``, is written directly."""
    path = Path(path)
    if path.exists() and not path.is_file():
        yield path
        return
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "There is no folder", str(target.parent))
    part = target.with_name(f".{uuid.uuid4().hex}{target.suffix}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write a text in UTF-8, with escapes in place of the bytes of file names that are not."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")
