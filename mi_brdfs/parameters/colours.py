"""Colours, and how they are evaluated in every variant."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import mitsuba as mi

from ..math import clamp, in_lanes
from .messages import interval, number_or_none
from .parameter import Parameter, ParameterRow, Quantity
from .reader import PropertyReader, Range


class Colour(Parameter):
    """A spectral quantity within ``limits``. Without a default it is None where it is not given. Fits leave one that is
    not ``sought`` as it is, unless asked for it, and so do searches for the largest albedo."""

    def __init__(
        self, default: float | None, limits: Range, text: str, *, role: str | None = None, sought: bool = True
    ):
        super().__init__(text)
        self.default, self.limits, self.role, self.sought = default, limits, role, sought

    @property
    def spellings(self) -> list[tuple[Quantity, ...]]:
        return [(Quantity(self.names[0], self.limits, self.default, self.text, colour=True, sought=self.sought),)]

    def bind(self, reader: PropertyReader) -> Colour:
        (name,) = self.names
        if self.default is None and name not in reader:
            return self.replace()
        textures = scaled_colour(reader, name, self.default or 0, self.limits)
        return self.replace(textures=textures, ranges={name: self.limits})

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.UnpolarizedSpectrum | None:
        if not self.textures:
            return None
        return in_lanes(clamp(evaluate_colour(self.textures, self.names[0], si, active), *self.limits), si.wi)

    def placeholder(self) -> mi.UnpolarizedSpectrum | None:
        return mi.UnpolarizedSpectrum(self.default or 0) if self.textures else None

    def rows(self) -> list[ParameterRow]:
        default, range_ = number_or_none(self.default), interval(*self.limits)
        return [ParameterRow(self.names[0], "colour", default, range_, self.text)]


class Reflectance(Colour):
    """A colour in [0, 1]."""

    def __init__(self, default: float | None, text: str, *, role: str | None = None, sought: bool = True):
        super().__init__(default, (0, 1), text, role=role, sought=sought)

    @property
    def tried(self) -> tuple[float, ...]:
        return () if self.default is None else (0.1, 0.3, 0.5, 0.7, 0.9)


def evaluate_colour(
    textures: Mapping[str, mi.Texture], name: str, si: mi.SurfaceInteraction3f, active: mi.Bool
) -> mi.UnpolarizedSpectrum:
    """Return the colour of a property, times its scale if there is one (:func:`scaled_colour`)."""
    colour, scale = textures[name].eval(si, active), textures.get(_scale_of(name))
    return colour if scale is None else colour * scale.eval_1(si, active)


def scaled_colour(reader: PropertyReader, name: str, default: float, limits: Range) -> dict[str, mi.Texture]:
    """Return the texture of a colour by its name and, where it holds at most 1, that of a scale beside it: spectral
    variants upsample an rgb colour to a reflectance, which Mitsuba clips."""
    texture = reader.colour(name, default, limits)
    if not mi.is_spectral or limits[1] <= 1 or name not in reader:
        return {name: texture}
    if texture.class_name().startswith("BitmapTexture") and mi.traverse(texture)["data"].shape[2] == 3:
        warnings.warn(
            f"{reader.plugin}: {name} is a bitmap of colours, of which Mitsuba's spectral variants clip to 1 what is "
            "larger; give a bitmap of one channel if it has such values.",
            stacklevel=2,
        )
    values = reader.colour_values(name)
    if values is None or reader.props.type(name) != mi.Properties.Type.Color or max(values) <= 1:
        return {name: texture}
    scale = 2 * max(values)  # as for light: spectra of reflectances below a half are smooth
    return {name: rgb_texture([value / scale for value in values]), _scale_of(name): constant_texture(scale)}


def _scale_of(name: str) -> str:
    return f"{name}_scale"


def rgb_texture(rgb: Sequence[float]) -> mi.Texture:
    return constant_texture(mi.ScalarColor3d(rgb))


def constant_texture(value: float | mi.ScalarColor3d) -> mi.Texture:
    props = mi.Properties()
    props["value"] = value
    return props.get_unbounded_texture("value")
