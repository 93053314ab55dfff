"""Local illumination, as in the textbooks' shading formulas."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..math import Spectrum, clamp, select
from ..model import Plugin
from ..parameters import Choice, Colour, Flag, ParameterError, PropertyReader
from ..parameters.messages import listed
from ..variants import is_scalar


class Radiance(Colour):
    """A colour of light."""

    dark: bool
    """Whether the bound value is a literal zero."""

    def bind(self, reader: PropertyReader) -> Radiance:
        texture = reader.colour(self.name, self.default or 0, self.limits)
        # Not from the texture: evaluating it may wait for a thread that loads a BSDF, and waits for Python.
        values = reader.colour_values(self.name) if self.name in reader else [self.default]
        dark = values is not None and not any(values)
        if not dark:  # in spectral variants, black is no emission spectrum
            texture = reader.props.get_emissive_texture(self.name)
        return self.replace(textures={self.name: texture}, ranges={self.name: self.limits}, dark=dark)


class Shading(Plugin):
    """Local illumination: the textbooks' shading of a scene, where ``path`` traces light.

    B. T. Phong, Illumination for computer generated pictures, Communications of the ACM 18(6), 1975,
    doi:10.1145/360825.360839, for the sum; E. Reinhard, M. Stark, P. Shirley and J. Ferwerda, Photographic tone
    reproduction for digital images, SIGGRAPH 2002, doi:10.1145/566570.566575, for ``tonemap``.

        I = k_a I_a + Σ V π f cosθ_o L + ρ_m L_env(r),    summed over the lights

    at the first surface along a ray: nothing is reflected twice. f is the surface's BRDF, from this pack or built-in; L
    is the light's irradiance at normal incidence, for a point the intensity over the squared distance, and V its
    visibility. Lights are visible themselves.

    * π belongs to the light: a light of L = 1 straight above makes Lambert's surface as bright as its albedo. So the
      formulas that were never BRDFs come out as printed: ``original`` of ``phong`` and ``blinnphong``, ``none`` of
      ``minnaert``, ``toon`` and ``wrap`` (whose light from behind needs ``domain`` = sphere, and no shadows). It
      belongs to every light, so that the result is π times the direct light of ``path``; with ``pi_folded`` = false
      both are the same.
    * k_a is the diffuse reflectance, π f of the diffuse lobes seen and lit along the normal: the scale ρ or ρd of the
      formulas above, also where they are nested. Built-in BSDFs use their own ``eval_diffuse_reflectance``.
    * ``environment_reflection`` looks up the environment in the mirror direction r, ignoring objects in between. ρ_m is
      the specular colour times the Fresnel reflectance at r. The environment then lights only the diffuse lobes: the
      look-up replaces its reflection by the others. Built-in BSDFs and measured data have no ρ_m, nor have ours nested
      in built-ins, except in ``twosided``: the environment lights them as ever, and a warning names them.
    * At the end, ``tonemap`` = reinhard maps each channel x of a pixel to x/(1+x), and ``clamp`` cuts off values above
      1, of which reinhard leaves none.

    Rays go through pixel centres, except that those of an ``irradiancemeter`` spread over it, and those of a
    ``thinlens`` over its aperture. So if all lights are points, spots or directional, or area lights that shine from
    their centre (rectangles, disks or spheres, from outside), a picture of other sensors in rgb or mono is the same for
    any seed and number of samples; for smooth edges, render larger and scale down. Each sample draws one point of other
    area lights and of environments, and spectral variants draw wavelengths. The tone map and the clamp apply to the
    mean of all samples of a pixel, however many passes draw them. Within ``aov`` the rays are that integrator's, and
    they apply to each sample.

    Light passes straight through surfaces as far as their BSDFs allow (``null``, ``mask``, ``thindielectric``, and
    ``blendbsdf`` of them): objects behind are visible, and shadows are lighter by as much. ``dielectric`` is opaque.
    Participating media are ignored: behind a ``null`` boundary, space is empty.

    Differentiable in the parameters of BSDFs and lights and in ``ambient``, by ``mi.render``; not in parameters that
    move edges. Where ``clamp`` cuts off, the derivative is that of the value before, which leads an optimiser back.

    Example
    -------
    <integrator type="shading">
        <rgb name="ambient" value="0.1, 0.1, 0.12"/>
        <boolean name="shadows" value="false"/>
    </integrator>

    {"type": "shading", "ambient": {"type": "rgb", "value": [0.1, 0.1, 0.12]}, "shadows": False}
    """

    ambient = Radiance(0, (0, float("inf")), "ambient light I_a, as a surface of k_a = 1 reflects it")
    pi_folded = Flag(True, "whether π belongs to the light")
    shadows = Flag(True, "whether surfaces shadow each other, and themselves")
    area_lights = Choice(("sample", "centre"), "whether area lights shine from a random point or from their centre")
    environment_reflection = Flag(False, "whether the environment is mirrored")
    clamp = Flag(True, "whether values above 1 are cut off")
    tonemap = Choice(("none", "reinhard"), "tone mapping of a pixel, before the clamp")

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.warned = False

    def shade(self, scene: mi.Scene, sampler: mi.Sampler, ray: mi.Ray3f, active: mi.Bool) -> tuple[Spectrum, mi.Float]:
        """Return ``(radiance, opacity)`` along a ray: the formula above for the first surface and those seen through
        it, and how much they hide of what is behind. An environment hides everything."""
        self._check(scene)
        spectrum, veils = mi.UnpolarizedSpectrum, may_pass(scene)

        def layer(
            sampler: mi.Sampler, ray: mi.Ray3f, radiance: Spectrum, through: Spectrum, active: mi.Bool
        ) -> tuple[Any, ...]:
            si = scene.ray_intersect(ray, active)
            hit = select(si.is_valid(), active, False)
            here = self._seen(scene, sampler, si, hit, active, veils)
            radiance = spectrum(radiance + select(active, through * here, 0))
            passed = null_transmission(si, hit) if veils else spectrum(0)
            through = spectrum(select(hit, through * passed, through))
            return sampler, si.spawn_ray(ray.d), radiance, through, select(dr.any(through > 0), hit, False)

        state = (sampler, mi.Ray3f(ray), spectrum(0), spectrum(1), mi.Bool(active))
        _, _, radiance, through, _ = dr.while_loop(state, lambda *state: state[-1], layer) if veils else layer(*state)
        return radiance, mi.Float(1) if scene.environment() is not None else 1 - dr.max(through)

    def finish(self, colour: Spectrum) -> Spectrum:
        """Return the final colour of a pixel."""
        if self.tonemap == "reinhard":
            colour = colour / (1 + colour)
        return clamp(colour, 0, 1) if self.clamp else colour

    def _check(self, scene: mi.Scene) -> None:
        """Raise if there is nothing to shade with, and warn once about BSDFs without mirror reflectance."""
        ambient = self.parameters["ambient"]
        if not scene.emitters() and isinstance(ambient, Radiance) and ambient.dark:
            raise ParameterError("shading: the scene has no light; add an emitter to it, or give ambient.")
        if self.environment_reflection and scene.environment() is None:
            raise ParameterError("shading: environment_reflection needs an environment; add an envmap or constant.")
        if self.environment_reflection and not self.warned:
            self.warned = True
            shiny = int(mi.BSDFFlags.GlossyReflection) | int(mi.BSDFFlags.DeltaReflection)
            found = [it for it in bsdfs_of(scene) if int(it.flags()) & shiny and not mirrors(it)]
            dull = {it.model.plugins[0] if hasattr(it, "model") else it.class_name() for it in found}
            if dull:
                warnings.warn(
                    f"shading: no mirror reflectance is known for {listed(sorted(dull), 'and')}; "
                    "environment_reflection has no effect there.",
                    stacklevel=2,
                )

    def _seen(
        self,
        scene: mi.Scene,
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        hit: mi.Bool,
        active: mi.Bool,
        veils: bool,
    ) -> Spectrum:
        """Return the radiance of an intersection, or of the environment: emitted and reflected."""
        colour = mi.UnpolarizedSpectrum(0)
        emitter = si.emitter(scene, active)
        if emitter is not None:
            colour += mi.unpolarized_spectrum(emitter.eval(si, active))
        if hit is not False and scene.shape_types():  # otherwise there is no BSDF to evaluate
            colour += select(hit, self._reflected(scene, sampler, si, hit, veils), 0)
        return colour

    def _reflected(
        self, scene: mi.Scene, sampler: mi.Sampler, si: mi.SurfaceInteraction3f, hit: mi.Bool, veils: bool
    ) -> Spectrum:
        bsdf = si.bsdf()
        colour = self.evaluate(si, hit).ambient * of_each(diffuse_reflectance, bsdf, si, hit)
        mirrored = mi.Bool(False)
        if self.environment_reflection:
            reflectance, mirrored = of_each(mirror_reflectance, bsdf, si, hit)
            towards = dr.zeros(mi.SurfaceInteraction3f)
            towards.wi = -si.to_world(mi.reflect(si.wi))
            towards.time, towards.wavelengths = si.time, si.wavelengths
            colour += reflectance * mi.unpolarized_spectrum(scene.environment().eval(towards, hit))
        for light in scene.emitters():
            ds, irradiance = light.sample_direction(si, self._place(light, sampler), hit)
            irradiance, lit = mi.unpolarized_spectrum(irradiance), select(ds.pdf > 0, hit, False)
            if self.area_lights == "centre":
                irradiance *= mean_cosine(light, ds)
            if self.shadows and veils:
                through = straight_through(scene, si, ds, light, lit)
                irradiance, lit = irradiance * through, select(dr.any(through > 0), lit, False)
            elif self.shadows:
                lit = select(scene.ray_test(ray_to(light, si, ds), lit), False, lit)
            wo = si.to_local(ds.d)
            value = bsdf.eval(mi.BSDFContext(), si, wo, lit)
            if self.environment_reflection and light.is_environment():
                value = dr.select(mirrored, bsdf.eval(only_diffuse(), si, wo, lit), value)
            value = mi.unpolarized_spectrum(value) * irradiance
            colour += select(lit, value * (dr.pi if self.pi_folded else 1), mi.UnpolarizedSpectrum(0))
        return colour

    def _place(self, light: mi.Emitter, sampler: mi.Sampler) -> mi.Point2f:
        """Return the sample with which to sample a light's direction."""
        flags = mi.EmitterFlags
        if mi.has_flag(light.flags(), flags.DeltaPosition) or mi.has_flag(light.flags(), flags.DeltaDirection):
            return mi.Point2f(0.5)
        if self.area_lights == "centre" and not light.is_environment():
            return centre(light)
        return sampler.next_2d()


