"""What tests share: BSDFs called with arrays of directions, in any variant."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np


def direction(theta: float, phi: float = 0.0) -> np.ndarray:
    """The float32 unit vector at these angles, in degrees."""
    theta, phi = np.radians([theta, phi])
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], np.float32)


def hemisphere(count: int, seed: int, lowest: float = 0.02) -> np.ndarray:
    """Uniform directions with cosines of at least ``lowest``, shape (count, 3), float32."""
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(lowest, 1, count), rng.uniform(0, 2 * np.pi, count)
    sin = np.sqrt(1 - z * z)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), z], axis=-1).astype(np.float32)


def sphere(count: int, seed: int, lowest: float = 0.02) -> np.ndarray:
    """The same, every other one below the horizon."""
    w = hemisphere(count, seed, lowest)
    w[::2, 2] *= -1
    return w


def interaction(wi) -> mi.SurfaceInteraction3f:
    """A surface interaction for one direction of the local frame, or for an array of shape (N, 3)."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(np.asarray(wi, np.float32).T)
    if not is_scalar():
        dr.make_opaque(si.wi)
    if mi.is_spectral:
        si.wavelengths = mi.UnpolarizedSpectrum(450, 520, 580, 640)
    return si


def context(component=None, mask=None):
    """A BSDF context, of one component or of some types if they are given."""
    ctx = mi.BSDFContext()
    if component is not None:
        ctx.component = component
    if mask is not None:
        ctx.type_mask = int(mask)
    return ctx


def per_lane() -> mi.Texture:
    """A texture whose ``value``, a float or a colour, may differ from lane to lane."""

    class Lanes(mi.Texture):
        def __init__(self):
            super().__init__(mi.Properties())

        def eval(self, si, active=True):
            return self.value

        def eval_1(self, si, active=True):
            return self.value

    return Lanes()


def is_scalar() -> bool:
    return mi.variant().startswith("scalar")


def numbers(value) -> np.ndarray:
    """A float, spectrum or Mueller matrix (of which the first entry counts) as floats of shape (N, channels)."""
    if mi.is_polarized and isinstance(value, mi.Spectrum):
        value = value[0, 0]
    array = np.array(value, np.float64)
    if is_scalar():
        return array.reshape(1, -1)
    return array.reshape(-1, array.shape[-1]).T if array.ndim > 1 else array.reshape(-1, 1)


def call(method, ctx, wi, *arrays):
    """``method(ctx, si, …)`` of a BSDF for arrays of inputs, each of shape (N, k): a list of (N, channels) arrays, one
    for each value that it returns. Scalar variants get one call for each row."""
    types = {3: mi.Vector3f, 2: mi.Point2f, 1: mi.Float}

    def once(wi, arrays):
        given = [types[array.shape[-1]](array.T if array.shape[-1] > 1 else array.ravel()) for array in arrays]
        result = method(ctx, interaction(wi), *given, True)
        result = result if isinstance(result, tuple) else (result,)
        dr.eval(result)  # in one kernel
        flat = []
        for value in result:
            flat += [value.wo, value.pdf] if isinstance(value, mi.BSDFSample3f) else [value]
        return [numbers(value) for value in flat]

    if not is_scalar():
        return once(wi, arrays)
    types[1] = lambda value: float(value[0])
    rows = [once(w, [array[k] for array in arrays]) for k, w in enumerate(wi)]
    return [np.concatenate(column) for column in zip(*rows, strict=True)]
