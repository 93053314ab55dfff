"""The parameters of a Fresnel term."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import mitsuba as mi

from ..math import clamp
from .colours import rgb_texture
from .messages import listed, meant, shown
from .parameter import BoundParameters, Parameter, ParameterRow
from .reader import PropertyReader, Range


class FresnelSet(Parameter):
    """The Fresnel term: of a conductor (eta and k, or a material's name), Schlick's (f0), of a dielectric (int_ior
    over ext_ior), or none (F = 1), as the given parameters imply; or another one by its word. Evaluated, a function of
    the cosine."""

    words: dict[str, Mapping[str, Parameter]] = {}
    terms: ClassVar[dict[str, Any]] = {}
    """The term of each word, made by ``of_values``: those of :mod:`mi_brdfs.microfacet.fresnel`, and of others."""
    implied_words = ("conductor", "material", "schlick", "dielectric", "none")

    own: BoundParameters
    """Once bound, the parameters of the chosen word."""
    word: str

    def __init__(self) -> None:
        super().__init__("another Fresnel term")

    @classmethod
    def add_term(cls, term: Any) -> None:
        for name, parameter in term.parameters.items():
            parameter.__set_name__(None, name)
        cls.words[term.word], cls.terms[term.word] = term.parameters, term

    @property
    def brought(self) -> list[str]:
        """The words that others have brought."""
        return [word for word in self.words if word not in self.implied_words]

    @property
    def fit_words(self) -> tuple[str, ...]:
        # Schlick's colour can be every reflectance at normal incidence.
        return ("schlick", "dielectric", "conductor", "none", *self.brought)

    @property
    def names(self) -> list[str]:
        own = [name for parameter in self.children() for name in parameter.names]
        return [*own, *([self.name] if self.brought else [])]

    def rivals(self, name: str) -> list[str]:
        declared = next((it for it in self.words.values() if name in it), {})
        return [other for other in self.names if other not in declared]

    def bind(self, reader: PropertyReader) -> FresnelSet:
        word = self._word(reader)
        own = BoundParameters(self.words[word].values(), reader)
        chosen = own.chosen | ({} if word in self.implied_words else {self.name: word})
        return self.replace(word=word, own=own, textures=own.textures, ranges=own.ranges, chosen=chosen)

    def _word(self, reader: PropertyReader) -> str:
        """Return the word that the given parameters imply."""
        given = {word: [name for name in declared if name in reader] for word, declared in self.words.items()}
        chosen = [word for word in self.implied_words if given[word]]
        other = next((name for word in self.brought for name in (self.name, *given[word]) if name in reader), None)
        if other:
            if chosen:
                raise reader.error(other, f"excludes {given[chosen[0]][0]}; give one Fresnel term")
            if self.name not in reader:
                words = listed(self.brought, quote=True)
                raise reader.error(other, f"needs {self.name} beside it, which is {words}")
            word = reader.choice(self.name, tuple(self.brought))
            wrong = next((name for it in self.brought if it != word for name in given[it]), None)
            if wrong and wrong not in self.words[word]:
                has = f"has {listed(self.words[word], 'and')}" if self.words[word] else "has no parameter"
                raise reader.error(wrong, f'does not belong to {self.name} = "{word}", which {has} of its own')
            return word
        if len(chosen) > 1:
            first, second = (given[word][0] for word in chosen[:2])
            raise reader.error(
                first, f"excludes {second}; give one of eta and k, material, f0, int_ior and ext_ior, or none for F = 1"
            )
        if chosen == ["conductor"]:
            for name, other in (("eta", "k"), ("k", "eta")):
                if other not in reader:
                    raise reader.error(name, f"needs {other} beside it")
        return chosen[0] if chosen else "none"

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
        return self.terms[self.word].of_values(self.own.evaluate(si, active))

    def placeholder(self) -> Any:
        return self.terms[self.word].of_values(self.own.placeholders())

    def rows(self) -> list[ParameterRow]:
        own = [row for word in self.implied_words for it in self.words[word].values() for row in it.rows()]
        if not self.brought:
            return own
        words = " | ".join(self.brought)
        others = [
            row._replace(text=f"with {word}: {row.text}")
            for word in self.brought
            for parameter in self.words[word].values()
            for row in parameter.rows()
        ]
        return [*own, ParameterRow(self.name, "string", "none", words, self.text), *others]


class ConductorName(Parameter):
    """The indices of one of Mitsuba's conductors, by its name; "none" stands for no Fresnel term. Evaluated, η and k,
    or None."""

    def __init__(self, limits: Mapping[str, Range], text: str):
        super().__init__(text)
        self.limits = limits

    @property
    def tried(self) -> tuple[str, ...]:
        return ("none", *conductors())

    def bind(self, reader: PropertyReader) -> ConductorName:
        material = reader.text(self.name)
        if material == "none":
            return self.replace()
        known = conductors()
        if material not in known:
            closest = meant(material, known)
            hint = f'; did you mean "{closest}"? It' if closest else "; it"
            # Of two measurements of a material, as Cu and Cu_palik, the first.
            first = [it for it in known if not (it.endswith("_palik") and it.removesuffix("_palik") in known)]
            raise reader.error(
                self.name,
                f'= {shown(material)} is unknown{hint} must be "none", for F = 1, or one of Mitsuba\'s conductors '
                + ", ".join(first),
            )
        textures = {name: _measured(_indices() / f"{material}.{name}.spd") for name in self.limits}
        return self.replace(textures=textures, ranges=dict(self.limits))

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[Any, ...] | None:
        return tuple(clamp(it.eval(si, active), *self.ranges[name]) for name, it in self.textures.items()) or None

    def placeholder(self) -> None:
        return None

    def rows(self) -> list[ParameterRow]:
        return [ParameterRow(self.name, "string", "none", "Mitsuba's conductors | none", self.text)]


@cache
def conductors() -> list[str]:
    """Return the names of Mitsuba's conductors."""
    return sorted(path.name.removesuffix(".eta.spd") for path in _indices().glob("*.eta.spd"))


def _indices() -> Path:
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