CENTRES = {"Rectangle": (0.5, 0.5), "Disk": (0.5, 0.5), "Sphere": (0, 0)}
"""The sample that yields the centre of a shape; a sphere samples the cone that it subtends."""


def centre(light: mi.Emitter) -> mi.Point2f:
    """Return the sample that yields the centre of an area light."""
    kind, inward = light.get_shape().class_name(), light.get_shape().has_flipped_normals()
    for refused, known in (
        (kind not in CENTRES, f"{listed(list(CENTRES), 'and')}, but a light is a {kind}"),
        (mi.has_flag(light.flags(), mi.EmitterFlags.SpatiallyVarying),
         "lights of one radiance, but that of a light is a texture"),
        (kind == "Sphere" and inward, "spheres that shine outward, but a light is one that shines inward"),
    ):  # fmt: skip
        if refused:
            raise ParameterError(f'shading: area_lights = "centre" knows {known}; use area_lights = "sample".')
    return mi.Point2f(*CENTRES[kind])


def mean_cosine(light: mi.Emitter, ds: mi.DirectionSample3f) -> mi.Float:
    """Return the factor from a light's sample to its irradiance at normal incidence: for a sphere, the mean cosine over
    its cone, (1 + cosθ_max) / 2, as the sample is the axis alone; its density is 1 / (2π (1 - cosθ_max))."""
    shape = light.get_shape()
    if shape is None or shape.class_name() != "Sphere":
        return mi.Float(1)
    return 1 - 1 / (4 * dr.pi * dr.maximum(ds.pdf, dr.inv_two_pi))


