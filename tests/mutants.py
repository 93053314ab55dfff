"""Models with a fault each, as a hurried author may leave them, and the checks that must name it.

Each mutant is a plugin of its own, ``mutant_NAME``, made of a model or lobe of the pack with one thing changed; for
``MUTANTS`` see the end.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from functools import reduce
from operator import or_
from types import SimpleNamespace
from typing import ClassVar

import drjit as dr
import mitsuba as mi

from mi_brdfs.lobes import LambertLobe, MicrofacetLobe, Mixture, PowerLobe, over_diffuse
from mi_brdfs.microfacet.distributions import GGX, Beckmann
from mi_brdfs.microfacet.facet import Facet
from mi_brdfs.microfacet.film import filmed
from mi_brdfs.microfacet.fresnel import Unit
from mi_brdfs.microfacet.shadowing import Kelemen, Shadowing, SmithGGX
from mi_brdfs.mitsuba import bsdf as adapter
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.models.phong import Phong
from mi_brdfs.models.walter import Walter
from mi_brdfs.models.ward import Ward
from mi_brdfs.parameters import Colour

# --- Lobes ----------------------------------------------------------------------------------------------------------


def altered(lobe, alter):
    """A lobe whose value and density are what a function of it, the directions and these makes of them."""

    class Mutant(lobe):
        def eval_pdf(self, wi, wo):
            return alter(self, wi, wo, *super().eval_pdf(wi, wo))

    return Mutant


def changed(lobe, value=None, density=None):
    """A lobe with a factor on its value or its density, of wi and wo."""

    def alter(self, wi, wo, f, pdf):
        return f * value(wi, wo) if value else f, pdf * density(wi, wo) if density else pdf

    return altered(lobe, alter)


def drawn(lobe, alter):
    """A lobe whose samples are what a function of wi, wo and the variates makes of them."""

    class Mutant(lobe):
        def sample(self, wi, u, v):
            return alter(wi, super().sample(wi, u, v), u, v)

    return Mutant


def diffuse(value=None, density=None):
    return lambert(changed(LambertLobe, value, density))


def diffuse_value(alter):
    """A Lambertian whose value is what a function of it and its reflectance makes of it."""
    return lambert(altered(LambertLobe, lambda self, wi, wo, f, pdf: (alter(f, self.reflectance), pdf)))


def where(condition, factor):
    return lambda wi, wo: dr.select(condition(wi, wo), mi.Float(factor), 1)


def lit(region, factor=1.05):
    """A factor for light from a region."""
    return where(lambda wi, wo: region(wi), factor)


def towards(region, factor=1.05):
    return where(lambda wi, wo: region(wo), factor)


def between(low, high):
    """Whether a direction is within some angles to the normal, in degrees."""
    return lambda w: (w.z < math.cos(math.radians(low))) & (w.z > math.cos(math.radians(high)))


def azimuths(low, high):
    """Whether the azimuth of a direction is within some angles, in degrees."""

    def within(w):
        phi = dr.atan2(w.y, w.x)
        phi = dr.select(phi < 0, phi + 2 * dr.pi, phi)
        return (phi > math.radians(low)) & (phi < math.radians(high))

    return within


def third_quadrant(w):
    return (w.x < 0) & (w.y < 0)


def first_quadrant(w):
    return (w.x > 0) & (w.y > 0)


def turned(angle):
    """A sampler turned about the normal, by radians."""

    def alter(wi, wo, u, v):
        sin, cos = dr.sincos(mi.Float(angle))
        return mi.Vector3f(cos * wo.x - sin * wo.y, cos * wo.y + sin * wo.x, wo.z)

    return alter


def root_at_normal(w):
    """sinθ as √(1 - cos²θ), of which the derivative is infinite at normal incidence."""
    return dr.sqrt(dr.maximum(1 - w.z * w.z, 0))


def sine_to_the_mirror(wi, wo):
    """sin as √(1 - cos²) of a dot product that a rounding error may lift above 1."""
    return 1 - 0.1 * dr.sqrt(1 - dr.square(dr.dot(mi.Vector3f(-wi.x, -wi.y, wi.z), wo)))


def nothing_over_nothing(wi, wo):
    return dr.squared_norm(wi - wo) / dr.squared_norm(wi - wo)


def half_azimuths(wi, wo):
    """A function of half the azimuth, which jumps where azimuths start again."""
    return 1 - 0.1 * dr.sin(dr.atan2(wi.y, wi.x) / 2) * dr.sin(dr.atan2(wo.y, wo.x) / 2)


def half_vector(wi, wo):
    """What makes the density that of the half vector, without the Jacobian 1/(4 cosθ_d) of its reflection."""
    return 4 * Facet.between(wi, wo).cos_d


def half_vector_if_anisotropic(self, wi, wo, value, pdf):
    """The Jacobian is missing in the branch of different alphas."""
    d = self.distribution
    return value, pdf * dr.select(d.alpha_u == d.alpha_v, 1, half_vector(wi, wo))


def lost_at_forty_five(wi, wo, u, v):
    return dr.select((v.y < 0.02) & between(40, 50)(wi), -wo, wo)


def warped(v):
    return mi.warp.square_to_cosine_hemisphere(v)


def off_by_one(self, wi, wo, value, pdf):
    return value, pdf * (self.exponent + 1) / (self.exponent + 2)


def shifted_between_quadrants(wi, wo):
    return dr.select(third_quadrant(wo), 1.04, mi.Float(1)) - dr.select(first_quadrant(wo), 0.04, mi.Float(0))


class FilmCutOff(MicrofacetLobe):
    """A film without derivatives for its thickness."""

    def __init__(self, colour, distribution, shadowing, film):
        film.thickness = dr.detach(film.thickness)
        super().__init__(colour, distribution, shadowing, film)


UniformDensity = altered(LambertLobe, lambda self, wi, wo, f, pdf: (f, mi.Float(dr.inv_two_pi)))
UniformSampler = drawn(LambertLobe, lambda wi, wo, u, v: mi.warp.square_to_uniform_hemisphere(v))


class OneWayAndSaysSo(changed(LambertLobe, lambda wi, wo: 0.5 + 0.5 * wo.z)):
    reciprocal = False


class PowerFlaggedDiffuse(PowerLobe):
    glossy = False


def swapped_beyond(self, wi, wo, value, pdf):
    """αu and αv change places in the density only, for light from a quarter of the azimuths."""
    d = self.distribution
    swapped = MicrofacetLobe(1, type(d)(d.alpha_v, d.alpha_u), self.shadowing, self.fresnel)
    return value, dr.select(third_quadrant(wi), swapped.eval_pdf(wi, wo)[1], pdf)


class OneSidedShadowing(Shadowing):
    """Smith's masking of wo alone."""

    conserving = True

    def __call__(self, facet):
        z = facet.cos_o
        return 2 / (1 + dr.sqrt(1 + 0.36 * (1 - z * z) / (z * z)))


