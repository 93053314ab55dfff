"""What a worker does: it gets the variant, the threads and the models of the process that asks, and calls."""

from __future__ import annotations

import hashlib
import importlib
import os
import platform
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from .. import __version__
from ..mitsuba import guests
from ..mitsuba.errors import unwrapped_ctrl_c


class Failed(NamedTuple):
    """The result of a task that failed."""

    error: str


class Setup(NamedTuple):
    """What the process that asks has, and a worker needs."""

    variant: str | None
    threads: int | None
    guests: dict[str, str | None]
    """The sources of others' models (:func:`mi_brdfs.mitsuba.guests.sources`), with the text of files."""
    versions: dict[str, str]
    digests: dict[str, str]
    """Those of modules that are not installed, and so may change while they have the same version."""


_current: Setup | None = None
_loaded: dict[ModuleType, str] = {}
"""The digests of a worker's modules when it had loaded them: those of their files may be others now."""


def versions() -> dict[str, str]:
    """Return the versions on which results, or whether they can be had, depend."""
    return {
        "mi_brdfs": __version__, "Mitsuba": mi.__version__, "Dr.Jit": dr.__version__,
        "Python": ".".join(platform.python_version_tuple()[:2]),
    }  # fmt: skip


def setup(threads: int | None) -> Setup:
    """Return what this process has."""
    files = {
        each: Path(each).read_text(encoding="utf-8") if each.endswith(".py") else None for each in guests.sources()
    }
    return Setup(mi.variant(), threads, files, versions(), {it.__name__: digest for it, digest in digests().items()})


def digests() -> dict[ModuleType, str]:
    """Return the digests of the files of all loaded modules that are not installed, but for the script that runs."""
    found = {}
    for module, file in guests.loaded_sources().items():
        if module.__name__ != "__main__" and not guests.is_installed(file) and file.is_file():
            found[module] = hashlib.sha256(file.read_bytes()).hexdigest()
    return found


def call(function: Callable, arguments: tuple) -> Any:
    """Return what a function returns, or how it failed."""
    try:
        with unwrapped_ctrl_c():
            return function(*arguments)
    except Exception as error:
        while error.__cause__ is not None and isinstance(error.__cause__, Exception):
            error = error.__cause__
        return Failed(str(error) or type(error).__name__)


def call_as(common: tuple[Setup, tuple], module: str, name: str, arguments: tuple) -> Any:
    """Do the same in a worker, with a function's name.

    The preparation happens here, in the thread that runs the tasks, and not when a worker starts: so it also reaches
    workers that join late or are shared with others.
    """
    wanted, shared = common
    _prepare(wanted)
    return call(getattr(importlib.import_module(module), name), (*shared, *arguments))


def _prepare(wanted: Setup) -> None:
    global _current
    if wanted == _current:
        return
    from distributed import get_worker

    if text := problem(versions(), wanted.versions, get_worker().state.nthreads):
        raise RuntimeError(f"The worker at {get_worker().address} {text}.")
    if wanted.variant and wanted.variant != mi.variant():
        mi.set_variant(wanted.variant)
    for source, text in wanted.guests.items():
        guests.import_models(source if text is None else _file(source, text))
    for module, digest in digests().items():
        loaded = _loaded.setdefault(module, digest)
        if wanted.digests.get(module.__name__, loaded) != loaded:
            told = f"has loaded another {module.__name__} than this process: restart it, with the same files"
            raise RuntimeError(f"The worker at {get_worker().address} {told}.")
    if wanted.threads is not None:
        dr.set_thread_count(max(wanted.threads, 2))  # with one, Mitsuba waits forever for its bitmaps
    _current = wanted


def problem(found: dict[str, str], wanted: dict[str, str], nthreads: int) -> str | None:
    """Return what makes a worker unsuitable, if anything does."""
    for name, version in wanted.items():
        if found[name] != version:
            return f"has {name} {found[name]}, this process has {version}"
    if nthreads > 1:
        return f"runs {nthreads} tasks at a time, of which Mitsuba allows one: start it with --nthreads 1"
    return None


def _file(source: str, text: str) -> str:
    """Return the path of a file here, made if there is none with this text."""
    path = Path(source)
    if not (path.is_file() and path.read_text(encoding="utf-8") == text):
        folder = f"mi_brdfs-{hashlib.sha256(text.encode()).hexdigest()[:16]}-{os.getpid()}"
        path = Path(tempfile.gettempdir(), folder, path.name)
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return str(path)
