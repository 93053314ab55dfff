"""The BSDFs that a figure shows, and their labels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from ..given import load_described, sources_of
from ..measured import read
from ..mitsuba.registry import find_model, list_models
from ..parameters.messages import brief
from ..probe.bsdf import BSDFProbe
from ..probe.curves import Curve
from ..probe.sources import measured_file, name_of
from ..variants import is_measurable
from .style import CHANNELS, Place, plain


class Named(NamedTuple):
    """A BSDF and its name in the legend."""

    label: str
    probe: BSDFProbe


def named(bsdfs: Sequence[str | dict | mi.BSDF], labels: str | Sequence[object] | None) -> list[Named]:
    """Return the BSDFs loaded, with the labels given or found. Raise a ValueError if there are none, one is not a BSDF,
    or the active variant cannot evaluate arrays of directions."""
    if not is_measurable(mi.variant()):
        raise ValueError(
            f"plots need a vectorized and unpolarized variant, not {mi.variant() or 'none'}: call "
            'mi.set_variant("llvm_ad_rgb") first'
        )
    if not bsdfs:
        raise ValueError('there is no BSDF to plot; give one, such as {"type": "ward"}')
    found = [pair for given, label in zip(bsdfs, Legend(bsdfs).labels(), strict=True) for pair in _loaded(given, label)]
    if labels is not None:
        words = [labels] if isinstance(labels, str) else [str(label) for label in labels]
        if len(words) != len(found):
            raise ValueError(f"there are {len(found)} BSDFs, but {len(words)} labels")
        found = [(word, probe) for word, (_, probe) in zip(words, found, strict=True)]
    # Legends leave out labels that begin with an underscore.
    return [Named(plain(label.lstrip("_")), probe) for label, probe in found]


def check_azimuth(azimuth: float) -> None:
    """Raise a ValueError if an azimuth is no number of degrees."""
    if not math.isfinite(azimuth):
        raise ValueError(f"azimuth {azimuth}: give degrees")


def with_smooth_part(found: list[Named]) -> list[Named]:
    """Return the BSDFs, labelled if delta lobes are left out. Raise a ValueError if one has no other."""
    for it in found:
        if not it.probe.components:
            raise ValueError(f"{it.label} reflects and transmits in single directions only: there is no lobe to draw")
    return [it._replace(label=f"{it.label} without its delta lobe") if it.probe.deltas else it for it in found]


def by_channel(
    draw: Sequence[Sequence[Callable[[int | None], Curve]]], rgb: bool
) -> tuple[list[list[tuple[str, list[Curve]]]], bool, list[str]]:
    """Return the names and curves of the channels to draw of each BSDF, whether they have colours, and lines that say
    where red, green and blue are equal. The name is "" for the luminance, drawn if no colour is asked for or there is
    none, and "grey" for a grey among colours. Raise a ValueError if the active variant has no colours."""
    if rgb and not mi.is_rgb:
        raise ValueError(f"{mi.variant()} has no red, green and blue: rgb curves need an rgb variant")
    found = [_channels(own) for own in draw] if rgb else []
    grey = [len(own) == 1 for own in found]
    if all(grey):
        luminances = [[("", [each(None) for each in own])] for own in draw]
        return luminances, False, ["Red, green and blue are equal."] if rgb else []
    return found, True, ["Black: red, green and blue are equal."] if any(grey) else []


def _channels(draw: Sequence[Callable[[int | None], Curve]]) -> list[tuple[str, list[Curve]]]:
    found = [(name, [each(k) for each in draw]) for k, name in enumerate(CHANNELS)]
    pairs = [pair for _, curves in found[1:] for pair in zip(found[0][1], curves, strict=True)]
    alike = all(len(a.value) == len(b.value) and np.allclose(a.value, b.value, 1e-3, equal_nan=True) for a, b in pairs)
    return [("grey", found[0][1])] if alike else found


def quantity(name: str, unit: str = "1/sr", normalize: bool = False, rgb: bool = False) -> str:
    """Return the label of the quantity plotted, with its unit and how colours are reduced to it."""
    measured = f"{name} / maximum" if normalize else f"{name} [{unit}]" if unit else name
    return measured + (
        "" if rgb else ", luminance" if mi.is_rgb else ", mean of the spectrum" if mi.is_spectral else ""
    )


class Legend:
    """Plugins beside others: what each is called, and what is said of all. Dicts and words are plugins."""

    def __init__(self, bsdfs: Sequence[Any]) -> None:
        self.kinds = [_plugin(given) for given in bsdfs]
        self.given = [_parameters(given) if isinstance(given, dict) else None for given in bsdfs]
        first, *others = [given for given in self.given if given is not None] or [{}]
        self.stated = {name for given in (first, *others) for name in given}
        self.common = {name: it for name, it in first.items() if others and all(it == own.get(name) for own in others)}
        """What several dicts share."""
        self.own = [self._own(*pair) for pair in zip(self.kinds, self.given, strict=True)]
        """The parameters of each plugin that not all dicts share; they have their defaults where others are given."""
        kinds = set(self.kinds)
        self.only = self.kinds[0] if len(bsdfs) > 1 and len(kinds) == 1 and all(self.own) else ""
        """The plugin that several are, all told apart by their parameters."""

    def _own(self, kind: str, given: dict[str, str] | None) -> dict[str, str]:
        own = dict(given or {})
        declared = find_model(kind).declared() if kind in list_models() else []
        left_out = [it for it in declared if it.name in self.stated and not own.keys() & set(it.names)]
        own |= {it.name: it.rows()[0].default for it in left_out}
        return {name: value for name, value in own.items() if name not in self.common}

    def labels(self) -> list[str]:
        """Return a label for each plugin: the type, unless it is that of all, and the parameters that distinguish it;
        an empty text for what is none."""
        return [kind and _told("" if self.only else kind, own) for kind, own in zip(self.kinds, self.own, strict=True)]

    def constants(self) -> list[str]:
        """Return lines with what all dicts have in common, if anything, and what models have otherwise by default:
        their labels tell the rest."""
        given = list(zip(self.kinds, self.given, strict=True))
        dicts = dict.fromkeys(kind for kind, own in given if own is not None)
        who = self.only or ("all" if None not in self.given else ", ".join(dicts))
        told = {kind for kind, own in given if own}
        bare = [kind for kind in dict.fromkeys(self.kinds) if kind and kind not in told and len(given) > 1]
        if self.common:  # a colour stays on its line
            lines = [_told(f"{who} with", self.common).replace(", ", ",\N{NO-BREAK SPACE}")]
        else:
            lines = [self.only] if self.only else []
        whose = f"{', '.join(bare)} with " if len(bare) < len({*self.kinds}) else ""
        lines += [f"{whose}default parameters"] if bare else []
        return lines + [_told(f"{kind} by default:", own) for kind, own in self._differing_defaults().items() if own]

    def _differing_defaults(self) -> dict[str, dict[str, str]]:
        """Return the defaults of each of a few models that another has otherwise, of parameters that none is given."""
        kinds = [kind for kind in dict.fromkeys(self.kinds) if kind in list_models()]
        if "preset" in self.stated or len(kinds) > 4:  # it gives others; and of many, lines would be more than curves
            return {}
        found = {
            kind: {it.name: it.rows()[0].default for it in find_model(kind).declared() if not self.stated & {*it.names}}
            for kind in kinds
        }
        differing = {
            name
            for own in found.values()
            for name in own
            if any(it.get(name, own[name]) != own[name] for it in found.values())
        }
        return {kind: {name: it for name, it in own.items() if name in differing} for kind, own in found.items()}


def places(bsdfs: Sequence[Any], count: int) -> list[Place]:
    """Return the places of so many curves: on a ramp, if these are dicts of one plugin, of which one number alone
    increases or decreases; a hue for each plugin, if several have one parameter alone varied; else a hue for each."""
    groups: dict[Any, list[int]] = {}
    for k, given in enumerate(bsdfs):
        groups.setdefault(_plugin(given) or k, []).append(k)
    varied = [_varied([bsdfs[k] for k in group]) for group in groups.values() if len(group) > 1]
    alone = len(groups) == 1
    if len(bsdfs) < count or not varied or not all(varied) or (alone and not _is_ordered(varied[0])):
        return [Place(k) for k in range(count)]
    numbered = enumerate(groups.values())
    ramps = {k: Place(None if alone else hue, at, len(group)) for hue, group in numbered for at, k in enumerate(group)}
    return [ramps[k] for k in range(count)]


def _varied(bsdfs: Sequence[Any]) -> list[Any]:
    """Return the values of the only parameter in which dicts of one plugin differ; none if there are more."""
    dicts = [given if isinstance(given, dict) else {"type": given} for given in bsdfs]
    varied = {name: [given.get(name) for given in dicts] for given in dicts for name in given}
    varied = {name: values for name, values in varied.items() if any(value != values[0] for value in values)}
    return next(iter(varied.values())) if len(varied) == 1 else []


def _is_ordered(values: list[Any]) -> bool:
    """Return whether these are at least three numbers that increase or decrease."""
    numbers = [value for value in values if type(value) in (int, float)]
    return len(numbers) == len(values) > 2 and numbers in (sorted(numbers), sorted(numbers, reverse=True))


def _parameters(given: dict) -> dict[str, str]:
    shown = given | ({"filename": Path(given["filename"]).name} if "filename" in given else {})
    return {name: _shown(value) for name, value in shown.items() if name != "type"}


def _told(word: str, parameters: dict[str, str]) -> str:
    return " ".join(filter(None, [word, *(f"{name}={value}" for name, value in parameters.items())]))


def _loaded(given: Any, label: str) -> Iterator[tuple[str, BSDFProbe]]:
    """Yield what a user gave, loaded, with its label or name: for a measured file, its title."""
    given = str(given) if isinstance(given, Path) else given
    found = ((it.name, it.load()) for it in sources_of(given)) if isinstance(given, str) else [("", given)]
    for name, loaded in found:
        file = measured_file(loaded) if isinstance(loaded, dict) else None
        measurement = read(*file) if file else None
        probe = BSDFProbe(load_described(loaded), data=measurement.data if measurement else None)
        name = name.replace(measurement.path.name, measurement.title) if measurement else name
        yield label or name or name_of(probe.bsdf), probe


def _plugin(given: Any) -> str:
    """Return the type of a dict, the word of a plugin, or an empty text for anything else."""
    if isinstance(given, dict):
        return str(given.get("type"))
    return given if isinstance(given, str) and given.isidentifier() else ""


def _shown(value: Any) -> str:
    """Return a parameter's value in a label."""
    if isinstance(value, dict):
        value = value.get("value", value.get("type"))
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:.4g}"
    if isinstance(value, str):
        return brief(value)
    try:
        return ", ".join(f"{number:.3g}" for number in value)
    except TypeError:
        return type(value).__name__