def lambert(lobe):
    class Mutant(Lambert):
        energy = Lambert.energy  # the page that it contradicts

        def lobes(self, p):
            return (lobe(p.reflectance),)

    return Mutant


def phong(lobe):
    class Mutant(Phong):
        def lobes(self, p):
            scale = (p.exponent + 2) * dr.inv_two_pi
            return LambertLobe(p.diffuse_reflectance), lobe(p.specular_reflectance, p.exponent, scale)

    return Mutant


def walter(lobe=MicrofacetLobe, shadowing=None):
    class Mutant(Walter):
        def lobes(self, p):
            smith = shadowing or SmithGGX(*p.alpha, correlated=False)
            specular = lobe(p.specular_reflectance, GGX(*p.alpha), smith, filmed(self, p))
            return over_diffuse(p.diffuse_reflectance, specular)

    return Mutant


def ward(lobe):
    class Mutant(Ward):
        def lobes(self, p):
            specular = lobe(p.specular_reflectance, Beckmann(*p.alpha), Kelemen(), Unit())
            return LambertLobe(p.diffuse_reflectance), specular

    return Mutant


# --- Parameters -----------------------------------------------------------------------------------------------------


class BakedIn(Lambert):
    """Makes a number of Python of its texture's: a literal in the kernel."""

    def lobes(self, p):
        return (LambertLobe(float(mi.traverse(self.textures["reflectance"])["value"][0])),)


def colour(evaluate, **members):
    """A Lambertian whose reflectance is what a function of its texture, the surface point and the mask says."""

    def values(self, si, active):
        return SimpleNamespace(reflectance=evaluate(self.textures["reflectance"], si, active))

    return type("Mutant", (Lambert,), {"evaluate": values, **members})


def in_spectra(change, **members):
    """A Lambertian whose colours are changed in spectral variants, by a function of them and the wavelengths."""

    def evaluate(texture, si, active):
        value = texture.eval(si, active)
        return change(value, si.wavelengths) if mi.is_spectral else value

    return colour(evaluate, **members)


def beside(texture, si, active):
    """Its colours are looked up next to the wavelengths of the light, each nearer to the other three."""
    moved = mi.SurfaceInteraction3f(si)
    if mi.is_spectral:
        moved.wavelengths = 0.7 * si.wavelengths + 0.3 * dr.mean(si.wavelengths)
    return texture.eval(moved, active)


class SharedByAll(Lambert):
    """All BSDFs have the textures of the first."""

    first: ClassVar = []

    def evaluate(self, si, active):
        self.first.append(self.textures)
        return SimpleNamespace(reflectance=self.first[0]["reflectance"].eval(si, active))


class TextureKept(Lambert):
    """Keeps the value of its texture for calls of as many lanes."""

    width = 0

    def evaluate(self, si, active):
        if self.width != dr.width(si):
            self.width, self.kept = dr.width(si), super().evaluate(si, active)
        return self.kept


def elsewhere(moved):
    """A Lambertian that looks its texture up at another point."""

    class Mutant(Lambert):
        def evaluate(self, si, active):
            other = mi.SurfaceInteraction3f(si)
            other.uv = moved(si.uv)
            return super().evaluate(other, active)

    return Mutant


def greyed(value):
    return mi.Color3f(mi.luminance(value)) if mi.is_rgb else value


def greyed_pair(own, self, *given):
    value, pdf = own(self, *given)
    return greyed(value), pdf


def greyed_in_light_tracing(own, self, ctx, *given):
    value = own(self, ctx, *given)
    return greyed(value) if ctx.mode == mi.TransportMode.Importance else value


def weighed_anew(self, ctx, si, bs, active):
    """A sample with the density and the weight that its direction has."""
    value, bs.pdf = self.eval_pdf(ctx, si, bs.wo, active)
    return bs, dr.select(bs.pdf > 0, value / bs.pdf, 0)


def drawn_elsewhere(own, self, ctx, si, u, v, active):
    """Weights are right for the directions, which are drawn by other parameters."""
    moved = mi.SurfaceInteraction3f(si)
    moved.uv = mi.Point2f(0.3)
    return weighed_anew(self, ctx, si, own(self, ctx, moved, u, v, active)[0], active)


def drawn_otherwise_from_lights(own, self, ctx, si, u, v, active):
    """Weights are right for the directions, which are nearer to the normal."""
    bs, weight = own(self, ctx, si, u, v, active)
    if ctx.mode != mi.TransportMode.Importance:
        return bs, weight
    bs.wo = dr.normalize(bs.wo + mi.Vector3f(0, 0, 0.2))
    return weighed_anew(self, ctx, si, bs, active)


def sampled_brighter_from_lights(own, self, ctx, *given):
    """eval_pdf_sample alone returns more than eval."""
    value, *rest = own(self, ctx, *given)
    return value * brighter_from_lights(ctx, None, None), *rest


def exchanged(value):
    return mi.Color3f(value.z, value.y, value.x) if mi.is_rgb else value


def red_and_blue_exchanged(texture, si, active):
    return exchanged(texture.eval(si, active))


class OneOfTwoColoursExchanged(Phong):
    def lobes(self, p):
        p.specular_reflectance = exchanged(p.specular_reflectance)
        return super().lobes(p)


