"""Models with a fault each, as a hurried author may leave them, and the checks that must name it.

Each mutant is a plugin of its own, ``mutant_NAME``, made of a model or lobe of the pack with one thing changed; for
``MUTANTS`` see the end.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi

from mi_brdfs.lobes import LambertLobe, MicrofacetLobe, Mixture, PowerLobe, over_diffuse
from mi_brdfs.microfacet.distributions import GGX, Beckmann
from mi_brdfs.microfacet.facet import Facet
from mi_brdfs.microfacet.fresnel import Unit
from mi_brdfs.microfacet.shadowing import Kelemen, Shadowing, SmithGGX
from mi_brdfs.mitsuba import bsdf as adapter
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.models.phong import Phong
from mi_brdfs.models.walter import Walter
from mi_brdfs.models.ward import Ward
from mi_brdfs.parameters import Colour

# --- Diffuse lobes --------------------------------------------------------------------------------------------------


class TimesPi(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * dr.pi, pdf


class OverPi(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * dr.inv_pi, pdf


class NoCosine(LambertLobe):
    def eval_pdf(self, wi, wo):
        return self.reflectance * dr.inv_pi, super().eval_pdf(wi, wo)[1]


class UniformDensity(LambertLobe):
    def eval_pdf(self, wi, wo):
        return super().eval_pdf(wi, wo)[0], mi.Float(dr.inv_two_pi)


class UniformSampler(LambertLobe):
    def sample(self, wi, u, v):
        return mi.warp.square_to_uniform_hemisphere(v)


class DensityWithoutPi(LambertLobe):
    def eval_pdf(self, wi, wo):
        return super().eval_pdf(wi, wo)[0], wo.z


class OneVariate(LambertLobe):
    def sample(self, wi, u, v):
        return super().sample(wi, u, mi.Point2f(v.x, 0.3))


class NotANumber(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (dr.sqrt(wo.z - 0.01) / dr.sqrt(wo.z - 0.01)), pdf


class Negative(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (1 - 1.1 * dr.square(dr.square(1 - wo.z))), pdf


class BlackAtNormal(LambertLobe):
    """A guard of a division by sinθ that leaves nothing."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return dr.select(dr.maximum(wi.z, wo.z) == 1, 0, value), pdf


class HalfAzimuth(LambertLobe):
    """A function of half the azimuth, which jumps where azimuths start again."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (1 - 0.1 * dr.sin(dr.atan2(wi.y, wi.x) / 2) * dr.sin(dr.atan2(wo.y, wo.x) / 2)), pdf


class CutAtGrazing(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return dr.select(dr.minimum(wi.z, wo.z) < 4e-4, 1e-4 * value, value), pdf


class MissingDensity(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value, dr.select(wo.z > 0.2, pdf, 0)


class OneWay(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (0.5 + 0.5 * wo.z), pdf


class OneWayAndSaysSo(OneWay):
    reciprocal = False


class Detached(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return dr.detach(value), pdf


class RootOfSquare(LambertLobe):
    """The absolute value as √x², which has the derivative 0·∞ at x = 0."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (1 + 0.01 * dr.sqrt(dr.square(self.reflectance - 0.5))), pdf


# --- Faults at some directions only ---------------------------------------------------------------------------------


def changed(lobe, value=None, density=None):
    """A lobe with a factor on its value or its density, of wi and wo."""

    class Mutant(lobe):
        def eval_pdf(self, wi, wo):
            f, pdf = super().eval_pdf(wi, wo)
            return f * value(wi, wo) if value else f, pdf * density(wi, wo) if density else pdf

    return Mutant


def where(condition, factor=1.05, otherwise=1.0):
    return lambda wi, wo: dr.select(condition(wi, wo), mi.Float(factor), otherwise)


def between(low, high):
    """Whether a direction is within some angles to the normal, in degrees."""
    return lambda w: (w.z < math.cos(math.radians(low))) & (w.z > math.cos(math.radians(high)))


def third_quadrant(w):
    return (w.x < 0) & (w.y < 0)


def first_quadrant(w):
    return (w.x > 0) & (w.y > 0)


