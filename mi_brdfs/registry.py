"""From names to models: which plugins there are, and how they get into each variant."""

from __future__ import annotations

import difflib
import importlib
import pkgutil

import mitsuba as mi

from . import llvm, models
from .bsdf import bsdf_class
from .integrator import integrator_class
from .integrators.shading import Shading
from .model import Model, Plugin


def _discover() -> dict[str, type[Model]]:
    """The models of the files in ``mi_brdfs/models``, by plugin name and alias."""
    found = []
    for module_info in pkgutil.iter_modules(models.__path__):
        module = importlib.import_module(f"{models.__name__}.{module_info.name}")
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, Model) and value.__module__ == module.__name__:
                found.append(value)
    return {name: model for model in sorted(found, key=lambda model: model.plugins) for name in model.plugins}


MODELS = _discover()
INTEGRATORS: dict[str, type[Plugin]] = {name: Shading for name in Shading.plugins}
_registered: set[str] = set()


def list_models() -> list[str]:
    """The names of all BSDF plugins, in alphabetical order, each followed by its aliases."""
    return list(MODELS)


def all_models() -> list[type[Model]]:
    """The models in the same order, each once."""
    return list(dict.fromkeys(MODELS.values()))


def find_model(name: str) -> type[Model]:
    """The model of a plugin name.

    Raises:
        ValueError: if there is none, with the closest name there is.
    """
    return _find(name, MODELS)


def info(name: str) -> str:
    """The manual page of a plugin: formula and source, conventions, properties, and the table of its parameters.

    Raises:
        ValueError: if there is no such plugin, with the closest name there is.
    """
    return _find(name, MODELS | INTEGRATORS).manual()


def _find(name: str, plugins: dict):
    if name not in plugins:
        closest = difflib.get_close_matches(str(name), plugins, n=1, cutoff=0.0)[0]
        raise ValueError(f"There is no model {name!r}; did you mean {closest!r}?")
    return plugins[name]


def install():
    """Register the plugins in the active variant, if there is one, and in every variant that becomes active."""
    mi.detail.add_variant_callback(_on_variant)
    if mi.variant() is not None:
        _on_variant(None, mi.variant())


def _on_variant(old: str | None, new: str | None):
    if new is None:
        return
    llvm.warn_if_unsafe(new)
    # Mitsuba asks scalar_rgb what kind of plugin a name stands for, whatever the active variant.
    for variant in {new, "scalar_rgb"} - _registered:
        module = importlib.import_module(f"mitsuba.{variant}")
        for name, model in MODELS.items():
            module.register_bsdf(name, bsdf_class(model, module.BSDF))
        for name, physics in INTEGRATORS.items():
            module.register_integrator(name, integrator_class(physics, module.SamplingIntegrator))
        _registered.add(variant)
