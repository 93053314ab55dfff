"""The adapter between models and Mitsuba: the only place that knows ``mi.BSDF``."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from .lobes import Mixture
from .math import clamp, select
from .model import Model


def bsdf_class(model: type[Model], base: type) -> type:
    """The BSDF class of a model for one variant, of which ``base`` is the ``mi.BSDF``.

    Each variant has a BSDF class of its own, and bindings allow no second base class: so the methods, which work on
    every variant, are written once below and handed to each class.
    """
    methods = {name: value for name, value in vars(ModelBSDF).items() if name not in ("__dict__", "__weakref__")}
    return type(model.__name__, (base,), {**methods, "model_class": model})


class ModelBSDF:
    """A model as a BSDF. Each of its lobes is a component."""

    model_class: type[Model]

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.model = self.model_class(props)
        # A member, too: what a frozen function reads of a BSDF, Dr.Jit looks for among its members and their lists and
        # dicts, but not in other Python objects.
        self.textures = self.model.textures

        flags = mi.BSDFFlags
        slots = self.model.slots.values()
        common = flags.FrontSide
        if any(texture.is_spatially_varying() for texture in self.textures.values()):
            common |= flags.SpatiallyVarying
        self.kinds, components = [], []
        for lobe in self.model.lobes(self.model.placeholders()):
            if lobe.transmits:
                kind = flags.GlossyTransmission if lobe.glossy else flags.DiffuseTransmission
            else:
                kind = flags.GlossyReflection if lobe.glossy else flags.DiffuseReflection
            component = kind | common
            if lobe.glossy and (lobe.anisotropic or any(slot.anisotropic for slot in slots)):
                component |= flags.Anisotropic
            if not lobe.reciprocal:
                component |= flags.NonSymmetric
            self.kinds.append(kind)
            components.append(int(component))
        self.m_components = components
        self.m_flags = 0
        for component in components:
            self.m_flags |= component

    # --- Evaluation and sampling ------------------------------------------------------------------------------------

    def _mixture(self, ctx, si, active):
        """``(valid, mixture, components, frame)``: the lobes that the context enables, seen from si.wi."""
        components = [k for k, kind in enumerate(self.kinds) if ctx.is_enabled(kind, k)]
        valid = select(si.wi.z > 0, active, False)
        if not components or valid is False:
            return None
        p = self.model.evaluate(si, valid)
        frame = Turn(getattr(p, "rotation", None))
        # Lanes that do not count get a direction that does not harm: else their NaNs would enter derivatives.
        wi = frame.to_local(select(valid, si.wi, mi.Vector3f(0, 0, 1)))
        lobes = self.model.lobes(p)
        return valid, Mixture([lobes[k] for k in components], wi), components, frame

    @staticmethod
    def _eval_pdf(valid, mixture, frame, wo):
        value, pdf = mi.UnpolarizedSpectrum(0), mi.Float(0)
        for transmitted in sorted({lobe.transmits for lobe in mixture.lobes}):
            here = select(wo.z < 0 if transmitted else wo.z > 0, valid, False)
            if here is False:
                continue
            harmless = mi.Vector3f(0, 0, -1 if transmitted else 1)
            side = mixture.eval_pdf(frame.to_local(select(here, wo, harmless)), transmitted)
            value, pdf = value + select(here, side[0], 0), pdf + select(here, side[1], 0)
        return value, pdf

    def _sample(self, valid, mixture, components, frame, sample1, sample2):
        bs = mi.BSDFSample3f()
        # The estimator f/pdf of a fixed direction is differentiated, not the direction: then the choice among lobes
        # and what the direction hits need no derivative for an unbiased gradient.
        with dr.suspend_grad():
            wo, index = mixture.sample(sample1, sample2)
            wo = frame.to_world(wo)
        value, pdf = self._eval_pdf(valid, mixture, frame, wo)
        # Scalar variants have floats so small that float32, of which colours are, is 0 there.
        drawn, density = pdf > 1e-37, dr.detach(pdf) if dr.is_diff_v(pdf) else pdf
        weight = value / select(drawn, density, 1)

        bs.wo, bs.pdf, bs.eta = wo, pdf, 1
        component, kind = mi.UInt32(components[0]), mi.UInt32(int(self.kinds[components[0]]))
        for k, c in enumerate(components[1:], start=1):
            component = dr.select(index == k, c, component)
            kind = dr.select(index == k, int(self.kinds[c]), kind)
        bs.sampled_component, bs.sampled_type = component, kind
        return bs, mi.depolarizer(select(drawn, weight, mi.UnpolarizedSpectrum(0)))

    def sample(self, ctx, si, sample1, sample2, active=True):
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        return self._sample(*evaluated, sample1, sample2)

    def eval_pdf(self, ctx, si, wo, active=True):
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return mi.Spectrum(0), mi.Float(0)
        valid, mixture, _, frame = evaluated
        value, pdf = self._eval_pdf(valid, mixture, frame, wo)
        return mi.depolarizer(value), pdf

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf_sample(self, ctx, si, wo, sample1, sample2, active=True):
        evaluated = self._mixture(ctx, si, active)
        if evaluated is None:
            return mi.Spectrum(0), mi.Float(0), dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)
        valid, mixture, _, frame = evaluated
        value, pdf = self._eval_pdf(valid, mixture, frame, wo)
        return mi.depolarizer(value), pdf, *self._sample(*evaluated, sample1, sample2)

    # --- What else Mitsuba asks -------------------------------------------------------------------------------------

    def eval_diffuse_reflectance(self, si, active=True):
        """The albedo at normal incidence: the diffuse colour and the specular lobes' together."""
        normal = mi.Vector3f(0, 0, 1)
        lobes = self.model.lobes(self.model.evaluate(si, active))
        albedo = sum(lobe.albedo(normal) for lobe in lobes if not lobe.transmits)
        return mi.depolarizer(clamp(mi.UnpolarizedSpectrum(albedo), 0, 1))

    def mirror_reflectance(self, si, active=True):
        """What the lobes reflect of the direction that mirrors si.wi, as if they were mirrors: at most 1."""
        evaluated = self._mixture(mi.BSDFContext(), si, active)
        if evaluated is None:
            return mi.UnpolarizedSpectrum(0)
        valid, mixture, _, _ = evaluated
        reflectance = sum(lobe.mirror_reflectance(mixture.wi) for lobe in mixture.lobes)
        return select(valid, clamp(mi.UnpolarizedSpectrum(reflectance), 0, 1), mi.UnpolarizedSpectrum(0))

    def has_attribute(self, name, active=True):
        return mi.Bool(name in self.textures)

    def eval_attribute(self, name, si, active=True):
        return self._attribute(name).eval(si, active)

    def eval_attribute_1(self, name, si, active=True):
        return self._attribute(name).eval_1(si, active)

    def eval_attribute_3(self, name, si, active=True):
        return self._attribute(name).eval_3(si, active)

    def _attribute(self, name):
        if name not in self.textures:
            raise ValueError(f"{self.model.plugins[0]}: no attribute {name}; there are {', '.join(self.textures)}.")
        return self.textures[name]

    def traverse(self, callback):
        for name, texture in self.textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)

    def to_string(self):
        return self.model.described()


class Turn:
    """A turn of the tangent frame about the normal, by an angle given as (cosine, sine), or none."""

    def __init__(self, cos_sin):
        self.cos_sin = cos_sin

    def to_local(self, w):
        if self.cos_sin is None:
            return w
        cos, sin = self.cos_sin
        return mi.Vector3f(cos * w.x + sin * w.y, cos * w.y - sin * w.x, w.z)

    def to_world(self, w):
        if self.cos_sin is None:
            return w
        cos, sin = self.cos_sin
        return mi.Vector3f(cos * w.x - sin * w.y, cos * w.y + sin * w.x, w.z)