def blue(wi, wo):
    return mi.Color3f(1, 1, 1.2)


class LostAtFortyFive(LambertLobe):
    def sample(self, wi, u, v):
        wo = super().sample(wi, u, v)
        return dr.select((v.y < 0.02) & between(40, 50)(wi), -wo, wo)


class NotANumberStraightBack(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        d2 = dr.squared_norm(wi - wo)
        return value * (d2 / d2), pdf


class DoubleDerivative(LambertLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return 2 * value - dr.detach(value), pdf


class RootAtNormal(LambertLobe):
    """sinθ as √(1 - cos²θ), of which the derivative is infinite at normal incidence."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value * (
            1 + 0.01 * dr.sqrt(dr.maximum(1 - wi.z * wi.z, 0)) * dr.sqrt(dr.maximum(1 - wo.z * wo.z, 0))
        ), pdf


class UndirectedDensity(LambertLobe):
    """The same in the density alone."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value, pdf * dr.sqrt(dr.maximum(1 - wi.z * wi.z, 0)) / dr.sqrt(dr.maximum(1 - wi.z * wi.z, 0))


# --- Glossy lobes ---------------------------------------------------------------------------------------------------


class SkewedPower(PowerLobe):
    def sample(self, wi, u, v):
        wo = super().sample(wi, u, v)
        sin, cos = dr.sincos(0.1)
        return mi.Vector3f(cos * wo.x - sin * wo.y, cos * wo.y + sin * wo.x, wo.z)


class PowerFlaggedDiffuse(PowerLobe):
    glossy = False


class UnnormalisedPower(PowerLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value, pdf * (self.exponent + 1) / (self.exponent + 2)


class HalfVectorDensity(MicrofacetLobe):
    """The density of the half vector, without the Jacobian 1/(4 cosθ_d) of its reflection."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return value, pdf * 4 * Facet.between(wi, wo).cos_d


class WithoutFour(MicrofacetLobe):
    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        return 4 * value, pdf


class SwappedDensity(MicrofacetLobe):
    """αu and αv change places in the density only."""

    def eval_pdf(self, wi, wo):
        value, _ = super().eval_pdf(wi, wo)
        d = self.distribution
        swapped = MicrofacetLobe(1, type(d)(d.alpha_v, d.alpha_u), self.shadowing, self.fresnel)
        return value, swapped.eval_pdf(wi, wo)[1]


class SwappedBeyond(SwappedDensity):
    """They do for light from a quarter of the azimuths."""

    def eval_pdf(self, wi, wo):
        value, pdf = MicrofacetLobe.eval_pdf(self, wi, wo)
        return value, dr.select(third_quadrant(wi), super().eval_pdf(wi, wo)[1], pdf)


class HalfVectorIfAnisotropic(MicrofacetLobe):
    """The Jacobian 1/(4 cosθ_d) is missing in the branch of different alphas."""

    def eval_pdf(self, wi, wo):
        value, pdf = super().eval_pdf(wi, wo)
        d = self.distribution
        return value, pdf * dr.select(d.alpha_u == d.alpha_v, 1, 4 * Facet.between(wi, wo).cos_d)


class TurnedByADegree(PowerLobe):
    def sample(self, wi, u, v):
        wo = super().sample(wi, u, v)
        sin, cos = dr.sincos(mi.Float(math.radians(1)))
        return mi.Vector3f(cos * wo.x - sin * wo.y, cos * wo.y + sin * wo.x, wo.z)


class LostHalf(MicrofacetLobe):
    """Throws away every other direction that it draws, which the density does not know."""

    def sample(self, wi, u, v):
        wo = super().sample(wi, u, v)
        return dr.select(v.x < 0.5, wo, -wo)


class UnnormalisedGGX(GGX):
    def eval(self, facet):
        return super().eval(facet) * 1.3


class OneSidedShadowing(Shadowing):
    """Smith's masking of wo alone."""

    conserving = True

    def __call__(self, facet):
        z = facet.cos_o
        return 2 / (1 + dr.sqrt(1 + 0.36 * (1 - z * z) / (z * z)))


def lambert(lobe):
    class Mutant(Lambert):
        def lobes(self, p):
            return (lobe(p.reflectance),)

    return Mutant


def phong(lobe):
    class Mutant(Phong):
        def lobes(self, p):
            scale = (p.exponent + 2) * dr.inv_two_pi
            return LambertLobe(p.diffuse_reflectance), lobe(p.specular_reflectance, p.exponent, scale)

    return Mutant


def walter(lobe=MicrofacetLobe, distribution=GGX, shadowing=None):
    class Mutant(Walter):
        def lobes(self, p):
            smith = shadowing or SmithGGX(*p.alpha, correlated=False)
            specular = lobe(p.specular_reflectance, distribution(*p.alpha), smith, p.fresnel)
            return over_diffuse(p.diffuse_reflectance, specular)

    return Mutant


def ward(lobe):
    class Mutant(Ward):
        def lobes(self, p):
            specular = lobe(p.specular_reflectance, Beckmann(*p.alpha), Kelemen(), Unit())
            return LambertLobe(p.diffuse_reflectance), specular

    return Mutant


class BakedIn(Lambert):
    """Makes a number of Python of its texture's: a literal in the kernel."""

    def lobes(self, p):
        return (LambertLobe(float(mi.traverse(self.textures["reflectance"])["value"][0])),)


class AverageColour(Lambert):
    def evaluate(self, si, active):
        return SimpleNamespace(reflectance=self.textures["reflectance"].mean())


class FixedPoint(Lambert):
    """Looks at its texture in the sampler and elsewhere alike, but always at the same point."""

    def evaluate(self, si, active):
        return super().evaluate(dr.zeros(mi.SurfaceInteraction3f), active)


class Stuck(Lambert):
    """Limits its parameter by a function without a derivative beyond."""

    def evaluate(self, si, active):
        return SimpleNamespace(reflectance=dr.clip(self.textures["reflectance"].eval(si, active), 0, 1))


class Unlimited(Lambert):
    def evaluate(self, si, active):
        return SimpleNamespace(reflectance=self.textures["reflectance"].eval(si, active))


class Outwards(Lambert):
    """Derivatives beyond a limit are those at it, also where they lead further out."""

    def evaluate(self, si, active):
        value = self.textures["reflectance"].eval(si, active)
        return SimpleNamespace(reflectance=dr.replace_grad(dr.clip(value, 0, 1), value))


class ClippedSpectrum(Lambert):
    """Limits colours to 1 where they are spectra."""

    reflectance = Colour(0.5, (0, 10), "a colour without a limit to speak of")

    def evaluate(self, si, active):
        p = super().evaluate(si, active)
        return SimpleNamespace(reflectance=dr.minimum(p.reflectance, 1) if mi.is_spectral else p.reflectance)


class BrighterSpectrum(Lambert):
    """Scales spectra by two hundredths too much."""

    def evaluate(self, si, active):
        p = super().evaluate(si, active)
        return SimpleNamespace(reflectance=p.reflectance * (1.02 if mi.is_spectral else 1))


class BrighterInTheBlue(Lambert):
    """Scales what is below 420 nm."""

    def evaluate(self, si, active):
        p = super().evaluate(si, active)
        return SimpleNamespace(
            reflectance=p.reflectance * (dr.select(si.wavelengths < 420, 1.3, 1) if mi.is_spectral else 1)
        )


class WavelengthsExchanged(Lambert):
    def evaluate(self, si, active):
        r = super().evaluate(si, active).reflectance
        return SimpleNamespace(reflectance=mi.UnpolarizedSpectrum(r[1], r[0], r[2], r[3]) if mi.is_spectral else r)


class RedAndBlueExchanged(Lambert):
    def evaluate(self, si, active):
        r = super().evaluate(si, active).reflectance
        return SimpleNamespace(reflectance=mi.Color3f(r.z, r.y, r.x) if mi.is_rgb else r)


class TexturePoint(Lambert):
    """Looks its texture up elsewhere."""

    def evaluate(self, si, active):
        moved = mi.SurfaceInteraction3f(si)
        moved.uv = self.moved(si.uv)
        return super().evaluate(moved, active)


class IgnoresV(TexturePoint):
    def moved(self, uv):
        return mi.Point2f(uv.x, 0.5)


class ClampsUV(TexturePoint):
    def moved(self, uv):
        return dr.clip(uv, 0, 1)


class ExchangesUV(TexturePoint):
    def moved(self, uv):
        return mi.Point2f(uv.y, uv.x)


class HalfATexel(TexturePoint):
    """Of a bitmap of three columns."""

    def moved(self, uv):
        return mi.Point2f(uv.x + 0.5 / 3, uv.y)


# --- Adapters -------------------------------------------------------------------------------------------------------


class IgnoresMasks(adapter.ModelBSDF):
    def _mixture(self, ctx, si, active):
        return adapter.ModelBSDF._mixture(self, mi.BSDFContext(), si, active)


class WeightNotDivided(adapter.ModelBSDF):
    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
        return bs, weight * bs.pdf


class CosineTwice(adapter.ModelBSDF):
    """eval has another cosine, sample's weight has not."""

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)
        return value * dr.maximum(wo.z, 0), pdf

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]


class HalfFloats(adapter.ModelBSDF):
    """eval returns eleven bits."""

    def eval(self, ctx, si, wo, active=True):
        return mi.Color3f([mi.Float(dr.llvm.ad.Float16(channel)) for channel in self.eval_pdf(ctx, si, wo, active)[0]])


class PairDisagrees(adapter.ModelBSDF):
    """eval_pdf alone forgets the cosine."""

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)
        return value / dr.maximum(wo.z, 0.01), pdf

    def eval(self, ctx, si, wo, active=True):
        return adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)[1]


