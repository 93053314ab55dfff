"""The files that words, scenes and materials name, and those that these name, at any depth."""

from __future__ import annotations

import html
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache

LONGEST = 4096
"""No name of a file has as many letters."""


def identity(path: str | os.PathLike) -> object:
    """Return what is the same for all names of a file, also of links."""
    try:
        status = os.stat(path)
        return status.st_dev, status.st_ino
    except OSError:  # it is not there
        return os.path.normcase(os.path.realpath(path))


def mentioned(names: Iterable[str], texts: Iterable[str] = (), values: Mapping[str, str] | None = None) -> dict:
    """Return the paths of what is there, but for folders, by their identities: of some names, of what is named in these
    files and in some texts, and so on. Parameters have ``values``. What stands in quotes is taken for a name: that is
    more than Mitsuba reads, but no less, of any version and without an error."""
    known, found = dict(values or {}), dict[object, str]()
    folder_at = cache(lambda path: os.path.realpath(path) if os.path.isdir(path) else None)  # most are asked for often
    start = _start()
    todo = [*((text, start) for text in texts), *_new(names, start, found)]
    while todo:
        text, folders = todo.pop()
        inside = _named(text, known)
        inner = [it for name in inside for folder in folders if (it := folder_at(os.path.join(folder, name)))]
        todo += _new(inside, list(dict.fromkeys([*folders, *inner])), found)
    return found


def _new(names: Iterable[str], folders: list[str], found: dict[object, str]) -> Iterator[tuple[str, list[str]]]:
    """Add what these names are in some folders to what is found, and yield the texts of new ones, with the folders of
    what is named there."""
    scene = len(_start())
    for path in (path for name in names for path in _places(name, folders, scene)):
        if os.path.exists(path) and not os.path.isdir(path) and (it := identity(path)) not in found:
            found[it] = path
            if os.path.isfile(path) and (text := _text(path)):
                # What JSON names is looked for in the working folder.
                own = [os.curdir] if path.endswith(".json") else []
                yield text, list(dict.fromkeys([*folders, *own, os.path.dirname(path)]))


def _places(name: str, folders: list[str], scene: int) -> list[str]:
    """Return where a name may be: in some folders, but in the working one only if not in the scene's, which is asked
    first; ``scene`` is the index of that."""
    paths = [os.path.join(folder, name) for folder in folders]
    return paths[1:] if len(paths) > scene and os.path.exists(paths[scene]) else paths


def _start() -> list[str]:
    """Return the folders in which the names of a command are: the working one, and that of MERL's files."""
    return list(dict.fromkeys(["", os.environ.get("MI_BRDFS_MERL_DIR", "")]))


def _text(path: str) -> str:
    """Return the text of XML or JSON in the encodings that a parser may take it to have, without its comments; nothing
    of another file."""
    with suppress(OSError), open(path, "rb") as file:
        data = file.read(1 << 16)
        declared = re.search(rb"<\?xml[^>]+?encoding\s*=\s*[\"']([\w.-]+)", data)
        errors: dict[str, str] = {"utf-8": "surrogateescape", json.detect_encoding(data): "replace"}
        errors |= {declared[1].decode("ascii", "replace"): "replace"} if declared else {}
        texts = []
        for encoding, way in errors.items():
            with suppress(LookupError):
                if data.decode(encoding, way).lstrip("\ufeff \t\r\n").startswith("<") or path.endswith(".json"):
                    data += file.read()
                    start, *rest = data.decode(encoding, way).split("<!--")
                    texts.append(start + "".join(it.partition("-->")[2] for it in rest))
        return "\n".join(texts)
    return ""


def _named(text: str, values: dict[str, str]) -> set[str]:
    """Return what may be names in a text, with the values of parameters, to which its defaults are added."""
    default = r"<default[^<>]+>"
    for tag in re.findall(default, text):
        it = {key: value for key, _, value in re.findall(r"""(name|value)\s*=\s*(["'])(.*?)\2""", tag)}
        values.setdefault(it.get("name", ""), it.get("value", "")[:LONGEST])
    quoted = {it for _, it in re.findall(r"""[=:]\s*(["'])(.+?)\1""", re.sub(default, "", text), re.DOTALL)}
    names = {html.unescape(it) for it in quoted if len(it) < LONGEST and re.search(r"[^\d\s.,eE+-]", it)}
    for _ in range(2):  # a default may have another one in it
        names = {re.sub(r"\$\{?([^${}]+)(\}?)", lambda it: _filled(it, values), name) for name in names}
    return names | {name.replace("\\", "/") for name in names}


def _filled(reference: re.Match[str], values: Mapping[str, str]) -> str:
    """Return the value of the longest parameter that a reference begins with, as Mitsuba takes it, and what follows."""
    word, end = reference.groups()
    k = next((k for k in range(len(word), 0, -1) if word[:k] in values), 0)
    return values[word[:k]] + (word[k:] and word[k:] + end) if k else reference[0]
