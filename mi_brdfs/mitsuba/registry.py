"""The registry of models, of the pack and of others, by name, and their registration in each variant."""

from __future__ import annotations

import functools
import importlib
import json
import pkgutil
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import mitsuba as mi

from .. import models
from ..integrators.shading import Shading
from ..microfacet.distributions import Distribution
from ..microfacet.fresnel import Fresnel
from ..microfacet.shadowing import Shadowing
from ..microfacet.terms import Term
from ..model import Energy, Model, Plugin, full_name
from ..models.microfacet import Microfacet
from ..parameters import published
from ..parameters.vocabulary import plugin_hint
from ..starting import signals_held
from ..tabulated.tabulated import Tabulated
from . import llvm
from .bsdf import ModelBSDF, variant_class
from .integrator import PixelCentreIntegrator

Registered = TypeVar("Registered", bound=type[Model] | type[Term])

MODELS: dict[str, type[Model]] = {}
DATA: dict[str, type[Model]] = {name: Tabulated for name in Tabulated.plugins}
"""The plugins that render data, which are BSDFs but no models: they have no formula, and need a file."""
INTEGRATORS: dict[str, type[Plugin]] = {name: Shading for name in Shading.plugins}
_variants: dict[str, dict[str, type[Plugin]]] = {}
"""The registered classes, by variant and name."""


# --- The models -----------------------------------------------------------------------------------------


def register(brought: Registered, *, replace: bool = False) -> Registered:
    """Register a model under its names, ``model.plugins``, in every variant, present and future, and for all commands
    and functions that take a name; or register a distribution, a shadowing or a Fresnel term for ``microfacet`` (a
    Fresnel term for all plugins with such parameters) under its ``word``. Also a decorator::

        @mi_brdfs.register
        class Lommel(mi_brdfs.Model):
            ...

    Registering an edited class again, as in a notebook, replaces the former one that has one of its names. BSDFs loaded
    before do not change.

    Args:
        brought: a subclass of :class:`mi_brdfs.Model`, or of :class:`mi_brdfs.microfacet.Distribution`, ``Shadowing``
            or ``Fresnel``.
        replace: take a name or word that belongs to Mitsuba or to another class.

    Returns:
        The class.

    Raises:
        TypeError: if it is not such a class.
        ValueError: if a name is taken or invalid, or a model has no docstring.
    """
    if isinstance(brought, type) and issubclass(brought, Model) and brought is not Model:
        _register_model(brought, replace)
    elif isinstance(brought, type) and issubclass(brought, (Distribution, Shadowing, Fresnel)):
        _register_term(brought, replace)
    else:
        raise TypeError(
            f"register takes a subclass of mi_brdfs.Model, or of a term of mi_brdfs.microfacet; {brought!r} is neither."
        )
    return brought


def _register_model(model: type[Model], replace: bool) -> None:
    if not (model.__doc__ or "").strip():
        raise ValueError(f"{model.__name__} has no docstring: write its manual page there, first a summary.")
    if not model.plugins:
        raise ValueError(f"{model.__name__} has no name: leave out plugins, or give it one.")
    for name in model.plugins:
        if not re.fullmatch(r"[A-Za-z]\w*", name):
            raise ValueError(f"{model.__name__}: {name!r} cannot be a plugin name; use letters, digits and _.")
        owner = _owner(name, model)
        if owner and not replace:
            raise ValueError(
                f'{model.__name__}: the name "{name}" belongs to {owner}; '
                'choose another one with plugins = ("…",), or register with replace=True.'
            )
    # Classes that a function makes have one name, and are told apart by their plugins.
    former = {it for it in MODELS.values() if full_name(it) == full_name(model) and {*it.plugins} & {*model.plugins}}
    for name in [name for name, other in MODELS.items() if other in former]:
        del MODELS[name]
    MODELS.update(dict.fromkeys(model.plugins, model))
    for variant in _variants:
        _register_in(variant)


KIT: dict[type[Term], Any] = {
    Distribution: Microfacet.distribution,
    Shadowing: Microfacet.shadowing,
    Fresnel: Microfacet.fresnel,
}
"""The parameters whose words are terms, by their kind."""