class SumOfDensities(adapter.ModelBSDF):
    """The mixture's density leaves out the lobes' probabilities."""

    @staticmethod
    def _eval_pdf(valid, mixture, frame, wo):
        value, pdf = adapter.ModelBSDF._eval_pdf(valid, mixture, frame, wo)
        return value, pdf * len(mixture.lobes)


class WrongComponent(adapter.ModelBSDF):
    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
        bs.sampled_component = mi.UInt32(0)
        return bs, weight


class WrongType(adapter.ModelBSDF):
    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
        bs.sampled_type = mi.UInt32(int(mi.BSDFFlags.DiffuseReflection))
        return bs, weight


class ShinesThrough(adapter.ModelBSDF):
    """Takes the cosine's absolute value where it should be zero below the horizon."""

    def eval_pdf(self, ctx, si, wo, active=True):
        return adapter.ModelBSDF.eval_pdf(self, ctx, si, mi.Vector3f(wo.x, wo.y, abs(wo.z)), active)


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


class Sampled(adapter.ModelBSDF):
    """Changes what ``sample`` returns."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
        return self.altered(bs, weight, si)


class NoEta(Sampled):
    def altered(self, bs, weight, si):
        bs.eta = mi.Float(0)
        return bs, weight


class EtaOfGlass(Sampled):
    def altered(self, bs, weight, si):
        bs.eta = mi.Float(1.5)
        return bs, weight


class OtherComponentAtSome(Sampled):
    def altered(self, bs, weight, si):
        bs.sampled_component = dr.select(between(65, 75)(si.wi), 1 - bs.sampled_component, bs.sampled_component)
        return bs, weight


class WeightAtMostOne(Sampled):
    def altered(self, bs, weight, si):
        return bs, dr.minimum(weight, 1)


class WeightOfOtherChannels(Sampled):
    def altered(self, bs, weight, si):
        return bs, mi.Color3f(weight.z, weight.x, weight.y)


class DetachedWeight(Sampled):
    def altered(self, bs, weight, si):
        return bs, dr.detach(weight)


class WeightOverAttachedDensity(Sampled):
    def altered(self, bs, weight, si):
        return bs, weight * dr.detach(bs.pdf) / dr.select(bs.pdf > 0, bs.pdf, 1)


class WeightOffInTheYellow(Sampled):
    def altered(self, bs, weight, si):
        if not mi.is_spectral:
            return bs, weight
        return bs, weight * dr.select((si.wavelengths > 560) & (si.wavelengths < 590), 0.9, 1)


class SampleDensityAtGrazing(Sampled):
    """The density that ``sample`` says is another where no angle is asked for."""

    def altered(self, bs, weight, si):
        bs.pdf = dr.select(between(82, 88)(si.wi), 1.02 * bs.pdf, bs.pdf)
        return bs, weight


class VariateUsedTwice(adapter.ModelBSDF):
    """The lobe is chosen by a variate that also chooses the direction."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        return adapter.ModelBSDF.sample(self, ctx, si, sample2.x, sample2, active)


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


