"""The adapter between models and Mitsuba: the only place that knows ``mi.BSDF``."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..lobes import Lobe, Mixture
from ..math import clamp, select
from ..model import Model, Plugin, Values, warn_once
from ..parameters import Rotation
from ..parameters.colours import evaluate_colour
from ..variants import is_scalar


def variant_class(plugin: type[Plugin], adapter: type, base: type) -> type:
    """Return the class of a plugin for one variant, whose ``mi.BSDF`` or ``mi.SamplingIntegrator`` is ``base``.

    Each variant has its own base class, and the bindings allow only one: so the methods, which work in every variant,
    are written once, in an ``adapter``, and copied to each class.
    """
    methods = {name: value for name, value in vars(adapter).items() if name not in ("__dict__", "__weakref__")}
    return type(plugin.__name__, (base,), {**methods, "plugin_class": plugin})


class ModelBSDF:
    """A model as a BSDF. Each of its lobes is a component."""

    plugin_class: type[Model]

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        self.model = self.plugin_class(props)
        if excess := self.model.excess(self.model.constants):
            warn_once(f"{self.model.plugins[0]}: {excess}.")
        # A member, too: Dr.Jit looks for what a frozen function reads among a BSDF's members and their lists and dicts,
        # but not in other Python objects.
        self.textures, self.captured = self.model.textures, self.model.captured
        declared = self.model.parameters.items()
        self.rotation = next((name for name, it in declared if isinstance(it, Rotation)), None)
        self.shapes = {name: dr.shape(it) for name, it in self.model.arrays.items()}

        flags = mi.BSDFFlags
        common = flags.FrontSide
        if any(texture.is_spatially_varying() for texture in self.textures.values()):
            common |= flags.SpatiallyVarying
        self.lobe_kinds: list[tuple[bool, bool, bool]] = []
        self.kinds, self.transmits, components = [], [], []
        lobes = self._lobes(self.model.placeholders())
        self.is_mirror = all(type(it).mirror_reflectance is not Lobe.mirror_reflectance for it in lobes if it.glossy)
        for lobe in lobes:
            if lobe.transmits:
                kind = flags.GlossyTransmission if lobe.glossy else flags.DiffuseTransmission
            else:
                kind = flags.GlossyReflection if lobe.glossy else flags.DiffuseReflection
            component = kind | common
            if lobe.glossy and lobe.anisotropic:
                component |= flags.Anisotropic
            if not lobe.reciprocal:
                component |= flags.NonSymmetric
            self.kinds.append(kind)
            self.transmits.append(lobe.transmits)
            components.append(int(component))
        self.m_components = components
        self.m_flags = 0
        for component in components:
            self.m_flags |= component
        self.parameters_changed()

    # --- Evaluation and sampling ------------------------------------------------------------------------------------

    def _lobes(self, p: Values) -> tuple[Lobe, ...]:
        """Return the model's lobes, which must be of the kinds that the components were made for."""
        self.model.uniform.compare(self.model.textures)
        name, lobes = type(self.model).__name__, self.model.lobes(p)
        if not isinstance(lobes, (tuple, list)) or not all(isinstance(lobe, Lobe) for lobe in lobes):
            raise TypeError(f"{name}.lobes returns {lobes!r}; it must return a tuple of lobes.")
        kinds = [(lobe.glossy, lobe.transmits, lobe.reciprocal) for lobe in lobes]
        if not self.lobe_kinds:
            self.lobe_kinds = kinds
        if kinds != self.lobe_kinds:
            raise TypeError(
                f"{name}.lobes returns {len(kinds)} lobes where it returned {len(self.lobe_kinds)}, or others; their "
                "number and kinds may depend on choices and on which parameters are given, but not on values."
            )
        return lobes

    def _mixture(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, active: mi.Bool
    ) -> tuple[mi.Bool, Mixture, list[int], LobeFrame] | None:
        """Return ``(valid, mixture, components, frame)``: the lobes that the context enables, seen from si.wi."""
        components = [k for k, kind in enumerate(self.kinds) if ctx.is_enabled(kind, k)]
        if not components:
            return None
        from_light = ctx.mode == mi.TransportMode.Importance
        transmits = [from_light and self.transmits[k] for k in components]
        # The viewer is in front; so is wi, unless it leads to a light behind a transmitting lobe.
        front = si.wi.z != 0 if any(transmits) else si.wi.z > 0
        valid = select(si.wi.z < 0 if all(transmits) else front, active, False)
        if valid is False:
            return None
        p = self.model.evaluate(si, valid)
        turn = getattr(p, self.rotation) if self.rotation else None
        frame = LobeFrame(turn, select(si.wi.z < 0, valid, False) if any(transmits) else None)
        # Replace wi in inactive lanes by a valid direction: a NaN would enter the derivatives.
        wi = frame.to_local(select(valid, si.wi, mi.Vector3f(0, 0, 1)))
        lobes = self._lobes(p)
        enabled = [lobes[k].adjoint() if from_light else lobes[k] for k in components]
        return valid, Mixture(enabled, wi, frame.mirrored), components, frame

    @staticmethod
    def _eval_pdf(valid: mi.Bool, mixture: Mixture, frame: LobeFrame, wo: mi.Vector3f) -> tuple[mi.Spectrum, mi.Float]:
        value, pdf, z = mi.Spectrum(0), mi.Float(0), frame.mirror(wo).z
        for transmitted in sorted({lobe.transmits for lobe in mixture.lobes}):
            here = select(z < 0 if transmitted else z > 0, valid, False)
            if frame.mirrored is not None:
                here = select(frame.mirrored, here, False) if transmitted else select(frame.mirrored, False, here)
            if here is False:
                continue
            harmless = frame.mirror(mi.Vector3f(0, 0, -1 if transmitted else 1))
            local = frame.to_local(select(here, wo, harmless))
            axes = frame.stokes_axes(mixture.wi, local) if mi.is_polarized else ()
            side = mixture.eval_pdf(local, transmitted, *axes)
            value, pdf = value + select(here, side[0], 0), pdf + select(here, side[1], 0)
        # A density belongs to the estimator, as the sampled direction does, and has no derivative either: those of
        # integrals are then unbiased within every BSDF and integrator that divides by it.
        return value, dr.detach(pdf) if dr.is_diff_v(pdf) else pdf

    def _sample(
        self, valid: mi.Bool, mixture: Mixture, components: list[int], frame: LobeFrame, u: mi.Float, v: mi.Point2f
    ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
        bs = mi.BSDFSample3f()
        wo, index = mixture.sample(u, v)
        wo = frame.to_world(wo)
        if dr.is_diff_v(mi.Float) and dr.grad_enabled(wo):
            # Differentiate the estimator f/pdf of a fixed direction, not the direction: then an unbiased gradient needs
            # no derivative of the choice among lobes, nor of what the direction hits.
            wo = dr.detach(wo)
        value, pdf = self._eval_pdf(valid, mixture, frame, wo)
        # Drop samples that are hardly ever drawn: the derivatives of their weights would overflow.
        drawn = pdf > 1e-15
        weight = value / select(drawn, pdf, 1)

        bs.wo, bs.pdf, bs.eta = wo, pdf, 1
        component, kind = mi.UInt32(components[0]), mi.UInt32(int(self.kinds[components[0]]))
        for k, c in enumerate(components[1:], start=1):
            component = dr.select(index == k, c, component)
            kind = dr.select(index == k, int(self.kinds[c]), kind)
        bs.sampled_component, bs.sampled_type = component, kind
        return bs, select(drawn, weight, mi.Spectrum(0))

    def sample(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, sample1: Any, sample2: Any, active: mi.Bool = True
    ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        return self._sample(*evaluated, _as(mi.Float, sample1), _as(mi.Point2f, sample2))

    def eval_pdf(
        self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: Any, active: mi.Bool = True
    ) -> tuple[mi.Spectrum, mi.Float]:
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return mi.Spectrum(0), mi.Float(0)
        valid, mixture, _, frame = evaluated
        return self._eval_pdf(valid, mixture, frame, _as(mi.Vector3f, wo))

    def eval(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: Any, active: mi.Bool = True) -> mi.Spectrum:
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: Any, active: mi.Bool = True) -> mi.Float:
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf_sample(
        self,
        ctx: mi.BSDFContext,
        si: mi.SurfaceInteraction3f,
        wo: Any,
        sample1: Any,
        sample2: Any,
        active: mi.Bool = True,
    ) -> tuple[mi.Spectrum, mi.Float, mi.BSDFSample3f, mi.Spectrum]:
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return mi.Spectrum(0), mi.Float(0), dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        valid, mixture, _, frame = evaluated
        value, pdf = self._eval_pdf(valid, mixture, frame, _as(mi.Vector3f, wo))
        sampled = self._sample(*evaluated, _as(mi.Float, sample1), _as(mi.Point2f, sample2))
        return value, pdf, *sampled

    # --- Other methods of Mitsuba -------------------------------------------------------------------------------------

    def eval_diffuse_reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
        """Return the albedo at normal incidence, of the diffuse and the specular lobes together."""
        normal = mi.Vector3f(0, 0, 1)
        lobes = self._lobes(self.model.evaluate(si, active))
        albedo = sum(lobe.estimated_albedo(normal) for lobe in lobes if not lobe.transmits)
        return mi.depolarizer(select(active, clamp(mi.UnpolarizedSpectrum(albedo), 0, 1), mi.UnpolarizedSpectrum(0)))

    def mirror_reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.UnpolarizedSpectrum:
        """Return the reflectance of the lobes as mirrors, for the mirror direction of si.wi: at most 1."""
        evaluated = self._mixture(mi.BSDFContext(), si, active)
        if evaluated is None:
            return mi.UnpolarizedSpectrum(0)
        valid, mixture, _, _ = evaluated
        reflectance = sum(lobe.mirror_reflectance(mixture.wi) for lobe in mixture.lobes)
        return select(valid, clamp(mi.UnpolarizedSpectrum(reflectance), 0, 1), mi.UnpolarizedSpectrum(0))

    def has_attribute(self, name: str, active: mi.Bool = True) -> mi.Bool:
        return mi.Bool(name in self.textures)

    def eval_attribute(self, name: str, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.UnpolarizedSpectrum:
        if name not in self.textures:
            return self._without_attribute(name, mi.UnpolarizedSpectrum)
        return evaluate_colour(self.textures, name, si, active)

    def eval_attribute_1(self, name: str, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
        if name not in self.textures:
            return self._without_attribute(name, mi.Float)
        return self.textures[name].eval_1(si, active)

    def eval_attribute_3(self, name: str, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
        if name not in self.textures:
            return self._without_attribute(name, mi.Color3f)
        return self.textures[name].eval_3(si, active)

    def _without_attribute(self, name: str, kind: type) -> Any:
        """Return zero, or raise an error in scalar variants, as Mitsuba's own BSDFs do."""
        if is_scalar():
            known = ", ".join(self.textures)
            raise RuntimeError(f"{self.model.plugins[0]}: Invalid attribute requested {name}; there are {known}.")
        return kind(0)

    def traverse(self, callback: mi.TraversalCallback) -> None:
        for name, value in {**self.textures, **self.model.arrays}.items():
            callback.put(name, value, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: Any = ()) -> None:
        for name, shape in self.shapes.items():
            if (found := dr.shape(self.model.arrays[name])) != shape:
                raise ValueError(f"{self.model.plugins[0]}: {name} has the shape {found}; it must have {shape}.")
        uniform = self.model.uniform
        # Textures in Python may say something else in each call.
        if uniform.names and not is_scalar() and all(type(it) is mi.Texture for it in self.textures.values()):
            si = dr.zeros(mi.SurfaceInteraction3f, 2)
            uniform.settle(self.textures, lambda: self._lobes(self.model.evaluate(si, mi.Bool(True))))

    def to_string(self) -> str:
        return self.model.described()


def _as(kind: type, value: Any) -> Any:
    """Convert a value, also a list, tuple or NumPy array, to a method's argument type, as Mitsuba's bindings do."""
    return value if isinstance(value, kind) else kind(value)


class LobeFrame:
    """The frame in which lobes are evaluated: the local frame, turned about the normal by an angle given as
    (cosine, sine), or None; and mirrored at the surface in the lanes where wi comes from behind, or None if there are
    none."""

    def __init__(self, cos_sin: tuple[mi.Float, mi.Float] | None, mirrored: mi.Bool | None = None) -> None:
        self.cos_sin, self.mirrored = cos_sin, mirrored

    def mirror(self, w: mi.Vector3f) -> mi.Vector3f:
        if self.mirrored is None:
            return w
        return mi.Vector3f(w.x, w.y, select(self.mirrored, -w.z, w.z))

    def to_local(self, w: mi.Vector3f) -> mi.Vector3f:
        w = self.mirror(w)
        if self.cos_sin is None:
            return w
        cos, sin = self.cos_sin
        return mi.Vector3f(cos * w.x + sin * w.y, cos * w.y - sin * w.x, w.z)

    def to_world(self, w: mi.Vector3f) -> mi.Vector3f:
        w = self.mirror(w)
        if self.cos_sin is None:
            return w
        cos, sin = self.cos_sin
        return mi.Vector3f(cos * w.x - sin * w.y, cos * w.y + sin * w.x, w.z)

    def stokes_axes(self, *directions: mi.Vector3f) -> list[mi.Vector3f]:
        """Return the first axes that Mitsuba gives the Stokes vectors of light along some directions, either way: both
        in the lobes' frame."""
        return [self.to_local(mi.mueller.stokes_basis(self.to_world(w))) for w in directions]