def outwards(texture, si, active):
    """Derivatives beyond a limit are those at it, also where they lead further out."""
    value = texture.eval(si, active)
    return dr.replace_grad(dr.clip(value, 0, 1), value)


def with_derivative(of):
    """A Lambertian whose reflectance has the derivative of what a function makes of it, its texture and the point."""

    def evaluate(texture, si, active):
        value = texture.eval(si, active)
        return dr.replace_grad(dr.detach(value), of(value, texture, si))

    return colour(evaluate)


class Backward(dr.CustomOp):
    """What is given, with another derivative backward than forward."""

    def eval(self, value, backward):
        self.given = backward
        return value * 1

    def forward(self):
        self.set_grad_out(self.grad_in("value"))

    def backward(self):
        self.set_grad_in("value", self.given(self.grad_out()))


def backward(change):
    """A Lambertian with another derivative backward than forward."""
    return colour(lambda texture, si, active: dr.custom(Backward, texture.eval(si, active), change))


# --- Adapters -------------------------------------------------------------------------------------------------------


def sampled(**fields):
    """An adapter whose samples have other fields, or another weight: each a function of the sample, the weight, the
    surface point and the first variate."""

    class Mutant(adapter.ModelBSDF):
        def sample(self, ctx, si, sample1, sample2, active=True):
            bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
            for name, of in fields.items():
                if name == "weight":
                    weight = of(bs, weight, si, sample1)
                else:
                    setattr(bs, name, of(bs, weight, si, sample1))
            return bs, weight

    return Mutant


def adapted(**methods):
    """An adapter with other methods: each a function of the adapter's own, of the BSDF and of what is given."""

    def method(name, change):
        own = getattr(adapter.ModelBSDF, name)
        return lambda self, *given: change(own, self, *given)

    return type("Mutant", (adapter.ModelBSDF,), {name: method(name, change) for name, change in methods.items()})


def masked(name, mask=lambda active: True):
    """An adapter one of whose methods has another mask: by default none."""
    return adapted(**{name: lambda own, self, *given: own(self, *given[:-1], mask(given[-1]))})


def reflectance(change, at=lambda si: si):
    """An adapter whose ``eval_diffuse_reflectance`` is changed, or that of another point."""
    return adapted(eval_diffuse_reflectance=lambda own, self, si, active: change(own(self, at(si), active)))


def asks_for_values(own, self, ctx, si, wo, active):
    """A shortcut if all directions lie below the horizon."""
    return own(self, ctx, si, wo, active if dr.any(wo.z > 0) else False)


def brighter_for_one_lane(own, self, ctx, si, wo, active):
    """A shortcut that renderers take, whose calls are recorded for one lane."""
    value, pdf = own(self, ctx, si, wo, active)
    return value * (1.5 if dr.width(wo) == 1 else 1), pdf


def follows_no_update(own, self, ctx, si, u, v, active):
    """sample draws as it did before its exponent was set."""
    now = self.textures["exponent"].eval_1(si)
    self.first = getattr(self, "first", dr.mean(now))
    return own(self, ctx, si, u, mi.Point2f(v.x * dr.minimum(now / self.first, 1), v.y), active)


def weighs_as_before(own, self, *given):
    """The weight is that of the reflectance before it was set."""
    bs, weight = own(self, *given)
    now = self.textures["reflectance"].eval(given[1])
    self.first = getattr(self, "first", dr.mean(now.x))
    return bs, weight * (self.first / now.x)


def as_bright_as_others(texture, si, active):
    """Darker where others are brighter."""
    value = texture.eval(si, active)
    return value * (0.5 + 0.5 * dr.minimum(1, value.x / dr.maximum(dr.mean(value.x), 1e-6)))


def ignored_masks(own, self, ctx, si, active):
    return own(self, mi.BSDFContext(), si, active)


def one_bit_of_the_mask(own, self, ctx, si, active):
    """A type mask of several bits enables nothing."""
    kinds = [int(mi.BSDFFlags.All), *self.kinds]
    return own(self, ctx, si, active) if ctx.type_mask in map(int, kinds) else None


def evaluated(value=None, density=None, **methods):
    """An adapter with a factor on its values or its densities, of the context, the surface point and wo."""

    def eval_pdf(own, self, ctx, si, wo, active):
        f, pdf = own(self, ctx, si, wo, active)
        return f * value(ctx, si, wo) if value else f, pdf * density(ctx, si, wo) if density else pdf

    return adapted(eval_pdf=eval_pdf, **methods)


def brighter_every_other_time(own, self, *given):
    value, pdf = own(self, *given)
    self.called = not getattr(self, "called", False)
    return (1.1 * value if self.called else value), pdf


def in_the_world(ctx, si, wo):
    """A direction of the world is taken for a local one."""
    return 0.75 + 0.25 * abs(si.n.z)


def brighter_from_lights(ctx, si, wo):
    return 1.1 if ctx.mode == mi.TransportMode.Importance else 1


def suspended(own, self, *given):
    with dr.suspend_grad():
        return own(self, *given)


def with_derivatives(own, self, *given):
    return adapter.ModelBSDF.eval_pdf(self, *given)[0]


def tiled_in_place(own, self, ctx, si, *given):
    si.uv *= 2
    return own(self, ctx, si, *given)


def turned_to_the_front(own, self, ctx, si, *given):
    """What comes from behind gets no light, but is from the front afterwards."""
    value = own(self, ctx, si, *given)
    si.wi.z = abs(si.wi.z)
    return value


ALONE = {
    "eval": with_derivatives,
    "pdf": lambda own, self, *given: adapter.ModelBSDF.eval_pdf(self, *given)[1],
}
"""The other methods of an adapter whose ``eval_pdf`` alone is wrong."""
PairDisagrees = evaluated(lambda ctx, si, wo: 1 / dr.maximum(wo.z, 0.01), **ALONE)