def _register_term(term: type[Term], replace: bool) -> None:
    name, word = term.__name__, term.word
    if not word or not re.fullmatch(r"[a-z][a-z0-9-]*", word):
        raise ValueError(f'{name}: word is {word!r}; it must be lower-case letters, digits and -, as in "student-t".')
    choice = next(choice for kind, choice in KIT.items() if issubclass(term, kind))
    owner = full_name(choice.terms[word]) if word in choice.terms else None
    if owner and owner != full_name(term) and not replace:
        owner = "mi_brdfs" if owner.startswith("mi_brdfs.") else owner
        raise ValueError(
            f'{name}: the word "{word}" belongs to {owner}; take another one, or register with replace=True.'
        )
    names = {each for it in term.parameters for each in (it, f"{it}_u", f"{it}_v")}
    implying = {it: other for other in choice.implied_words for it in choice.names_of(other)}
    if word not in choice.implied_words and (clash := next((it for it in implying if it in names), None)):
        raise ValueError(f'{name}: a parameter cannot be called {clash}, which means the word "{implying[clash]}".')
    for model in all_models():
        choosing = [it for it in model.declared() if getattr(it, "terms", None) is choice.terms]
        others = [it for it in model.declared() if it not in choosing] if choosing else []
        if clash := next((name for it in others for name in it.names if name in names), None):
            raise ValueError(f"{name}: a parameter cannot be called {clash}, a parameter of {model.plugins[0]}.")
    choice.add_term(term)


def brought_terms() -> dict[tuple[str, str], type[Term]]:
    """Return the terms registered by others, by the name of the choice and the word."""
    return {
        (choice.name, word): term
        for choice in KIT.values()
        for word, term in choice.terms.items()
        if not term.__module__.startswith("mi_brdfs.")
    }


def _owner(name: str, model: type[Model]) -> str | None:
    """Return the owner of a name, if it is not the model itself."""
    if name in MODELS:
        owner = full_name(MODELS[name])
        return None if owner == full_name(model) else owner
    return "Mitsuba" if name in _builtins() else "mi_brdfs" if name in DATA | INTEGRATORS else None


def models_in(module: ModuleType) -> list[type[Model]]:
    """Return the models that a module defines, in the order of their names."""
    return sorted(_defined(module, Model), key=lambda model: model.plugins)


def terms_in(module: ModuleType) -> list[type[Term]]:
    """Return the terms with a word of their own that a module defines."""
    return [term for term in _defined(module, Term) if vars(term).get("word")]


def _defined(module: ModuleType, kind: type) -> list[Any]:
    classes = [value for value in vars(module).values() if isinstance(value, type) and issubclass(value, kind)]
    return [value for value in classes if value.__module__ == module.__name__]


def is_own(model: type[Model]) -> bool:
    """Return whether a model belongs to the pack."""
    return model.__module__.startswith(f"{models.__name__}.")


ENERGY = Path(models.__file__).with_name("energy.json")
"""The largest albedos of the pack's models, which ``mi-brdfs energy --write`` measures."""


def _take_in_own() -> None:
    """Register the models of the files in ``mi_brdfs/models``."""
    stated = json.loads(ENERGY.read_text(encoding="utf-8"))
    for file in pkgutil.iter_modules(models.__path__):
        for model in models_in(importlib.import_module(f"{models.__name__}.{file.name}")):
            MODELS.update(dict.fromkeys(model.plugins, model))
            model.energy = Energy.of_json(stated[model.plugins[0]]) if model.plugins[0] in stated else None


_take_in_own()


def list_models() -> list[str]:
    """Return the names of all BSDF plugins, in alphabetical order, each followed by its aliases."""
    return [name for model in all_models() for name in model.plugins if MODELS.get(name) is model]


def plugin_names() -> set[str]:
    """Return the names of all plugins, of the pack, of third-party models, and of Mitsuba."""
    return {*_own_plugins(), *_builtins()}


def _own_plugins() -> dict[str, type[Plugin]]:
    """Return all plugins but Mitsuba's, by name."""
    return DATA | INTEGRATORS | MODELS