# --- Occlusion ---------------------------------------------------------------------------------------------


def ray_to(light: mi.Emitter, si: mi.SurfaceInteraction3f, ds: mi.DirectionSample3f) -> mi.Ray3f:
    """Return the ray from a surface to a light, sampled as ``ds``."""
    # Nothing lies beyond these; and their position is unknown if Mitsuba lost the scene's bounds, as when it merges
    # rectangles.
    infinite = mi.has_flag(light.flags(), mi.EmitterFlags.Infinite)
    return si.spawn_ray(ds.d) if infinite else si.spawn_ray_to(ds.p)


def straight_through(
    scene: mi.Scene, si: mi.SurfaceInteraction3f, ds: mi.DirectionSample3f, light: mi.Emitter, active: mi.Bool
) -> Spectrum:
    """Return the fraction of a light that the surfaces between it and ``si`` let straight through."""

    def step(ray: mi.Ray3f, through: Spectrum, active: mi.Bool) -> tuple[Any, ...]:
        met = scene.ray_intersect(ray, active)
        active = select(met.is_valid(), active, False)
        through = mi.UnpolarizedSpectrum(select(active, through * null_transmission(met, active), through))
        return ray_to(light, met, ds), through, select(dr.any(through > 0), active, False)

    state = (ray_to(light, si, ds), mi.UnpolarizedSpectrum(1), mi.Bool(active))
    return dr.while_loop(state, lambda *state: state[-1], step)[1]


