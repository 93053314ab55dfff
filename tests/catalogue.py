"""The configurations that the tests run on. Each plugin has a file in ``rows`` beside this one, with

* ``ROWS``: configurations with their reference; every test of values and sampling runs on each of them,
* ``EXTREME``: more of them, at the limits of float32, for the tests of values,
* ``SMOOTH``: plugin dicts by name, with every continuous parameter of the model well inside its range, for the tests
  of gradients and of resources.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from reference import rotate


@dataclass(frozen=True)
class Row:
    """A configuration, whose name begins with the plugin's and says what it is."""

    name: str
    bsdf: dict
    reference: Callable
    """f cosθ_o for arrays ``wi`` and ``wo``, from the independent float64 reference."""
    sharp: bool = False
    """Narrower than the usual resolution of a chi² test."""
    transmits: bool = False
    """Lets light through from behind, too."""

    def __str__(self):
        return self.name


BOTH = {"diffuse_reflectance": 0.4, "specular_reflectance": 0.5}
"""Two lobes of about the same energy."""


def rows_of(plugin, model, pair="", **defaults):
    """What makes the rows of a plugin whose reference has the same parameters: this gets what the plugin is given, or
    else these defaults, of which the plugin gets the words, too. Of a ``pair`` of numbers, such as ``alpha``, one alone
    is both."""
    words = {name: value for name, value in defaults.items() if isinstance(value, str)}

    def row(name, sharp=False, **given):
        values = defaults | given
        turns = values.pop("rotation", 0)
        if pair:
            both = values.pop(pair)
            values = {f"{pair}_u": both, f"{pair}_v": both, **values}

        def reference(wi, wo):
            return model(rotate(wi, turns), rotate(wo, turns), **values)

        transmits = values.get("domain") == "sphere"
        return Row(f"{plugin} {name}", {"type": plugin, **words, **given}, reference, sharp, transmits)

    return row


_files = [
    importlib.import_module(f"rows.{path.stem}") for path in sorted((Path(__file__).parent / "rows").glob("[a-z]*.py"))
]


def first_of_each(names):
    """The first name or row of each plugin, by plugin."""
    return {str(name).split()[0]: name for name in reversed(names)}


ROWS = [row for file in _files for row in file.ROWS]
FIRST_ROWS = first_of_each(ROWS)
"""One of each plugin."""


def options(row):
    """The plugin and its choices of a row."""
    return tuple(value for value in row.bsdf.values() if isinstance(value, (str, bool)))


REPRESENTATIVES = {options(row): row for row in sorted(ROWS, key=lambda row: len(row.bsdf)) if not row.sharp}.values()
"""Of each model and its choices the row with the most parameters, among those that are not sharp."""
EXTREME = [row for file in _files for row in getattr(file, "EXTREME", [])]
SMOOTH = {name: bsdf for file in _files for name, bsdf in file.SMOOTH.items()}


def mostly_slow(names, plugins=None):
    """The names or rows as parameters of a test that takes its time: but for the first of each plugin, or of some, they
    are slow."""
    names = list(names)
    first = [name for plugin, name in first_of_each(names).items() if plugin in (plugins or FIRST_ROWS)]
    return [pytest.param(name, id=str(name), marks=[] if name in first else pytest.mark.slow) for name in names]


OTHER_VARIANTS = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in ("llvm_ad_spectral", "llvm_ad_mono_polarized", "scalar_rgb", "scalar_spectral")
]
"""One of each kind, except the one that users have most."""