def all_models() -> list[type[Model]]:
    """Return the models in the same order, each once."""
    return sorted(set(MODELS.values()), key=lambda model: model.plugins)


def own_models() -> list[type[Model]]:
    """Return the pack's models, in the same order."""
    return [model for model in all_models() if is_own(model)]


def find_models(names: str | Iterable[str] | None) -> list[type[Model]]:
    """Return the models of one plugin name or some, each once, or all if there are none; raise as
    :func:`find_model`."""
    return list(dict.fromkeys(map(find_model, [names] if isinstance(names, str) else names or []))) or all_models()


def find_model(name: str) -> type[Model]:
    """Return the model of a plugin name, or raise a ValueError with the closest name there is."""
    return _find(name, MODELS)


def info(name: str) -> str:
    """Return the manual page of a plugin: formula and source, conventions, properties, and the table of its parameters;
    plain text, without the marks of reStructuredText about names.

    Raises:
        ValueError: if there is no such plugin, with the closest name there is.
    """
    from ..manual import plain  # on first use: it takes time

    return plain(find_plugin(name))


def find_plugin(name: str) -> type[Plugin]:
    """Return the class of a plugin name, of a model or not, or raise a ValueError with the closest name."""
    return _find(name, _own_plugins())


def presets(model: str | None = None) -> list[str]:
    """Return the names of the published materials, as in ``ngan/ward/blue-acrylic``: the paper, the model that was
    fitted, the material.

    Args:
        model: only those of this plugin, by type or alias.

    Raises:
        ValueError: if there is no such plugin; the message has the closest one.
    """
    return published.names(None if model is None else find_model(model).plugins[0])


def _find(name: str, plugins: dict) -> Any:
    if name not in plugins:
        raise ValueError(f"There is no model {name!r}; " + plugin_hint(str(name), plugins, "'"))
    return plugins[name]


# --- Registration in variants -------------------------------------------------------------------------------------


def install() -> None:
    """Register the plugins in the active variant, if there is one, and in every variant that becomes active."""
    _follow_variants()
    if mi.variant() is not None:
        _register_for(mi.variant())


@functools.cache  # Mitsuba may import a package of plugins anew after each change of variant
def _follow_variants() -> None:
    mi.detail.add_variant_callback(_on_variant)


def _on_variant(old: str | None, new: str | None) -> None:
    if new is None:
        return
    try:
        llvm.check(new)
    except ImportError:
        if old is not None:  # as where Mitsuba itself refuses a variant, which it does before it changes
            mi.set_variant(old)
        raise
    with signals_held():  # else half of the plugins would be registered
        _register_for(new)


def _register_for(active: str) -> None:
    # Mitsuba asks scalar_rgb for the kind of a plugin, whatever the active variant.
    for variant in {active, "scalar_rgb"}:
        _register_in(variant)


def _register_in(variant: str) -> None:
    """Register in a variant all classes whose current version is not registered there."""
    module = importlib.import_module(f"mitsuba.{variant}")
    known = _variants.setdefault(variant, {})
    for name, plugin in _own_plugins().items():
        if known.get(name) is plugin:
            continue
        if issubclass(plugin, Model):
            if name not in known and variant == mi.variant() and _is_foreign(name):
                warnings.warn(f'mi_brdfs replaces the BSDF "{name}", registered by another package.', stacklevel=2)
            module.register_bsdf(name, variant_class(plugin, ModelBSDF, module.BSDF))
        else:
            integrator = variant_class(plugin, PixelCentreIntegrator, module.SamplingIntegrator)
            module.register_integrator(name, integrator)
        known[name] = plugin


@functools.cache
def _builtins() -> frozenset[str]:
    """Return the names of Mitsuba's own plugins."""
    return frozenset(path.stem for path in (Path(mi.__file__).parent / "plugins").iterdir())


def _is_foreign(name: str) -> bool:
    """Return whether the active variant has a plugin of this name that is neither ours nor Mitsuba's own."""
    if name in _builtins():
        return False
    try:
        mi.PluginManager.instance().create_object(mi.Properties(name))
    except Exception as error:  # from the plugin manager, or from a plugin that needs parameters
        return "not found" not in str(error)
    return True
