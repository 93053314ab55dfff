"""The parameters of a Fresnel term."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import ClassVar

import mitsuba as mi

from ..math import clamp
from ..microfacet.fresnel import Conductor, Dielectric, Fresnel, Schlick, Unit
from .colours import constant_texture, evaluate_colour, rgb_texture, scaled_colour
from .groups import OneOf
from .messages import interval, listed, meant, shown
from .parameter import BoundParameters, Parameter, ParameterRow
from .reader import PropertyReader, Range

OTHERS = OneOf({}, "another Fresnel term").replace(name="fresnel")
"""The words that others have brought."""
TERMS: dict[str, type[Fresnel]] = {}
"""Their terms."""


class FresnelSet(Parameter):
    """The Fresnel term: of a conductor (eta and k, or a material's name), Schlick's (f0), of a dielectric (int_ior
    over ext_ior), or none (F = 1); or another one by its word, with parameters of its own. Evaluated, a function of the
    cosine."""

    INDEX: ClassVar[Range] = (0.01, 100)
    EXTINCTION: ClassVar[Range] = (0, 100)
    RANGES: ClassVar[dict[str, Range]] = {
        "eta": INDEX,
        "k": EXTINCTION,
        "f0": (0, 1),
        "int_ior": INDEX,
        "ext_ior": INDEX,
    }
    SETS: ClassVar[dict[str, tuple[str, ...]]] = {
        "conductor": ("eta", "k"),
        "material": ("material",),
        "schlick": ("f0",),
        "dielectric": ("int_ior", "ext_ior"),
    }

    word: str | None = None
    """Once bound, the chosen one of these words, if there is one."""
    own: BoundParameters
    """… and its parameters."""

    def __init__(self) -> None:
        super().__init__("Fresnel reflectance")

    @property
    def names(self) -> list[str]:
        common = [name for names in self.SETS.values() for name in names]
        return [*common, *OTHERS.names] if TERMS else common

    def rivals(self, name: str) -> list[str]:
        own = next(names for names in self.SETS.values() if name in names)
        return [other for other in self.names if other not in own]

    def bind(self, reader: PropertyReader) -> FresnelSet:
        textures = self._textures(reader)
        if TERMS and (other := next((name for name in OTHERS.names if name in reader), None)):
            if textures:
                raise reader.error(other, f"excludes {next(iter(textures))}; give one Fresnel term")
            if OTHERS.name not in reader:
                words = listed(TERMS, quote=True)
                raise reader.error(other, f"needs {OTHERS.name} beside it, which is {words}")
            own = OTHERS.bind(reader)
            word = own.chosen[own.name]
            return self.replace(own=own.own, word=word, textures=own.textures, ranges=own.ranges, chosen=own.chosen)
        ranges = {name: limits for name, limits in self.RANGES.items() if name in textures}
        return self.replace(textures=textures, ranges=ranges)

    def _textures(self, reader: PropertyReader) -> dict[str, mi.Texture]:
        """Return the textures of the set that was given."""
        given = {kind: [name for name in names if name in reader] for kind, names in self.SETS.items()}
        chosen = [kind for kind, names in given.items() if names]
        if len(chosen) > 1:
            first, second = (given[kind][0] for kind in chosen[:2])
            raise reader.error(
                first, f"excludes {second}; give one of eta and k, material, f0, int_ior and ext_ior, or none for F = 1"
            )
        if given["conductor"]:
            for name, other in (("eta", "k"), ("k", "eta")):
                if other not in reader:
                    raise reader.error(name, f"needs {other} beside it")
            eta, k = (scaled_colour(reader, name, 0, self.RANGES[name]) for name in ("eta", "k"))
            return eta | k
        if given["material"]:
            return self._material(reader)
        if given["schlick"]:
            return {"f0": reader.colour("f0", 0, self.RANGES["f0"])}
        if given["dielectric"]:
            return {"int_ior": self._ior(reader, "int_ior", "bk7"), "ext_ior": self._ior(reader, "ext_ior", "air")}
        return {}

    def _ior(self, reader: PropertyReader, name: str, default: str) -> mi.Texture:
        """Return an index of refraction given as a number, a texture, or the name of a substance that Mitsuba knows."""
        if name in reader and not isinstance(reader.props[name], str):
            return reader.number(name, 1, self.INDEX)
        try:
            index = mi.lookup_ior(reader.props, name, default)
        except RuntimeError as error:
            known = str(error).partition("choices are:")[2].strip()
            problem = f"= {shown(reader.props[name])} is unknown; it must be a number or one of {known}"
            raise reader.error(name, problem) from None
        return constant_texture(index)

    def _material(self, reader: PropertyReader) -> dict[str, mi.Texture]:
        """Return the indices of one of Mitsuba's conductors."""
        material = reader.text("material")
        if material == "none":
            return {}
        known = conductors()
        if material not in known:
            closest = meant(material, known)
            hint = f'; did you mean "{closest}"? It' if closest else "; it"
            # Of two measurements of a material, as Cu and Cu_palik, the first.
            first = [it for it in known if not (it.endswith("_palik") and it.removesuffix("_palik") in known)]
            raise reader.error(
                "material",
                f'= {shown(material)} is unknown{hint} must be "none", for F = 1, or one of Mitsuba\'s conductors '
                + ", ".join(first),
            )
        return {name: _measured(_indices() / f"{material}.{name}.spd") for name in ("eta", "k")}

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Fresnel:
        if self.word:
            return TERMS[self.word].of_values(self.own.evaluate(si, active))

        def colour(name: str) -> mi.UnpolarizedSpectrum:
            return clamp(evaluate_colour(self.textures, name, si, active), *self.RANGES[name])

        def number(name: str) -> mi.Float:
            return clamp(self.textures[name].eval_1(si, active), *self.RANGES[name])

        if "eta" in self.textures:
            return Conductor(colour("eta"), colour("k"))
        if "f0" in self.textures:
            return Schlick(colour("f0"))
        if "int_ior" in self.textures:
            return Dielectric(number("int_ior") / number("ext_ior"))
        return Unit()

    def placeholder(self) -> Fresnel:
        return TERMS[self.word].of_values(self.own.placeholders()) if self.word else Unit()

    def rows(self) -> list[ParameterRow]:
        index, extinction = interval(*self.INDEX), interval(*self.EXTINCTION)
        rows = [
            ParameterRow("eta, k", "colour", "-", f"{index}, {extinction}",
                         "complex index of refraction of a conductor, relative to the exterior"),
            ParameterRow("material", "string", "none", "Mitsuba's conductors | none",
                         "a conductor by name; none means F = 1"),
            ParameterRow("f0", "colour", "-", "[0, 1]",
                         "Schlick's approximation with this reflectance at normal incidence"),
            ParameterRow("int_ior, ext_ior", "number or name", "bk7, air", index,
                         "indices of refraction of a dielectric, inside and outside"),
        ]  # fmt: skip
        return rows + OTHERS.rows() if TERMS else rows


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