class AllVariatesTwice(adapter.ModelBSDF):
    """eval_pdf_sample draws with exchanged variates."""

    def eval_pdf_sample(self, ctx, si, wo, sample1, sample2, active=True):
        other = mi.Point2f(sample2.y, sample2.x)
        return adapter.ModelBSDF.eval_pdf_sample(self, ctx, si, wo, sample1, other, active)


class NeverInactive(adapter.ModelBSDF):
    def eval_pdf(self, ctx, si, wo, active=True):
        return adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, True)


class AllMethodsInOneInactive(adapter.ModelBSDF):
    def eval_pdf_sample(self, ctx, si, wo, sample1, sample2, active=True):
        return adapter.ModelBSDF.eval_pdf_sample(self, ctx, si, wo, sample1, sample2, True)


class ReflectanceInactive(adapter.ModelBSDF):
    def eval_diffuse_reflectance(self, si, active=True):
        return adapter.ModelBSDF.eval_diffuse_reflectance(self, si, True)


class ExchangedKeys(adapter.ModelBSDF):
    """Shows its parameters under each other's names."""

    def traverse(self, callback):
        names = list(self.textures)
        for name, other in zip(names, reversed(names), strict=True):
            callback.put(name, self.textures[other], mi.ParamFlags.Differentiable)


