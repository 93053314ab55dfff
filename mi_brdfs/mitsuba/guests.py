"""Models that other packages and files bring."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import sys
import traceback
import warnings
from pathlib import Path
from types import ModuleType

from ..model import Model
from .registry import all_models, is_own, models_in, register

ENTRY_POINTS = "mi_brdfs.models"
"""The group of entry points by which installed packages bring models."""
_files: dict[str, str] = {}
"""The files that were imported by their paths, by the names of their modules."""


def register_installed() -> None:
    """Register what installed packages bring by entry points: a model each, or a module with models. One that fails is
    left out with a warning."""
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            brought = entry.load()
            for model in models_in(brought) if isinstance(brought, ModuleType) else [brought]:
                register(model)
        except Exception as error:
            package = f" of {entry.dist.name}" if entry.dist else ""
            warnings.warn(f"The model {entry.name}{package} is left out: {_sentence(error)}", stacklevel=2)


def import_models(target: str) -> None:
    """Import a file, ``FILE.py``, or a module by its dotted name, and register the models that it defines.

    Raises:
        ImportError: if it cannot be imported, or fails.
        ValueError: if it defines no models, or one that cannot be registered.
    """
    module = _file(Path(target)) if target.endswith(".py") else _module(target)
    found = models_in(module)
    if not found:
        raise ValueError("it defines no subclass of mi_brdfs.Model")
    for model in found:
        register(model)


def source(model: type[Model]) -> str | None:
    """What another process gives to :func:`import_models` to know a model: None if nothing does, as for one that was
    defined in a notebook or within a function."""
    module = sys.modules.get(model.__module__)
    if model.__module__ == "__main__" or module is None or model not in models_in(module):
        return None
    return _files.get(model.__module__, model.__module__)


def sources() -> list[str]:
    """The sources of all models that others have brought."""
    found = dict.fromkeys(source(model) for model in all_models() if not is_own(model))
    return [each for each in found if each]


def _file(path: Path) -> ModuleType:
    if not path.is_file():
        raise ImportError("no such file")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # as dataclasses and pickle look there
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ImportError(_sentence(error, path)) from None
    _files[path.stem] = str(path.resolve())
    return module


def _module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:
        raise ImportError(_sentence(error)) from None


def _sentence(error: Exception, path: Path | None = None) -> str:
    """What went wrong, and in which line of a file."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path and Path(frame.filename).resolve() == path.resolve()]
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {error.msg}"
    return (f"line {lines[-1]}: " if lines else "") + f"{type(error).__name__}: {error}"
