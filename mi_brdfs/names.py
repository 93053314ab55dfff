"""Names of files, as Mitsuba takes them."""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path


def check_name(path: str) -> None:
    """Raise a ValueError if Mitsuba cannot be given a path."""
    try:
        path.encode()
    except UnicodeEncodeError:
        raise ValueError(f"Mitsuba takes only names in UTF-8; rename {path}") from None


@cache
def linked(path: str) -> str:
    """Return a path that Mitsuba can be given: if need be, that of a link, which is there until the process ends."""
    try:
        check_name(path)
    except ValueError:
        link = Path(tempfile.mkdtemp(dir=_folder().name), Path(path).name.encode(errors="replace").decode())
        link.symlink_to(os.path.abspath(path))
        return str(link)
    return path


@cache
def _folder() -> tempfile.TemporaryDirectory:
    return tempfile.TemporaryDirectory(prefix="mi-brdfs-")


def tabulated(path: str) -> dict[str, str]:
    """Return the plugin dict of a measured file."""
    return {"type": "tabulated", "filename": linked(path)}