class FlaggedForBothSides(adapter.ModelBSDF):
    def __init__(self, props):
        adapter.ModelBSDF.__init__(self, props)
        self.m_components = [int(component | mi.BSDFFlags.DiffuseTransmission) for component in self.m_components]
        self.m_flags = self.m_components[0]


class SamplesInactive(adapter.ModelBSDF):
    def sample(self, ctx, si, sample1, sample2, active=True):
        return adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, True)


class AllOrNone(adapter.ModelBSDF):
    """Switches all lanes off if one is."""

    def eval_pdf(self, ctx, si, wo, active=True):
        return adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, dr.all(mi.Bool(active)))


class LeaksDerivative(adapter.ModelBSDF):
    """Inactive lanes get no light, but parameters get their derivatives."""

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)
        every = adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, True)[0]
        return value + dr.select(mi.Bool(active), 0, every - dr.detach(every)), pdf


class IgnoresMode(adapter.ModelBSDF):
    """Reflects light from an emitter as light from the camera."""

    def _mixture(self, ctx, si, active):
        radiance = mi.BSDFContext()
        radiance.component, radiance.type_mask = ctx.component, ctx.type_mask
        return adapter.ModelBSDF._mixture(self, radiance, si, active)


class CosinesInLightTracing(adapter.ModelBSDF):
    """Corrects for shading normals that there are none of."""

    def eval_pdf(self, ctx, si, wo, active=True):
        value, pdf = adapter.ModelBSDF.eval_pdf(self, ctx, si, wo, active)
        if ctx.mode == mi.TransportMode.Importance:
            value = value * abs(si.wi.z) / dr.maximum(abs(wo.z), 1e-3)
        return value, pdf


class DoubleReflectance(adapter.ModelBSDF):
    def eval_diffuse_reflectance(self, si, active=True):
        return 2 * adapter.ModelBSDF.eval_diffuse_reflectance(self, si, active)


class ReflectanceOverPi(adapter.ModelBSDF):
    def eval_diffuse_reflectance(self, si, active=True):
        return adapter.ModelBSDF.eval_diffuse_reflectance(self, si, active) * dr.inv_pi


