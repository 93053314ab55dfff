"""The files that a command reads and those that it writes: none is both, and what is written has a file of its own."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

from ..mentioned import identity, mentioned
from ..parameters.messages import listed
from .terminal import Exit, fail

OUTPUTS = {"title", "labels"}
"""The names of the arguments that name no files to be read: those of files to be written, and free texts."""

_written: dict[object, tuple[str, Path]] = {}
_words: list[str] = []
"""Those of the command line that may name files."""


def begin() -> None:
    """Forget the files of the command before."""
    _written.clear()
    _words.clear()
    _files_read.cache_clear()


def check_output(option: str, file: Path | None, endings: Sequence[str] = (), mark: str = "") -> None:
    """Fail if a file cannot be written, its name has none of some endings, it is there without a mark that all such
    results have, the command reads it, or writes it for another option, too."""
    if file is None:
        return
    if endings and file.suffix.lower() not in endings and file.parent != Path("/dev"):
        fail(f"{option} {file}: write a {listed(endings)}", Exit.USAGE)
    if not file.absolute().parent.is_dir():
        fail(f"{option} {file}: there is no folder {file.parent}", Exit.USAGE)
    if file.is_dir():
        fail(f"{option} {file}: it is a folder", Exit.USAGE)
    try:
        if file.is_file():
            file.open("ab").close()
        if file.is_file() or not file.exists():
            tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(file))).close()
        if mark and file.is_file() and mark not in file.read_text(encoding="utf-8", errors="replace"):
            fail(f"{option}: {file} is there, and no such result; name another folder", Exit.USAGE)
    except OSError as error:
        fail(f"{option} {file}: it cannot be written: {error.strerror}", Exit.USAGE)
    if file.is_file() or not file.exists():  # no device
        other = _written.setdefault(identity(file), (option, file))
        if other != (option, file):
            fail(f"{option} {file}: {other[0]} {other[1]} is the same file; give each its own", Exit.USAGE)
        _refuse_to_overwrite(option, file)


def check_inputs(arguments: Mapping[str, object]) -> None:
    """Fail if one of the files to be written is one that the arguments of the command name, or a scene or a material
    among these."""
    given = [value for name, value in arguments.items() if name not in OUTPUTS]
    words = [it for value in given for it in (value if isinstance(value, list) else [value])]
    _words.extend(os.path.join(".", it) if isinstance(it, Path) else it for it in words if isinstance(it, (str, Path)))
    _files_read.cache_clear()
    for option, file in _written.values():
        _refuse_to_overwrite(option, file)


def _refuse_to_overwrite(option: str, file: Path) -> None:
    if file.is_file() and (path := _files_read().get(identity(file))):
        same = "" if os.path.abspath(path) == os.path.abspath(file) else f" as {os.path.normpath(path)}"
        fail(f"{option} {file}: the command reads this file{same}; write to another one", Exit.USAGE)


@cache
def _files_read() -> dict[object, str]:
    """Return the files that the words name, and those that are named in these, at any depth."""
    names: list[str] = []
    for word in _words:
        module = getattr(sys.modules.get(word), "__file__", None)
        names += [module] if module else [it for it in _names(word) if re.search(r"[./\\]", it)]  # others are plugins
    values = dict(pair for word in _words for pair in re.findall(r"(\w+)=([^,]*)", word))
    return mentioned(names, [word for word in _words if word.startswith("<")], values)


def _names(word: str) -> Iterator[str]:
    """Yield what of a word may be the name of a file: all of it, what stands before a material or a parameter, and the
    values of parameters."""
    for text in (word, word.partition("=")[2]):
        yield from (text, re.split(r"(?<=\.xml):|(?<=\.json):|:(?=[A-Za-z_]\w*=)", text)[0])
    for value in re.findall(r"\w=(.*?)(?=,\w+=|$)", word, re.DOTALL):
        yield from (value, *value.split(","))