def at_a_fixed_point(own, self, ctx, si, *given):
    """Textures are looked up where they have their middle."""
    there = mi.SurfaceInteraction3f(si)
    there.uv = mi.Point2f(0.5)
    return own(self, ctx, there, *given)


def half_floats(own, self, *given):
    """eval returns eleven bits."""
    return mi.Color3f([mi.Float(dr.llvm.ad.Float16(channel)) for channel in own(self, *given)])


def shines_through(own, self, ctx, si, wo, active):
    """Takes the cosine's absolute value where it should be zero below the horizon."""
    return own(self, ctx, si, mi.Vector3f(wo.x, wo.y, abs(wo.z)), active)


def exchanged_variates(own, self, ctx, si, wo, sample1, sample2, active):
    return own(self, ctx, si, wo, sample1, mi.Point2f(sample2.y, sample2.x), active)


def one_variate_for_both(own, self, ctx, si, sample1, sample2, active):
    """The lobe is chosen by a variate that also chooses the direction."""
    return own(self, ctx, si, sample2.x, sample2, active)


def exchanged_keys(own, self, callback):
    """Shows its parameters under each other's names."""
    names = list(self.textures)
    for name, other in zip(names, reversed(names), strict=True):
        callback.put(name, self.textures[other], mi.ParamFlags.Differentiable)


def leaked_derivative(own, self, ctx, si, wo, active):
    """Inactive lanes get no light, but parameters get their derivatives."""
    value, pdf = own(self, ctx, si, wo, active)
    every = own(self, ctx, si, wo, True)[0]
    return value + dr.select(mi.Bool(active), 0, every - dr.detach(every)), pdf


def lifted(own, self, ctx, si, wo, active):
    """Turns the caller's direction to the front."""
    wo.z = abs(wo.z)
    return own(self, ctx, si, wo, active)


def without_fields(own, self, *given):
    bs, weight = own(self, *given)
    empty = mi.BSDFSample3f()
    empty.wo, empty.pdf, empty.sampled_type = bs.wo, bs.pdf, bs.sampled_type
    return empty, weight


class SharesKept(adapter.ModelBSDF):
    """Draws lobes, and states densities, by the shares that the first call had; pdf has the present ones."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        valid, mixture, components, frame = self._mixture(ctx, si, active)
        if len(mixture.lobes) > 1:
            self.kept = getattr(self, "kept", mixture.probabilities)
            mixture.probabilities = self.kept
        return self._sample(valid, mixture, components, frame, sample1, sample2)


def takes_the_first_name(own, self, keys=()):
    """Keep two values, after an update the first one that is named alone."""
    own(self, keys)
    named = [name for name in TWO if name in keys][:1] if keys else TWO
    found = {name: dr.detach(self.textures[name].eval(dr.zeros(mi.SurfaceInteraction3f))) for name in named}
    self.kept = {**getattr(self, "kept", {}), **found}


def as_bright_as_kept(own, self, *given):
    value, pdf = own(self, *given)
    return value * sum(self.kept.values()), pdf


def no_number_in_the_horizon(ctx, si, wo):
    """Divides zero by zero where light comes along the surface."""
    return dr.select(si.wi.z == 0, mi.Float(dr.nan), 1)


def halved_for_a_mask(own, self, ctx, si, wo, active):
    """A type mask leaves the shares of lobes as they are."""
    every = ctx.type_mask == int(mi.BSDFFlags.All)
    return own(self, ctx, si, wo, active) * (1 if every else 0.5)


def about_the_normal(si, v):
    return mi.warp.square_to_cosine_hemisphere(v)


def stranger(name, *kinds, textures=(), begin=lambda self, props: None, draw=about_the_normal, **members):
    """The dict of a BSDF that knows nothing of this package, of components of some kinds, with textures, of which a
    dict has the defaults, and with the methods given; without values unless there is an ``eval_pdf``, which ``sample``
    has, too, for directions that a function of the surface point and two variates draws."""

    def init(self, props):
        mi.BSDF.__init__(self, props)
        for texture in textures:
            setattr(self, texture, props.get_texture(texture, textures[texture]))
        self.m_components = list(map(int, kinds))
        self.m_flags = reduce(or_, self.m_components)
        begin(self, props)

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.eta, bs.sampled_type = draw(si, sample2), 1, int(kinds[0]) & int(mi.BSDFFlags.All)
        value, bs.pdf = self.eval_pdf(ctx, si, bs.wo, active)
        return bs, dr.select(bs.pdf > 0, value / bs.pdf, 0)

    def traverse(self, callback):
        for texture in textures:
            callback.put(texture, getattr(self, texture), mi.ParamFlags.Differentiable)

    methods = {
        "__init__": init,
        "traverse": traverse,
        "sample": sample,
        "eval_pdf": lambda self, *given: (dr.zeros(mi.Spectrum), mi.Float(0)),
        "eval": lambda self, *given: self.eval_pdf(*given)[0],
        "pdf": lambda self, *given: self.eval_pdf(*given)[1],
    }
    mi.register_bsdf(name, type(name, (mi.BSDF,), methods | members))
    return {"type": name}


def wrapped(name, given, **methods):
    """The dict of a BSDF of Mitsuba's with other methods: each a function of its own, and of what is given."""
    inner = mi.load_dict(given)

    def method(name):
        change = methods.get(name, lambda own, *given: own(*given))
        return lambda self, *given: change(getattr(inner, name), *given)

    kinds = map(inner.flags, range(inner.component_count()))
    return stranger(name, *kinds, **{each: method(each) for each in {"sample", "eval", "pdf", "eval_pdf", *methods}})


def mirrored(ctx, si, active):
    """The samples of a mirror, and which of them carry light."""
    bs = dr.zeros(mi.BSDFSample3f)
    bs.wo, bs.eta, bs.sampled_type = mi.reflect(si.wi), 1, int(mi.BSDFFlags.DeltaReflection)
    lit = active & (si.wi.z > 0) & ctx.is_enabled(mi.BSDFFlags.DeltaReflection, 0)
    bs.pdf, bs.sampled_component = dr.select(lit, mi.Float(1), 0), mi.UInt32(0)
    return bs, lit


