"""The parameters of a Fresnel term."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import mitsuba as mi

from ..math import clamp, in_lanes
from .colours import rgb_texture
from .groups import OneTerm
from .messages import listed, shown
from .parameter import Parameter, ParameterRow
from .reader import PropertyReader, Range
from .vocabulary import hint


class FresnelSet(OneTerm):
    """The Fresnel term: of a conductor (eta and k, or a material's name), Schlick's (f0), of a dielectric (int_ior
    over ext_ior), or none (F = 1), as the given parameters imply; or another one by its word. Evaluated, a function of
    the cosine."""

    words: dict[str, Mapping[str, Parameter]] = {}
    terms: dict[str, Any] = {}
    """The term of each word: those of :mod:`mi_brdfs.microfacet.fresnel`, and of others. All models have the same."""
    implied_words = ("conductor", "material", "schlick", "dielectric", "none")

    def __init__(self) -> None:
        Parameter.__init__(self, "another Fresnel term")

    @property
    def fit_words(self) -> tuple[str, ...]:
        # Schlick's colour can be every reflectance at normal incidence.
        return ("schlick", "dielectric", "conductor", "none", *self.brought)

    @property
    def names(self) -> list[str]:
        own = [name for word in self.words for name in self.names_of(word)]
        return [*own, *([self.name] if self.brought else [])]

    def rivals(self, name: str) -> list[str]:
        own = [self.name]
        for word in self.words:
            if name in (names := self.names_of(word)):
                own = names if word in self.implied_words else [self.name, *names]
        return [other for other in self.names if other not in own]

    def _word(self, reader: PropertyReader) -> str:
        """Return the word that the given parameters imply, or that is given."""
        given = {word: [name for name in self.names_of(word) if name in reader] for word in self.words}
        chosen = [word for word in self.implied_words if given[word]]
        other = next((name for word in self.brought for name in (self.name, *given[word]) if name in reader), None)
        if other:
            if chosen:
                raise reader.error(other, f"excludes {given[chosen[0]][0]}; give one Fresnel term")
            if self.name not in reader:
                words = listed(self.brought, quote=True)
                raise reader.error(other, f"needs {self.name} beside it, which is {words}")
            return self._given(reader, self.brought)
        if len(chosen) > 1:
            first, second = (given[word][0] for word in chosen[:2])
            raise reader.error(
                first, f"excludes {second}; give one of eta and k, material, f0, int_ior and ext_ior, or none for F = 1"
            )
        for needed in self.terms[chosen[0]].needed if chosen else ():
            if needed not in reader:
                raise reader.error(given[chosen[0]][0], f"needs {needed} beside it")
        return chosen[0] if chosen else "none"

    def _made_of(self, values: dict[str, Any]) -> Any:
        return self.terms[self.word].of_values(values)

    def rows(self) -> list[ParameterRow]:
        own = [row for word in self.implied_words for it in self.words[word].values() for row in it.rows()]
        return [*own, *(self._rows(self.brought, "none") if self.brought else [])]


class ConductorName(Parameter):
    """The indices of a conductor of Mitsuba's, by name, or "none" for no Fresnel term. Evaluated, η and k, or None."""

    role = "fresnel"

    def __init__(self, limits: Mapping[str, Range], text: str):
        super().__init__(text)
        self.limits = limits

    @property
    def choices(self) -> tuple[str, ...]:
        return ("none", *conductors())

    def bind(self, reader: PropertyReader) -> ConductorName:
        material = reader.text(self.name)
        if material == "none":
            return self.replace()
        known = conductors()
        if material not in known:
            question = hint(material, known)
            beginning = f"; {question} It" if question else "; it"
            # Of two measurements of a material, as Cu and Cu_palik, the first.
            first = [it for it in known if not (it.endswith("_palik") and it.removesuffix("_palik") in known)]
            raise reader.error(
                self.name,
                f'= {shown(material)} is unknown{beginning} must be "none", for F = 1, or one of Mitsuba\'s conductors '
                + ", ".join(first),
            )
        textures = {name: _measured(indices() / f"{material}.{name}.spd") for name in self.limits}
        return self.replace(textures=textures, ranges=dict(self.limits))

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[Any, ...] | None:
        found = {name: it.eval(si, active) for name, it in self.textures.items()}
        return tuple(in_lanes(clamp(it, *self.ranges[name]), si.wi) for name, it in found.items()) or None

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "string", "none", "Mitsuba's conductors | none", self.text)]


@cache
def conductors() -> list[str]:
    """Return the names of Mitsuba's conductors."""
    return sorted(path.name.removesuffix(".eta.spd") for path in indices().glob("*.eta.spd"))


def indices() -> Path:
    """Return the folder of their indices of refraction: ``NAME.eta.spd`` and ``NAME.k.spd``."""
    return Path(mi.__file__).parent / "data" / "ior"


def _measured(path: Path) -> mi.Texture:
    """Return the texture of a measured spectrum: as it is in spectral variants, and else as the rgb colour or luminance
    that Mitsuba's own conductors make of it."""
    wavelengths, values = mi.spectrum_from_file(str(path))
    if mi.is_spectral:
        spectrum = {"wavelengths": wavelengths, "values": values}
        return mi.load_dict(
            {"type": "irregular"} | {name: ", ".join(map(repr, numbers)) for name, numbers in spectrum.items()}
        )
    return rgb_texture(mi.spectrum_list_to_srgb(wavelengths, values, bounded=False, d65=False))