class ReflectanceAtOnePoint(adapter.ModelBSDF):
    def eval_diffuse_reflectance(self, si, active=True):
        return adapter.ModelBSDF.eval_diffuse_reflectance(self, dr.zeros(mi.SurfaceInteraction3f), active)


class SamplesBelow(adapter.ModelBSDF):
    """A tenth of the samples leaves below the horizon, with its weight."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs, weight = adapter.ModelBSDF.sample(self, ctx, si, sample1, sample2, active)
        bs.wo = dr.select(sample1 < 0.1, mi.Vector3f(bs.wo.x, bs.wo.y, -bs.wo.z), bs.wo)
        return bs, weight


class NoAnisotropicFlag(adapter.ModelBSDF):
    def __init__(self, props):
        adapter.ModelBSDF.__init__(self, props)
        self.m_components = [c & ~int(mi.BSDFFlags.Anisotropic) for c in self.m_components]
        self.m_flags = int(self.m_flags) & ~int(mi.BSDFFlags.Anisotropic)


class FlagsDisagree(adapter.ModelBSDF):
    """The flags of the whole leave a component out."""

    def __init__(self, props):
        adapter.ModelBSDF.__init__(self, props)
        self.m_flags = self.m_components[0]


# --- The catalogue --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mutant:
    """A fault, and the checks of which each must fail."""

    name: str
    caught_by: tuple[str, ...]
    model: type
    methods: type = adapter.ModelBSDF
    given: tuple = ()

    def __str__(self):
        return self.name

    def register(self) -> dict:
        """Make it a plugin of the active variant; its dict."""
        plugin = "mutant_" + self.name.replace(" ", "_")
        for variant in {mi.variant(), "scalar_rgb"}:
            module = importlib.import_module(f"mitsuba.{variant}")
            members = {k: v for base in reversed(self.methods.__mro__[:-1]) for k, v in vars(base).items()}
            members = {k: v for k, v in members.items() if k not in ("__dict__", "__weakref__")}
            made = type(self.model.__name__, (module.BSDF,), members | {"plugin_class": self.model})
            module.register_bsdf(plugin, made)
        return {"type": plugin, **dict(self.given)}


def mutant(name, caught_by, model, methods=adapter.ModelBSDF, **given):
    return Mutant(name, tuple(caught_by.split()), model, methods, tuple(given.items()))


RED = {"type": "rgb", "value": (0.6, 0.3, 0.1)}

MUTANTS = [
    mutant("pi forgotten in the denominator", "albedo", lambert(TimesPi)),
    mutant("pi twice in the denominator", "albedo", lambert(OverPi)),
    mutant("missing cosine", "reciprocity", lambert(NoCosine)),
    mutant("missing factor four", "albedo", walter(WithoutFour), alpha=0.3),
    mutant("unnormalised D", "pdf", walter(distribution=UnnormalisedGGX), alpha=0.05),
    mutant("density without pi", "pdf chi2", lambert(DensityWithoutPi)),
    mutant("uniform density of a cosine sampler", "chi2", lambert(UniformDensity)),
    mutant("uniform sampler of a cosine density", "chi2", lambert(UniformSampler)),
    mutant("a variate ignored", "chi2", lambert(OneVariate)),
    mutant("normalisation of a power off by one", "pdf", phong(UnnormalisedPower), exponent=30.0),
    mutant("rotated sampler", "chi2", phong(SkewedPower), exponent=300.0),
    mutant("density of the half vector", "pdf chi2", walter(HalfVectorDensity), alpha=0.3),
    mutant("density of the half vector, sharp", "pdf chi2", walter(HalfVectorDensity), alpha=1e-3),
    mutant("alphas swapped in the density", "chi2", ward(SwappedDensity), alpha_u=0.1, alpha_v=0.3),
    mutant("half of the samples lost", "pdf chi2", walter(LostHalf), alpha=0.3),
    mutant("lobe probability omitted", "pdf components", phong(PowerLobe), SumOfDensities),
    mutant("weight not divided", "weight", Phong, WeightNotDivided),
    mutant("weight without eval's second cosine", "weight", Ward, CosineTwice),
    mutant("eval_pdf disagrees", "eval_pdf", Ward, PairDisagrees),
    mutant("mask forgotten", "components", Ward, IgnoresMasks),
    mutant("wrong component", "components", Ward, WrongComponent),
    mutant("wrong type", "components", Ward, WrongType),
    mutant("flags of the whole", "components", Ward, FlagsDisagree),
    mutant("glossy flagged diffuse", "flags", phong(PowerFlaggedDiffuse), exponent=300.0),
    mutant("anisotropy not flagged", "flags", Ward, NoAnisotropicFlag, alpha_u=0.1, alpha_v=0.3),
    mutant("one-way shadowing", "reciprocity", walter(shadowing=OneSidedShadowing()), alpha=0.6),
    mutant("one-way diffuse", "reciprocity", lambert(OneWay)),
    mutant("not a number at grazing", "finite", lambert(NotANumber)),
    mutant("negative at grazing", "finite", lambert(Negative)),
    mutant("black at exactly normal incidence", "continuity", lambert(BlackAtNormal)),
    mutant("half of an azimuth", "continuity", lambert(HalfAzimuth)),
    mutant("cut at grazing", "continuity", lambert(CutAtGrazing)),
    mutant("mean of a texture", "textures", AverageColour),
    mutant("texture at a fixed point", "textures", FixedPoint),
    mutant("density zero where light is", "support", lambert(MissingDensity)),
    mutant("shines through", "horizon", Lambert, ShinesThrough),
    mutant("samples below the horizon", "horizon", Lambert, SamplesBelow),
    mutant("gradient cut", "gradients", lambert(Detached)),
    mutant("gradient not a number", "gradients", lambert(RootOfSquare)),
    mutant("parameter baked in", "recompiles", BakedIn),
    mutant(
        "density off for a quarter of the azimuths",
        "pdf",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: third_quadrant(wi)))),
    ),
    mutant(
        "density off towards a quarter of the azimuths",
        "chi2",
        lambert(
            changed(
                LambertLobe,
                density=lambda wi, wo: (
                    dr.select(third_quadrant(wo), 1.04, mi.Float(1)) - dr.select(first_quadrant(wo), 0.04, mi.Float(0))
                ),
            )
        ),
    ),
    mutant(
        "density off from 40 to 50 degrees",
        "pdf",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: between(40, 50)(wi), 1.01))),
    ),
    mutant(
        "density off towards 40 to 50 degrees",
        "chi2",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: between(40, 50)(wo)))),
    ),
    mutant(
        "density off above 81 degrees",
        "pdf",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: between(81, 90)(wi), 1.01))),
    ),
    mutant(
        "density off towards more than 81 degrees",
        "pdf",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: between(81, 90)(wo), 1.1))),
    ),
    mutant("samples lost from 40 to 50 degrees", "pdf", lambert(LostAtFortyFive)),
    mutant(
        "one way for a quarter of the azimuths",
        "reciprocity",
        lambert(changed(LambertLobe, value=where(lambda wi, wo: third_quadrant(wi), 1.02))),
    ),
    mutant(
        "density off for two directions of a thousand",
        "chi2",
        lambert(changed(LambertLobe, density=where(lambda wi, wo: dr.square(wo.z) > 0.998, 1.5))),
    ),
    mutant("energy gained in blue", "albedo", lambert(changed(LambertLobe, value=blue)), reflectance=0.9),
    mutant(
        "energy gained at grazing",
        "albedo",
        lambert(changed(LambertLobe, value=lambda wi, wo: 1 + dr.power(1 - wi.z, 20))),
        reflectance=0.7,
    ),
    mutant("not a number straight back", "finite", lambert(NotANumberStraightBack)),
    mutant(
        "cut a quarter of a degree above the horizon",
        "continuity",
        lambert(changed(LambertLobe, value=where(lambda wi, wo: dr.minimum(wi.z, wo.z) < 5e-3, 1e-2))),
    ),
    mutant("seen from behind", "horizon", Lambert, SeenFromBehind),
    mutant("eta of zero", "components", Lambert, NoEta),
    mutant("eta of glass", "components", Ward, EtaOfGlass),
    mutant("other component from 65 to 75 degrees", "components", Ward, OtherComponentAtSome),
    mutant("weight at most one", "weight", Ward, WeightAtMostOne, variant="ward", specular_reflectance=1.0),
    mutant("channels exchanged in the weight", "weight", Lambert, WeightOfOtherChannels, reflectance=RED),
    mutant("density of sample off at grazing", "weight", Ward, SampleDensityAtGrazing),
    mutant("half floats", "weight eval_pdf", Ward, HalfFloats),
    mutant("variate used twice", "chi2", Phong, VariateUsedTwice, diffuse_reflectance=0.4, specular_reflectance=0.5),
    mutant("lobes drawn by other shares", "chi2", Phong, OtherSharesDrawn),
    mutant("probability omitted of one lobe", "pdf chi2", Phong, ShareForgottenInOne),
    mutant("turned by a degree", "chi2", phong(TurnedByADegree), exponent=300.0),
    mutant("alphas swapped for a quarter of the azimuths", "chi2", ward(SwappedBeyond), alpha_u=0.2, alpha_v=0.3),
    mutant(
        "density of the half vector if anisotropic", "pdf", walter(HalfVectorIfAnisotropic), alpha_u=0.3, alpha_v=0.31
    ),
    mutant("eval_pdf_sample exchanges variates", "eval_pdf", Ward, AllVariatesTwice),
    mutant("v ignored", "textures", IgnoresV),
    mutant("u and v exchanged", "textures", ExchangesUV),
    mutant("clamped to the unit square", "textures", ClampsUV),
    mutant("given texture at a fixed point", "textures", FixedPoint, reflectance={"type": "checkerboard"}),
    mutant("half a texel off", "textures", HalfATexel),
    mutant("reflectance at a fixed point", "textures", Lambert, ReflectanceAtOnePoint),
    mutant("derivative twice as large", "gradients", lambert(DoubleDerivative)),
    mutant("root at normal incidence", "gradients", lambert(RootAtNormal)),
    mutant("root at normal incidence in the density", "gradients", lambert(UndirectedDensity)),
    mutant("weight detached", "gradients", Lambert, DetachedWeight),
    mutant("weight over an attached density", "gradients", Phong, WeightOverAttachedDensity),
    mutant("inactive lanes evaluated", "active", Ward, NeverInactive),
    mutant("inactive lanes sampled", "active", Lambert, SamplesInactive),
    mutant("inactive lanes evaluated and sampled at once", "active", Lambert, AllMethodsInOneInactive),
    mutant("reflectance of inactive lanes", "active", Lambert, ReflectanceInactive),
    mutant("active lanes dropped", "active", Lambert, AllOrNone),
    mutant("derivatives of inactive lanes", "active", Lambert, LeaksDerivative),
    mutant("stuck beyond a limit", "gradients", Stuck),
    mutant("evaluated beyond a limit", "gradients", Unlimited),
    mutant("led out of its range", "gradients", Outwards),
    mutant("colours clipped in spectral variants", "spectral", ClippedSpectrum),
    mutant("brighter in spectral variants", "spectral", BrighterSpectrum),
    mutant("brighter below 420 nm", "spectral", BrighterInTheBlue),
    mutant("weight off from 560 to 590 nm", "spectral", Lambert, WeightOffInTheYellow),
    mutant("wavelengths exchanged", "spectral", WavelengthsExchanged),
    mutant("red and blue exchanged", "colours", RedAndBlueExchanged),
    mutant("keys exchanged", "updates", Phong, ExchangedKeys, diffuse_reflectance=0.4, specular_reflectance=0.5),
    mutant("flagged for both sides", "flags", Lambert, FlaggedForBothSides),
    mutant("mode ignored", "mode", lambert(OneWayAndSaysSo), IgnoresMode),
    mutant("cosines in light tracing", "mode", Lambert, CosinesInLightTracing),
    mutant("twice the reflectance", "reflectance", Ward, DoubleReflectance),
    mutant("reflectance over pi", "reflectance", Lambert, ReflectanceOverPi),
]