def ignored_mode(own, self, ctx, si, active):
    """Reflects light from an emitter as light from the camera."""
    radiance = mi.BSDFContext()
    radiance.component, radiance.type_mask = ctx.component, ctx.type_mask
    return own(self, radiance, si, active)


def cosines_in_light_tracing(ctx, si, wo):
    """Corrects for shading normals that there are none of."""
    return abs(si.wi.z) / dr.maximum(abs(wo.z), 1e-3) if ctx.mode == mi.TransportMode.Importance else 1


def flagged(change):
    """An adapter with other flags of its components, and of the whole."""

    class Mutant(adapter.ModelBSDF):
        def __init__(self, props):
            adapter.ModelBSDF.__init__(self, props)
            self.m_components, self.m_flags = change([int(it) for it in self.m_components], int(self.m_flags))

    return Mutant


def flagged_for_both_sides(components, flags):
    both = [it | int(mi.BSDFFlags.DiffuseTransmission) for it in components]
    return both, both[0]


def anisotropy_not_flagged(components, flags):
    other = ~int(mi.BSDFFlags.Anisotropic)
    return [it & other for it in components], flags & other


def exchanged_in_part(bs, weight, si, u):
    return dr.select(between(65, 75)(si.wi), 1 - bs.sampled_component, bs.sampled_component)


def off_in_the_yellow(bs, weight, si, u):
    yellow = (si.wavelengths > 560) & (si.wavelengths < 590) if mi.is_spectral else False
    return weight * dr.select(yellow, 0.9, 1)


class SumOfDensities(adapter.ModelBSDF):
    """The mixture's density leaves out the lobes' probabilities."""

    @staticmethod
    def _eval_pdf(valid, mixture, frame, wo):
        value, pdf = adapter.ModelBSDF._eval_pdf(valid, mixture, frame, wo)
        return value, pdf * len(mixture.lobes)


class SeenFromBehind(adapter.ModelBSDF):
    """Turns light from behind to the front, though its flags deny that."""

    @staticmethod
    def _turned(si):
        turned = mi.SurfaceInteraction3f(si)
        turned.wi = mi.Vector3f(si.wi.x, si.wi.y, abs(si.wi.z))
        return turned, dr.select(si.wi.z < 0, mi.Float(-1), 1)

    def sample(self, ctx, si, sample1, sample2, active=True):
        turned, side = self._turned(si)
        bs, weight = adapter.ModelBSDF.sample(self, ctx, turned, sample1, sample2, active)
        bs.wo = mi.Vector3f(bs.wo.x, bs.wo.y, bs.wo.z * side)
        return bs, weight

    def eval_pdf(self, ctx, si, wo, active=True):
        turned, side = self._turned(si)
        return adapter.ModelBSDF.eval_pdf(self, ctx, turned, mi.Vector3f(wo.x, wo.y, wo.z * side), active)