def null_transmission(si: mi.SurfaceInteraction3f, active: mi.Bool) -> Spectrum:
    if active is False:  # there may be no BSDF
        return mi.UnpolarizedSpectrum(0)
    return mi.unpolarized_spectrum(si.bsdf().eval_null_transmission(si, active))


def may_pass(scene: mi.Scene) -> bool:
    """Return whether light may pass straight through some surface: always in scalar variants, which can ask each."""
    if is_scalar():
        return True
    return any(mi.has_flag(it.flags(), mi.BSDFFlags.Null) for it in bsdfs_of(scene))


def bsdfs_of(scene: mi.Scene) -> list[Any]:
    """Return the BSDFs of a scene's shapes, including those in shape groups."""
    shapes = children(scene, mi.Shape)
    grouped = [it for shape in shapes for it in children(shape, mi.Shape)]
    return [shape.bsdf() for shape in [*scene.shapes(), *grouped]]


# --- Reflectances ---------------------------------------------------------------------------------------------


def of_each(function: Callable[..., Any], bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Any:
    """Return ``function(bsdf, si, active)``, where vectorized variants have many BSDFs at once."""
    return function(bsdf, si, active) if isinstance(bsdf, mi.BSDF) else dr.dispatch(bsdf, function, si, active)


def diffuse_reflectance(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Spectrum:
    """Return k_a: for our BSDFs, also nested ones, from their diffuse lobes, as their ``eval_diffuse_reflectance``
    includes the others."""
    kind, inner = bsdf.class_name(), children(bsdf, mi.BSDF)
    if kind in ("BumpMap", "NormalMap"):  # along their own normal
        return diffuse_reflectance(inner[0], si, active)
    if kind == "MaskBSDF":  # whose eval_null_transmission knows of masks in it
        (opacity,) = children(bsdf, mi.Texture)
        return clamp(opacity.eval_1(si, active), 0, 1) * diffuse_reflectance(inner[0], si, active)
    if kind == "TwoSidedBRDF":
        seen = mi.SurfaceInteraction3f(si)
        seen.wi = mi.Vector3f(si.wi.x, si.wi.y, abs(si.wi.z))
        front, back = (diffuse_reflectance(it, seen, active) for it in (inner[0], inner[-1]))
        return select(si.wi.z > 0, front, back)
    if kind == "BlendBSDF":
        (weight,) = children(bsdf, mi.Texture)
        first, second = (diffuse_reflectance(it, si, active) for it in inner)
        return dr.lerp(first, second, clamp(weight.eval_1(si, active), 0, 1))
    if not hasattr(bsdf, "model"):
        return mi.unpolarized_spectrum(bsdf.eval_diffuse_reflectance(si, active))
    normal = mi.Vector3f(0, 0, dr.select(si.wi.z > 0, 1, -1))
    upright = mi.SurfaceInteraction3f(si)
    upright.wi = normal
    return dr.pi * mi.unpolarized_spectrum(bsdf.eval(only_diffuse(), upright, normal, active))


def mirror_reflectance(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[Spectrum, mi.Bool]:
    """Return ``(ρ_m, known)``, zero for a BSDF that does not know its own."""
    total = mi.UnpolarizedSpectrum(0)
    inner = mirrors(bsdf)
    if not inner:
        return total, mi.Bool(False)
    seen = mi.SurfaceInteraction3f(si)
    for side, it in zip((1, -1), inner, strict=False):
        seen.wi = mi.Vector3f(si.wi.x, si.wi.y, side * si.wi.z)
        total += it.mirror_reflectance(seen, active)
    return mi.UnpolarizedSpectrum(total), mi.Bool(True)


def mirrors(bsdf: mi.BSDF) -> list[Any]:
    """Return our BSDFs that make up a BSDF, front side first, if they know what they mirror: itself, or those in
    ``twosided``."""
    inner = [bsdf]
    if bsdf.class_name() == "TwoSidedBRDF":
        inner = children(bsdf, mi.BSDF)
    return inner if all(getattr(it, "is_mirror", False) for it in inner) else []


def only_diffuse() -> mi.BSDFContext:
    ctx = mi.BSDFContext()
    ctx.type_mask = mi.BSDFFlags.DiffuseReflection
    return ctx


def children(parent: mi.Object, kind: type[mi.Object]) -> list[Any]:
    """Return the objects of a kind in another."""

    class Collector(mi.TraversalCallback):
        def __init__(self) -> None:
            mi.TraversalCallback.__init__(self)
            self.objects: list[Any] = []

        def put(self, name: str, value: Any, flags: int, cpptype: Any = None) -> None:
            if isinstance(value, kind):
                self.objects.append(value)

    found = Collector()
    parent.traverse(found)
    return found.objects
