"""Models and terms from other packages and files."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import site
import sys
import traceback
import warnings
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import mitsuba as mi

from ..microfacet.terms import Term
from ..model import Model
from ..starting import Terminated
from .fastest import fastest
from .registry import all_models, brought_terms, is_own, models_in, register, terms_in

ENTRY_POINTS = "mi_brdfs.models"
"""The entry-point group for models of installed packages."""
_files: dict[str, str] = {}
"""The files imported by path, by module name."""
_imported: dict[str, bool] = {}
"""The modules that :func:`import_models` has imported, and whether they define BSDFs of Mitsuba's own kind."""


def register_installed() -> None:
    """Register the models and terms of the entry points of installed packages: each names a model, a term of the kit,
    or a module with some. One that fails is skipped with a warning."""
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            brought = entry.load()
            for each in _brought_by(brought) if isinstance(brought, ModuleType) else [brought]:
                register(each)
        except Exception as error:
            package = f" of {entry.dist.name}" if entry.dist else ""
            warnings.warn(f"The entry point {entry.name}{package} is skipped: {_sentence(error)}", stacklevel=2)


def import_models(target: str) -> None:
    """Import a file, ``FILE.py``, or a module by its dotted name, and register the models and the terms of the kit that
    it defines. Models of functions, and subclasses of ``mi.BSDF`` in the active variant, it registers itself; without a
    variant, the fastest is activated where the file needs it.

    Raises:
        ImportError: if it cannot be imported, or fails.
        ValueError: if it defines no model, term or BSDF, or one that cannot be registered.
    """
    path = Path(target) if target.endswith(".py") else None
    if path and not path.is_file():
        raise ImportError("no such file")

    known = all_models()

    def imported() -> ModuleType:
        return _of_file(path) if path else importlib.import_module(target)

    try:
        try:
            module = imported()
        except AttributeError:
            if mi.variant() or not (variant := fastest()):
                raise
            mi.set_variant(variant)
            module = imported()
    except (Terminated, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise ImportError(_sentence(error, path)) from None
    found = _brought_by(module)
    has_bsdfs = _defines_bsdf(module)
    if not (found or has_bsdfs) and all_models() == known:
        raise ValueError("it defines no subclass of mi_brdfs.Model or mi.BSDF, nor a term of the kit with a word")
    _imported[module.__name__] = has_bsdfs
    for each in found:
        register(each)


def _brought_by(module: ModuleType) -> list[type[Model] | type[Term]]:
    return [*terms_in(module), *models_in(module)]


def _defines_bsdf(module: ModuleType) -> bool:
    return mi.variant() is not None and any(
        isinstance(it, type) and issubclass(it, mi.BSDF) and it.__module__ == module.__name__
        for it in vars(module).values()
    )


def source(brought: type[Model] | type[Term]) -> str | None:
    """Return the argument of :func:`import_models` with which another process gets a model or a term; None if there is
    none, as for one defined in a notebook, or in a function of a module that was not imported so."""
    name, module = brought.__module__, sys.modules.get(brought.__module__)
    is_there = name in _imported or (module is not None and brought in _brought_by(module))
    return _files.get(name, name) if is_there and name != "__main__" else None


def sources() -> list[str]:
    """Return the sources of all models, terms and BSDFs registered by others."""
    brought: list[Any] = [*brought_terms().values(), *(model for model in all_models() if not is_own(model))]
    found = [*map(source, brought), *(_files.get(name, name) for name, has_bsdfs in _imported.items() if has_bsdfs)]
    return [each for each in dict.fromkeys(found) if each]


def loaded_sources() -> dict[ModuleType, Path]:
    """Return the files of all modules that are loaded from one in Python."""
    modules = [it for it in sys.modules.values() if isinstance(it, ModuleType)]
    return {it: file for it in modules if (file := Path(getattr(it, "__file__", None) or "")).suffix == ".py"}


def is_installed(*paths: Path) -> bool:
    """Return whether any of some paths is of what is installed, and so has a version."""
    folders = Path(os.__file__).parent, *map(Path, [*site.getsitepackages(), site.getusersitepackages()])
    return any(folder in path.parents for folder in folders for path in paths)


def _of_file(path: Path) -> ModuleType:
    name = path.stem if _is_free(path.stem, path) else f"{path.stem} ({path.resolve()})"
    spec: Any = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses and pickle look it up
    if (folder := str(path.parent.resolve())) not in sys.path:
        sys.path.append(folder)  # what it imports may be beside it
    try:
        exec(spec.loader.source_to_code(path.read_bytes(), str(path)), module.__dict__)  # caches miss quick edits
    except BaseException:
        del sys.modules[name]  # it may be imported again, in a variant
        raise
    _files[name] = str(path.resolve())
    return module


def _is_free(name: str, path: Path) -> bool:
    """Return whether no other file has the name of a module, loaded or not; one with models gives way to a file."""
    if name in _files:
        return _files[name] == str(path.resolve())
    if name in sys.modules:
        return bool(_brought_by(sys.modules[name]))
    with suppress(ImportError, ValueError):  # as of a name with dots
        spec = importlib.util.find_spec(name)
        return spec is None or spec.origin == str(path.resolve())
    return True


def _sentence(error: BaseException, path: Path | None = None) -> str:
    """Return what went wrong, and in which line of a file."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path and Path(frame.filename).resolve() == path.resolve()]
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {error.msg}"
    return (f"line {lines[-1]}: " if lines else "") + f"{type(error).__name__}: {error}"