class OtherSharesDrawn(adapter.ModelBSDF):
    """Lobes are drawn alike, but the density has their shares."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        valid, mixture, components, frame = evaluated
        alike = Mixture(mixture.lobes, mixture.wi)
        alike.probabilities = [mi.Float(1 / len(mixture.lobes)) for _ in mixture.lobes]
        drawn = alike.sample(sample1, sample2)
        mixture.sample = lambda u, v: drawn
        return self._sample(valid, mixture, components, frame, sample1, sample2)


class ShareForgottenInOne(adapter.ModelBSDF):
    """The probability of the second lobe is left out of the density."""

    @staticmethod
    def _eval_pdf(valid, mixture, frame, wo):
        value, pdf = adapter.ModelBSDF._eval_pdf(valid, mixture, frame, wo)
        if len(mixture.lobes) < 2:
            return value, pdf
        second = mixture.lobes[1].eval_pdf(mixture.wi, frame.to_local(wo))[1] * (1 - mixture.probabilities[1])
        return value, pdf + dr.select(valid & (wo.z > 0), second, 0)


def half_attached(bs, weight, si, u):
    return 0.5 * (weight + dr.detach(weight))


def of_others(name, albedo=0.5, side=1, **members):
    """The dict of a Lambertian BSDF that knows nothing of this package, and is seen from one side."""

    def draw(si, v):
        return side * mi.warp.square_to_cosine_hemisphere(v)

    def eval_pdf(self, ctx, si, wo, active=True):
        pdf = dr.select(active & (side * si.wi.z > 0) & (side * wo.z > 0), side * wo.z * dr.inv_pi, 0)
        return mi.Spectrum(albedo * pdf), pdf

    seen = mi.BSDFFlags.FrontSide if side > 0 else mi.BSDFFlags.BackSide
    return stranger(name, mi.BSDFFlags.DiffuseReflection | seen, draw=draw, eval_pdf=eval_pdf, **members)


# --- The catalogue --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mutant:
    """A fault, and the checks of which each must fail."""

    name: str
    caught_by: tuple[str, ...]
    model: type
    methods: type = adapter.ModelBSDF
    given: tuple = ()

    def register(self) -> dict:
        """Make it a plugin of the active variant and of what checks load besides; its dict."""
        plugin = "mutant_" + self.name.replace(" ", "_")
        for variant in {mi.variant(), "scalar_rgb", "llvm_ad_spectral"}:
            module = importlib.import_module(f"mitsuba.{variant}")
            members = {k: v for base in reversed(self.methods.__mro__[:-1]) for k, v in vars(base).items()}
            members = {k: v for k, v in members.items() if k not in ("__dict__", "__weakref__")}
            made = type(self.model.__name__, (module.BSDF,), members | {"plugin_class": self.model})
            module.register_bsdf(plugin, made)
        return {"type": plugin, **dict(self.given)}


def mutant(name, caught_by, model, methods=adapter.ModelBSDF, **given):
    return Mutant(name, tuple(caught_by.split()), model, methods, tuple(given.items()))


UNLIMITED = Colour(0.5, (0, 10), "a colour without a limit to speak of")
TWO = {"diffuse_reflectance": 0.4, "specular_reflectance": 0.5}
RED = {"type": "rgb", "value": (0.6, 0.3, 0.1)}

MUTANTS = [
    mutant("pi forgotten in the denominator", "albedo", diffuse(lambda wi, wo: dr.pi)),
    mutant("pi twice in the denominator", "albedo", diffuse(lambda wi, wo: dr.inv_pi)),
    mutant("missing cosine", "reciprocity", diffuse(lambda wi, wo: 1 / wo.z)),
    mutant("missing factor four", "albedo", walter(changed(MicrofacetLobe, lambda wi, wo: 4)), alpha=0.3),
    mutant("density without pi", "pdf chi2", diffuse(density=lambda wi, wo: dr.pi)),
    mutant("uniform density of a cosine sampler", "chi2", lambert(UniformDensity)),
    mutant("uniform sampler of a cosine density", "chi2", lambert(UniformSampler)),
    mutant("a variate ignored", "chi2", lambert(drawn(LambertLobe, lambda wi, wo, u, v: warped(mi.Point2f(v.x, 0.3))))),
    mutant("normalisation of a power off by one", "pdf", phong(altered(PowerLobe, off_by_one)), exponent=30.0),
    mutant("density of the half vector", "pdf chi2", walter(changed(MicrofacetLobe, density=half_vector)), alpha=0.3),
    mutant(
        "density of the half vector, sharp",
        "pdf chi2",
        walter(changed(MicrofacetLobe, density=half_vector)),
        alpha=1e-3,
    ),
    mutant(
        "half of the samples lost",
        "pdf chi2",
        walter(drawn(MicrofacetLobe, lambda wi, wo, u, v: dr.select(v.x < 0.5, wo, -wo))),
        alpha=0.3,
    ),
    mutant("lobe probability omitted", "pdf components", phong(PowerLobe), SumOfDensities),
    mutant("weight not divided", "weight", Phong, sampled(weight=lambda bs, w, si, u: w * bs.pdf)),
    mutant("weight without eval's second cosine", "weight", Ward, evaluated(lambda ctx, si, wo: dr.maximum(wo.z, 0))),
    mutant("mask of one bit only", "components", Ward, adapted(_mixture=one_bit_of_the_mask)),
    mutant("shared by all", "updates", SharedByAll),
    mutant("brighter every other time", "calls", Lambert, adapted(eval_pdf=brighter_every_other_time)),
    mutant("darker where the world is turned", "calls", Lambert, evaluated(in_the_world)),
    mutant("attributes of any name", "calls", Lambert, adapted(has_attribute=lambda own, self, *given: mi.Bool(True))),
    mutant("texture of the last call", "calls", TextureKept, reflectance={"type": "checkerboard"}),
    mutant(
        "differentials not asked for", "flags", Lambert, evaluated(lambda ctx, si, wo: 1 + dr.squared_norm(si.duv_dx))
    ),
    mutant("density off for ten degrees of azimuth", "flags", diffuse(density=lit(azimuths(200, 210), 0.92))),
    mutant("not a number for exact mirror pairs", "finite", diffuse(sine_to_the_mirror)),
    mutant("eval_pdf without derivatives", "gradients", Lambert, adapted(eval_pdf=suspended, eval=with_derivatives)),
    mutant("eval_pdf at a fixed point", "textures", Lambert, adapted(eval_pdf=at_a_fixed_point, **ALONE)),
    mutant("eval_pdf in the world", "calls", Lambert, evaluated(in_the_world, **ALONE)),
    mutant("eval_pdf in one mode", "mode", Lambert, evaluated(brighter_from_lights, **ALONE)),
    mutant("eval_pdf_sample in one mode", "mode", Lambert, adapted(eval_pdf_sample=sampled_brighter_from_lights)),
    mutant("eval_pdf_sample without derivatives", "gradients", Lambert, adapted(eval_pdf_sample=suspended)),
    mutant("texture coordinates changed", "calls", Lambert, adapted(sample=tiled_in_place)),
    mutant("turned to the front", "calls", Lambert, adapted(eval=turned_to_the_front)),
    mutant("text of what there is not", "calls", Lambert, adapted(to_string=lambda own, self: self.title)),
    mutant("colours of wavelengths beside", "spectral", colour(beside)),
    mutant("direction lifted in place", "calls", Lambert, adapted(eval=lifted)),
    mutant("shares of the first call", "updates", Phong, SharesKept, **TWO),
    mutant("not a number in the horizon", "finite", Lambert, evaluated(no_number_in_the_horizon)),
    mutant("density of a mask", "components", Ward, adapted(pdf=halved_for_a_mask), **TWO),
    mutant("eval_pdf disagrees", "eval_pdf", Ward, PairDisagrees),
    mutant("mask forgotten", "components", Ward, adapted(_mixture=ignored_masks)),
    mutant("wrong component", "components", Ward, sampled(sampled_component=lambda bs, w, si, u: mi.UInt32(0))),
    mutant(
        "wrong type",
        "components",
        Ward,
        sampled(sampled_type=lambda bs, w, si, u: mi.UInt32(int(mi.BSDFFlags.DiffuseReflection))),
    ),
    mutant("flags of the whole", "components", Ward, flagged(lambda components, flags: (components, components[0]))),
    mutant("glossy flagged diffuse", "flags", phong(PowerFlaggedDiffuse), exponent=300.0),
    mutant("anisotropy not flagged", "flags", Ward, flagged(anisotropy_not_flagged), alpha_u=0.1, alpha_v=0.3),
    mutant("one-way shadowing", "reciprocity", walter(shadowing=OneSidedShadowing()), alpha=0.6),
    mutant("not a number at grazing", "finite", diffuse(lambda wi, wo: dr.sqrt(wo.z - 0.01) / dr.sqrt(wo.z - 0.01))),
    mutant("negative at grazing", "finite", diffuse(lambda wi, wo: 1 - 1.1 * dr.square(dr.square(1 - wo.z)))),
    mutant(
        "black at exactly normal incidence", "continuity", diffuse(where(lambda wi, wo: dr.maximum(wi.z, wo.z) == 1, 0))
    ),
    mutant("half of an azimuth", "continuity", diffuse(half_azimuths)),
    mutant("cut at grazing", "continuity", diffuse(where(lambda wi, wo: dr.minimum(wi.z, wo.z) < 4e-4, 1e-4))),
    mutant("mean of a texture", "textures", colour(lambda texture, si, active: texture.mean())),
    mutant("drawn as at a fixed point", "textures", Ward, adapted(sample=drawn_elsewhere), alpha=0.3),
    mutant("density zero where light is", "support", diffuse(density=towards(lambda w: w.z < 0.2, 0))),
    mutant("shines through", "horizon", Lambert, adapted(eval_pdf=shines_through)),
    mutant(
        "samples below the horizon",
        "horizon",
        Lambert,
        sampled(wo=lambda bs, w, si, u: dr.select(u < 0.1, bs.wo * [1, 1, -1], bs.wo)),
    ),
    mutant("gradient cut", "gradients", diffuse_value(lambda f, reflectance: dr.detach(f))),
    mutant(
        "gradient not a number", "gradients", diffuse_value(lambda f, r: f * (1 + 0.01 * dr.sqrt(dr.square(r - 0.5))))
    ),
    mutant("gradient of a film cut", "gradients", walter(FilmCutOff), int_ior=1.5, film_thickness=500.0),
    mutant("parameter baked in", "recompiles", BakedIn),
    mutant("density off for a quarter of the azimuths", "pdf", diffuse(density=lit(third_quadrant))),
    mutant("density off towards a quarter of the azimuths", "chi2", diffuse(density=shifted_between_quadrants)),
    mutant("density off from 40 to 50 degrees", "pdf", diffuse(density=lit(between(40, 50), 1.01))),
    mutant("density off towards 40 to 50 degrees", "chi2", diffuse(density=towards(between(40, 50)))),
    mutant("density off above 81 degrees", "pdf", diffuse(density=lit(between(81, 90), 1.01))),
    mutant("density off towards more than 81 degrees", "pdf", diffuse(density=towards(between(81, 90), 1.1))),
    mutant("samples lost from 40 to 50 degrees", "pdf", lambert(drawn(LambertLobe, lost_at_forty_five))),
    mutant("one way for a quarter of the azimuths", "reciprocity", diffuse(lit(third_quadrant, 1.02))),
    mutant(
        "density off for two directions of a thousand",
        "chi2",
        diffuse(density=towards(lambda w: dr.square(w.z) > 0.998, 1.5)),
    ),
    mutant("energy gained in blue", "albedo", diffuse(lambda wi, wo: mi.Color3f(1, 1, 1.2)), reflectance=0.9),
    mutant("energy gained at grazing", "albedo", diffuse(lambda wi, wo: 1 + dr.power(1 - wi.z, 20)), reflectance=0.7),
    mutant(
        "energy gained across the scratches",
        "albedo",
        walter(changed(MicrofacetLobe, lambda wi, wo: (1 + 2 * wi.y**4) * (1 + 2 * wo.y**4))),
        alpha_u=0.3,
        alpha_v=0.1,
        specular_reflectance=0.5,
    ),
    mutant("not a number straight back", "finite", diffuse(nothing_over_nothing)),
    mutant(
        "cut a quarter of a degree above the horizon",
        "continuity",
        diffuse(where(lambda wi, wo: dr.minimum(wi.z, wo.z) < 5e-3, 1e-2)),
    ),
    mutant("seen from behind", "horizon", Lambert, SeenFromBehind),
    mutant("eta of zero", "components", Lambert, sampled(eta=lambda bs, w, si, u: mi.Float(0))),
    mutant("eta of glass", "components", Ward, sampled(eta=lambda bs, w, si, u: mi.Float(1.5))),
    mutant("other component from 65 to 75 degrees", "components", Ward, sampled(sampled_component=exchanged_in_part)),
    mutant(
        "weight at most one",
        "weight",
        Ward,
        sampled(weight=lambda bs, w, si, u: dr.minimum(w, 1)),
        variant="ward",
        specular_reflectance=1.0,
    ),
    mutant(
        "channels exchanged in the weight",
        "weight",
        Lambert,
        sampled(weight=lambda bs, w, si, u: mi.Color3f(w.z, w.x, w.y)),
        reflectance=RED,
    ),
    mutant(
        "density of sample off at grazing",
        "weight",
        Ward,
        sampled(pdf=lambda bs, w, si, u: bs.pdf * lit(between(82, 88), 1.02)(si.wi, 0)),
    ),
    mutant("half floats", "weight eval_pdf", Ward, adapted(eval=half_floats)),
    mutant("variate used twice", "chi2", Phong, adapted(sample=one_variate_for_both), **TWO),
    mutant("lobes drawn by other shares", "chi2", Phong, OtherSharesDrawn),
    mutant("probability omitted of one lobe", "pdf chi2", Phong, ShareForgottenInOne),
    mutant("turned by a degree", "chi2", phong(drawn(PowerLobe, turned(math.radians(1)))), exponent=300.0),
    mutant(
        "alphas swapped for a quarter of the azimuths",
        "chi2",
        ward(altered(MicrofacetLobe, swapped_beyond)),
        alpha_u=0.2,
        alpha_v=0.3,
    ),
    mutant(
        "density of the half vector if anisotropic",
        "pdf",
        walter(altered(MicrofacetLobe, half_vector_if_anisotropic)),
        alpha_u=0.3,
        alpha_v=0.31,
    ),
    mutant("eval_pdf_sample exchanges variates", "eval_pdf", Ward, adapted(eval_pdf_sample=exchanged_variates)),
    mutant("v ignored", "textures", elsewhere(lambda uv: mi.Point2f(uv.x, 0.5))),
    mutant("u and v exchanged", "textures", elsewhere(lambda uv: mi.Point2f(uv.y, uv.x))),
    mutant("clamped to the unit square", "textures", elsewhere(lambda uv: dr.clip(uv, 0, 1))),
    mutant(
        "given texture at a fixed point",
        "textures",
        elsewhere(lambda uv: mi.Point2f(0)),
        reflectance={"type": "checkerboard"},
    ),
    mutant("eval_pdf_sample at a fixed point", "textures", Ward, adapted(eval_pdf_sample=at_a_fixed_point), alpha=0.3),
    mutant("half a texel off", "textures", elsewhere(lambda uv: mi.Point2f(uv.x + 0.5 / 3, uv.y))),
    mutant(
        "reflectance at a fixed point",
        "textures",
        Lambert,
        reflectance(lambda value: value, lambda si: dr.zeros(mi.SurfaceInteraction3f)),
    ),
    mutant("derivative twice as large", "gradients", diffuse_value(lambda f, reflectance: 2 * f - dr.detach(f))),
    mutant(
        "root at normal incidence",
        "gradients",
        diffuse(lambda wi, wo: 1 + 0.01 * root_at_normal(wi) * root_at_normal(wo)),
    ),
    mutant(
        "root at normal incidence in the density",
        "gradients",
        Lambert,
        evaluated(density=lambda ctx, si, wo: 1 + 1e-6 * root_at_normal(si.wi)),
    ),
    mutant(
        "derivatives of exchanged channels",
        "gradients",
        with_derivative(lambda value, *_: mi.Color3f(value.z, value.y, value.x)),
        reflectance=RED,
    ),
    mutant(
        "derivative of the mean in all channels",
        "gradients",
        with_derivative(lambda value, *_: mi.Color3f(dr.mean(value))),
        reflectance=RED,
    ),
    mutant("derivative of the wrong sign backward", "gradients", backward(lambda grad: -grad)),
    mutant(
        "derivatives of exchanged channels backward",
        "gradients",
        backward(lambda grad: mi.Color3f(grad.z, grad.y, grad.x)),
        reflectance=RED,
    ),
    mutant(
        "derivative for directions of the wrong sign backward",
        "gradients",
        diffuse(lambda wi, wo: 0.4 + 0.6 * dr.custom(Backward, wi.z * wo.z, lambda grad: -grad)),
    ),
    mutant("weight detached", "gradients", Lambert, sampled(weight=lambda bs, w, si, u: dr.detach(w))),
    mutant("weight with half of its derivative", "gradients", Phong, sampled(weight=half_attached)),
    mutant("inactive lanes evaluated", "active", Ward, masked("eval_pdf")),
    mutant("inactive lanes sampled", "active", Lambert, masked("sample")),
    mutant("inactive lanes evaluated and sampled at once", "active", Lambert, masked("eval_pdf_sample")),
    mutant("reflectance of inactive lanes", "active", Lambert, masked("eval_diffuse_reflectance")),
    mutant("active lanes dropped", "active", Lambert, masked("eval_pdf", lambda active: dr.all(mi.Bool(active)))),
    mutant("derivatives of inactive lanes", "active", Lambert, adapted(eval_pdf=leaked_derivative)),
    mutant(
        "stuck beyond a limit", "gradients", colour(lambda texture, si, active: dr.clip(texture.eval(si, active), 0, 1))
    ),
    mutant("evaluated beyond a limit", "gradients", colour(lambda texture, si, active: texture.eval(si, active))),
    mutant("led out of its range", "gradients", colour(outwards)),
    mutant(
        "colours clipped in spectral variants",
        "spectral",
        in_spectra(lambda value, nm: dr.minimum(value, 1), reflectance=UNLIMITED),
    ),
    mutant("brighter in spectral variants", "spectral", in_spectra(lambda value, nm: value * 1.02)),
    mutant("brighter below 420 nm", "spectral", in_spectra(lambda value, nm: value * dr.select(nm < 420, 1.3, 1))),
    mutant("weight off from 560 to 590 nm", "spectral", Lambert, sampled(weight=off_in_the_yellow)),
    mutant(
        "wavelengths exchanged",
        "spectral",
        in_spectra(lambda value, nm: type(value)(value[1], value[0], value[2], value[3])),
    ),
    mutant("red and blue exchanged", "colours", colour(red_and_blue_exchanged)),
    mutant("red and blue of one colour exchanged", "colours", OneOfTwoColoursExchanged, **TWO),
    mutant("grey weights", "colours", Lambert, sampled(weight=lambda bs, w, si, u: greyed(w))),
    mutant("grey of eval_pdf", "colours", Lambert, adapted(eval_pdf=greyed_pair)),
    mutant("grey in light tracing", "colours", Lambert, adapted(eval=greyed_in_light_tracing)),
    mutant("grey reflectance", "colours", Lambert, reflectance(greyed)),
    mutant(
        "first of the names alone",
        "updates",
        Phong,
        adapted(parameters_changed=takes_the_first_name, eval_pdf=as_bright_as_kept),
        **TWO,
    ),
    mutant("keys exchanged", "updates", Phong, adapted(traverse=exchanged_keys), **TWO),
    mutant("weighed as before an update", "updates", Lambert, adapted(sample=weighs_as_before)),
    mutant("sampled as before an update", "updates", Phong, adapted(sample=follows_no_update), **TWO, exponent=30.0),
    mutant("brightness of other lanes", "textures", colour(as_bright_as_others)),
    mutant("values asked for", "recorded", Ward, adapted(eval_pdf=asks_for_values)),
    mutant("another value for one lane", "recorded", Ward, adapted(eval_pdf=brighter_for_one_lane)),
    mutant("flagged for both sides", "flags", Lambert, flagged(flagged_for_both_sides)),
    mutant("mode ignored", "mode", lambert(OneWayAndSaysSo), adapted(_mixture=ignored_mode)),
    mutant("drawn otherwise from lights", "mode", Ward, adapted(sample=drawn_otherwise_from_lights), alpha=0.3),
    mutant("cosines in light tracing", "mode", Lambert, evaluated(cosines_in_light_tracing)),
    mutant("twice the reflectance", "reflectance", Ward, reflectance(lambda value: 2 * value)),
    mutant("reflectance over pi", "reflectance", Lambert, reflectance(lambda value: value * dr.inv_pi)),
]
