"""A BSDF as arrays: its methods called part by part, with directions and variates of NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from ..loading import check_plugin
from .arrays import (
    CENTRE,
    WAVELENGTHS,
    Array,
    all_numbers,
    context,
    hero_wavelengths,
    interaction,
    numbers,
    sample_arguments,
    vectors,
)
from .directions import hemisphere, on_side
from .variates import random

if TYPE_CHECKING:
    from ..model import Model


class Data(Protocol):
    """What a measured file holds."""

    def seen(self, wi: Array, wo: Array) -> Array:
        """Return whether there is a value for each pair of directions."""
        ...


class Part(NamedTuple):
    """The whole BSDF (whose delta functions are not evaluated) or one of its components."""

    name: str
    context: mi.BSDFContext
    component: int | None
    flags: int
    sides: tuple[int, ...]
    """The sides that it is seen from: 1 for the front, -1 for the back."""

    def has(self, flag: int) -> bool:
        """Return whether a flag is among those of the part."""
        return bool(self.flags & int(flag))

    def around(self, count: int, seed: int) -> Array:
        """Draw directions all over the sides that it is seen from."""
        return on_side(hemisphere(count, seed), np.random.default_rng([seed, 1]).choice(self.sides, count))

    @property
    def passages(self) -> list[tuple[int, int]]:
        """The sides that light may go from and to, and back."""
        flags = mi.BSDFFlags
        ways = [1] * self.has(flags.Reflection) + [-1] * (self.has(flags.Transmission) and len(self.sides) > 1)
        return [(side, side * way) for side in self.sides for way in ways]


class Samples(NamedTuple):
    """What ``sample`` returned, and ``eval`` and ``pdf`` of the same directions: a row for each row of variates."""

    wo: Array
    weight: Array
    density: Array
    """The density that ``sample`` states."""
    component: Array
    kind: Array
    eta: Array
    value: Array
    pdf: Array
    smooth: Array
    """Which of them are not of a delta function."""

    @property
    def lit(self) -> Array:
        """Which of them carry light, and not that of a delta function."""
        return self.weight.any(axis=1) & self.smooth

    @property
    def drawn(self) -> Array:
        """Which of them carry light or may be black ones, drawn where f = 0.

        A sampler may also reject a direction by a weight of zero, and leave anything in the other fields: so a black
        sample must have f = 0, or next to it, and the density that ``pdf`` states.
        """
        black = (abs(self.value) < 1e-30).all(axis=1) & (self.pdf > 0) & self.smooth
        return self.lit | (black & (abs(self.density - self.pdf) < 0.01 * self.pdf))


class Value(NamedTuple):
    """What becomes of light, by a name of it, and where it goes: a row for each direction."""

    name: str
    wo: Array
    value: Array


@dataclass
class BSDFProbe:
    """A BSDF of the active variant, which must be vectorized and unpolarized, with its parts.

    Directions are float32 arrays: ``wo`` and variates of shape (N, 3), ``wi`` of shape (3,) or (N, 3). Texture
    coordinates ``uv`` have the shape (2,) or (N, 2). Values and weights have the shape (N, channels), densities (N,).
    """

    bsdf: mi.BSDF
    every_wavelength: bool = field(default=False, kw_only=True)
    """Whether lanes have wavelengths of their own in spectral variants, from the whole visible range."""
    turned: bool = field(default=False, kw_only=True)
    """Whether the surface is turned in the world; directions are local, and stay."""
    data: Data | None = field(default=None, kw_only=True)
    """What a measured file holds: values of ``eval`` are NaN where that has none."""

    @cached_property
    def components(self) -> list[Part]:
        """The components that are not delta functions."""
        count, parts = self.bsdf.component_count(), []
        for k in range(count):
            flags = int(self.bsdf.flags(k))
            if flags & int(mi.BSDFFlags.Smooth):
                name = self.name_of(k) if count > 1 else "whole"
                parts.append(Part(name, context(component=k), k, flags, _sides(flags)))
        return parts

    @cached_property
    def deltas(self) -> list[Part]:
        """The components that are delta functions, seen from wherever a component is."""
        smooth = [part.component for part in self.components]
        others = [k for k in range(self.bsdf.component_count()) if k not in smooth]
        return [
            Part(self.name_of(k), context(component=k), k, int(self.bsdf.flags(k)), self.whole.sides) for k in others
        ]

    def name_of(self, component: int) -> str:
        """Return the name of a component, with what its flags say it is."""
        flags, kinds = int(self.bsdf.flags(component)), mi.BSDFFlags
        words = [word for word, kind in (("diffuse", kinds.Diffuse), ("glossy", kinds.Glossy), ("delta", kinds.Delta))
                 if flags & int(kind)]  # fmt: skip
        ways = [word for word in ("reflection", "transmission") if flags & int(getattr(kinds, word.capitalize()))]
        kind = "null" if flags & int(kinds.Null) else " ".join([*words, " and ".join(ways)])
        return f"component {component} ({kind or 'of no kind'})"

    @cached_property
    def whole(self) -> Part:
        """All that is not a delta function, seen from wherever a component is, even one that is a delta function."""
        flags = 0
        for part in self.components:
            flags |= part.flags
        return Part("whole", context(), None, flags, _sides(int(self.bsdf.flags())))

    @cached_property
    def parts(self) -> list[Part]:
        """The whole, and each component if there are several."""
        if not self.components:
            return []
        return [self.whole, *(self.components if self.bsdf.component_count() > 1 else [])]

    @cached_property
    def models(self) -> list[Model | None]:
        """The models of the BSDFs that it is made of, itself or what it contains; None for those that have none."""
        if self.is_ours:
            return [self.bsdf.model]
        return [getattr(inner, "model", None) for inner in contained(self.bsdf)] or [None]

    @property
    def is_data(self) -> bool:
        """Whether values of it are measured data."""
        return any(model.data for model in self.models if model)

    @property
    def is_ours(self) -> bool:
        """Whether the plugin is one of a model, of this pack or registered with it."""
        return hasattr(self.bsdf, "model")

    # --- Calls ------------------------------------------------------------------------------------------------------

    def _at(self, wi: Array, uv: ArrayLike, count: int) -> mi.SurfaceInteraction3f:
        # A direction for each lane: Dr.Jit compiles other kernels for one that is given once.
        each = np.broadcast_to(wi, (count, 3))
        si = interaction(each, uv, hero_wavelengths(count) if self.every_wavelength else WAVELENGTHS)
        if self.turned:
            s, t, n = mi.Vector3f(0.6, 0, -0.8), mi.Vector3f(-0.64, 0.6, -0.48), mi.Vector3f(0.48, 0.8, 0.36)
            si.n, si.sh_frame, si.dp_du, si.dp_dv = mi.Normal3f(n), mi.Frame3f(s, t, n), s, t
        return si

    def eval(self, part: Part, wi: Array, wo: Array, uv: ArrayLike = CENTRE) -> Array:
        """Return f |cosθ_o|."""
        value = numbers(self.bsdf.eval(part.context, self._at(wi, uv, len(wo)), vectors(wo), True), len(wo))
        return np.where(self.data.seen(wi, wo)[:, None], value, np.nan) if self.data is not None else value

    def values(self, wi: Array, wo: Array, uv: ArrayLike = CENTRE) -> list[Value]:
        """Return f |cosθ_o| of the whole, of ``eval`` and of ``eval_pdf``, and what samples of each delta function
        alone weigh."""
        return self.values_at(self._at(wi, uv, len(wo)), wo)

    def values_at(self, si: mi.SurfaceInteraction3f, wo: Array) -> list[Value]:
        """Return these at surface points, for which :attr:`data` does not count."""
        count, ctx, towards = len(wo), self.whole.context, vectors(wo)
        whole = self.bsdf.eval(ctx, si, towards, True), self.bsdf.eval_pdf(ctx, si, towards, True)[0]
        names = "eval", "eval_pdf's value"
        found = [Value(name, wo, value) for name, value in zip(names, all_numbers(whole, count), strict=True)]
        for part in self.deltas:
            bs, weight = self.bsdf.sample(part.context, si, *sample_arguments(random(count, 83)), True)
            found.append(Value(f"a sample's weight of {part.name}", *(numbers(it, count) for it in (bs.wo, weight))))
        return found

    def pdf(self, part: Part, wi: Array, wo: Array, uv: ArrayLike = CENTRE) -> Array:
        """Return the density of ``wo``."""
        return numbers(self.bsdf.pdf(part.context, self._at(wi, uv, len(wo)), vectors(wo), True), len(wo))[:, 0]

    def eval_pdf(self, part: Part, wi: Array, wo: Array, uv: ArrayLike = CENTRE) -> tuple[Array, Array]:
        """Return ``(value, pdf)``."""
        value, pdf = self.bsdf.eval_pdf(part.context, self._at(wi, uv, len(wo)), vectors(wo), True)
        return numbers(value, len(wo)), numbers(pdf, len(wo))[:, 0]

    def eval_pdf_sample(
        self, part: Part, wi: Array, wo: Array, variates: Array, uv: ArrayLike = CENTRE
    ) -> tuple[Array, ...]:
        """Return ``(value, pdf, wo, density, weight)``, the last three of the sample."""
        u, v = sample_arguments(variates)
        count, si = len(variates), self._at(wi, uv, len(variates))
        value, pdf, bs, weight = self.bsdf.eval_pdf_sample(part.context, si, vectors(wo), u, v, True)
        value, pdf, sampled, density, weight = (numbers(x, count) for x in (value, pdf, bs.wo, bs.pdf, weight))
        return value, pdf[:, 0], sampled, density[:, 0], weight

    def sample(self, part: Part, wi: Array, variates: Array, uv: ArrayLike = CENTRE) -> Samples:
        """Draw samples, and evaluate the part for their directions."""
        (u, v), count = sample_arguments(variates), len(variates)
        si = self._at(wi, uv, count)
        bs, weight = self.bsdf.sample(part.context, si, u, v, True)
        for name in ("wo", "pdf", "eta", "sampled_type", "sampled_component"):
            if not dr.width(getattr(bs, name)):
                raise ValueError(
                    f"sample leaves {name} empty: begin with dr.zeros(mi.BSDFSample3f), and set each field"
                )
        drawn = bs.pdf > 0
        wo = dr.select(drawn, bs.wo, mi.Vector3f(0, 0, 1))
        value, pdf = self.bsdf.eval(part.context, si, wo, True), self.bsdf.pdf(part.context, si, wo, True)
        scalars = bs.pdf, bs.sampled_component, bs.sampled_type, bs.eta, dr.select(drawn, pdf, 0), self.is_smooth(bs)
        wo, weight, value, *columns = all_numbers((wo, weight, value, *scalars), count)
        density, component, kind, eta, pdf, smooth = (column[:, 0] for column in columns)
        return Samples(wo.astype(np.float32), weight, density, component, kind, eta, value, pdf, smooth > 0)

    def pairs(self, part: Part, count: int, seed: int, sides: tuple[int, int] | None = None) -> tuple[Array, Array]:
        """Return directions all over a side, and others on the same or another side, half of them as they are drawn; by
        default of all the ways that light may go."""
        ways = [sides] if sides else part.passages or [(side, side) for side in part.sides]
        side, other = np.random.default_rng(seed).choice(ways, count).T
        wi, wo = on_side(hemisphere(count, seed), side), on_side(hemisphere(count, seed + 1), other)
        drawn = self.sample(part, wi, random(count, seed + 2)).wo
        near = (np.arange(count) % 2 == 0) & (drawn[:, 2] * other > 0.01)
        return wi, np.where(near[:, None], drawn, wo)

    def weights(self, part: Part, wi: Array, variates: Array) -> Array:
        """Return the weights that ``sample`` returns for each of some directions by the same variates, shape
        (len(wi), len(variates), channels)."""
        si = interaction(np.repeat(wi, len(variates), axis=0))
        _, weight = self.bsdf.sample(part.context, si, *sample_arguments(np.tile(variates, (len(wi), 1))), True)
        return numbers(weight, len(wi) * len(variates)).reshape(len(wi), len(variates), -1)

    def diffuse_reflectance(self, wi: Array, uv: ArrayLike = CENTRE, active: bool | mi.Bool = True) -> Array:
        """Return ``eval_diffuse_reflectance``, shape (len(wi), channels); black if it is not implemented."""
        try:
            return numbers(self.bsdf.eval_diffuse_reflectance(interaction(wi, uv), active), len(wi))
        except RuntimeError:
            return np.zeros((len(wi), 1))

    def is_smooth(self, bs: mi.BSDFSample3f) -> mi.Bool:
        """Return whether samples are not of a delta function."""
        return (bs.sampled_type & int(mi.BSDFFlags.Smooth)) != 0 if self.deltas else mi.Bool(True)


def load(given: Mapping[str, Any]) -> Any:
    """Load a plugin dict that may be loaded again. In spectral variants Mitsuba writes the coefficients of spectra into
    the bitmaps that it is given, and a second time those of the coefficients: give it copies. Raise a ValueError for a
    None or what is missing, at which Mitsuba would end the process."""
    return mi.load_dict(_copied(given))


def _copied(given: Any) -> Any:
    if isinstance(given, Mapping):
        check_plugin(given.get("type", ""), given)
        for name, value in given.items():
            if value is None:
                raise ValueError(f"{name} is None; leave it out, or give it a value.")
        # Whole numbers of indices are numbers, too; Mitsuba expects the name of a medium, or a point.
        floats = {name: float(it) for name, it in given.items() if name.endswith("_ior") and type(it) is int}
        return {name: _copied(value) for name, value in given.items()} | floats
    return mi.Bitmap(given) if isinstance(given, mi.Bitmap) else given


def contained(bsdf: mi.BSDF) -> list[mi.BSDF]:
    """Return the BSDFs that one is made of, as one with two sides is."""
    return [it for it in mi.traverse(bsdf).hierarchy if isinstance(it, mi.BSDF) and it is not bsdf]


def shapes_of(scene: mi.Scene) -> list[mi.Shape]:
    """Return the shapes that have a BSDF, including those in groups, which instances show."""
    shapes = [it for it in mi.traverse(scene).hierarchy if isinstance(it, mi.Shape)]
    return [it for it in shapes if it.bsdf() is not None and it.class_name() not in ("Instance", "ShapeGroupPlugin")]


def _sides(flags: int) -> tuple[int, ...]:
    front, back = (bool(flags & int(flag)) for flag in (mi.BSDFFlags.FrontSide, mi.BSDFFlags.BackSide))
    return tuple(side for side, seen in ((1, front or not back), (-1, back)) if seen)
