"""What tests of fits share: the float64 references by the plugins' parameters, and measurements made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import sqrt
from typing import Any

import numpy as np
import reference as ref

RANGES = {
    "reflectance": (0.2, 0.8), "base_color": (0.2, 0.8), "diffuse_reflectance": (0.1, 0.5),
    "specular_reflectance": (0.2, 0.6), "f0": (0.1, 0.5), "alpha": (0.1, 0.4), "beta": (0.2, 0.6), "wrap": (0.3, 0.8),
    "sigma": (0.2, 0.6), "roughness": (0.3, 0.7), "metallic": (0.2, 0.8), "kurt_exponent": (0.1, 0.4),
    "a": (0.5, 3), "b": (20, 500), "c": (0.7, 2), "int_ior": (1.3, 2), "kappa": (-15, -3), "gamma": (20, 200),
    "cx": (-1, -0.7), "cz": (0.7, 1), "diffuse_threshold": (0.3, 0.5), "diffuse_smooth": (0.1, 0.3),
    "diffuse_shadow": (0.1, 0.3), "specular_threshold": (0.6, 0.8), "specular_smooth": (0.1, 0.2),
}  # fmt: skip
"""From where parameters are drawn."""


@dataclass(frozen=True)
class Model:
    """A plugin's formula as a function of its parameters: f cosθo for arrays ``wi`` and ``wo``."""

    reference: Callable[..., np.ndarray]
    parameters: tuple[str, ...]
    given: dict[str, Any] = field(default_factory=dict)
    """What has to be known: it cannot be told from the others' values."""
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)

    def drawn(self, seed: int) -> dict[str, float]:
        rng = np.random.default_rng(seed)
        return {name: float(rng.uniform(*(RANGES | self.ranges)[name])) for name in self.parameters}


def _schlick(function, **words):
    """A reference by f0, the reflectance at normal incidence."""
    return lambda wi, wo, f0, **values: function(wi, wo, fresnel=partial(ref.fresnel_schlick, f0=f0), **words, **values)


def _isotropic(function, name="alpha", **words):
    """A reference by one value for both tangent directions."""

    def reference(wi, wo, **values):
        along = values.pop(name)
        return function(wi, wo, **{f"{name}_u": along, f"{name}_v": along}, **words, **values)

    return reference


TWO = "diffuse_reflectance", "specular_reflectance"
GREY = np.ones(3)
MODELS = {
    "lambert": Model(ref.lambert, ("reflectance",)),
    "wrap": Model(
        partial(ref.wrap, domain="hemisphere", normalization="energy"),
        ("reflectance", "wrap", "exponent"), ranges={"exponent": (1.5, 4)},
    ),
    "minnaert": Model(
        partial(ref.minnaert, normalization="energy"), ("reflectance", "exponent"), ranges={"exponent": (1.2, 3)}
    ),
    "orennayar": Model(partial(ref.orennayar, model="qualitative"), ("reflectance", "sigma")),
    "roughdiffuse": Model(
        lambda wi, wo, reflectance, alpha: ref.orennayar(wi, wo, reflectance, alpha / sqrt(2), "full"),
        ("reflectance", "alpha"), ranges={"alpha": (0.3, 0.9)},
    ),
    "eon": Model(ref.eon, ("reflectance", "roughness")),
    "toon": Model(
        partial(ref.toon, normalization="energy"),
        (*TWO, "diffuse_threshold", "diffuse_smooth", "diffuse_shadow", "specular_threshold", "specular_smooth"),
    ),
    "phong": Model(partial(ref.phong, normalization="energy"), (*TWO, "exponent"), ranges={"exponent": (10, 80)}),
    "blinnphong": Model(
        partial(ref.blinnphong, normalization="energy"), (*TWO, "exponent"), ranges={"exponent": (20, 200)}
    ),
    "cooktorrance": Model(
        _schlick(ref.cooktorrance, distribution="beckmann", normalization="modern"), (*TWO, "alpha", "f0")
    ),
    "ward": Model(_isotropic(ref.ward, variant="balanced"), (*TWO, "alpha")),
    "schlick": Model(
        partial(ref.schlick, isotropy=1, variant="shadowed"), (*TWO, "roughness"), ranges={"roughness": (0.02, 0.2)}
    ),
    "lafortune": Model(
        lambda wi, wo, diffuse_reflectance, specular_reflectance, cx, exponent: ref.lafortune(
            wi, wo, diffuse_reflectance, [{"specular_reflectance": specular_reflectance, "cx": cx, "cy": cx, "cz": 1,
                                           "exponent": exponent}], "energy"),
        (*TWO, "cx", "exponent"), given={"cz": 1.0}, ranges={"exponent": (10, 80)},
    ),
    "ashikhminshirley": Model(
        _isotropic(ref.ashikhminshirley, "exponent"), (*TWO, "exponent"), ranges={"exponent": (20, 200)}
    ),
    "walter": Model(_isotropic(_schlick(ref.walter, shadowing="separable")), (*TWO, "alpha", "f0")),
    "kurt": Model(
        lambda wi, wo, diffuse_reflectance, specular_reflectance, f0, alpha, kurt_exponent: ref.kurt(
            wi, wo, diffuse_reflectance, [{"specular_reflectance": specular_reflectance, "f0": f0, "alpha_u": alpha,
                                           "alpha_v": alpha, "kurt_exponent": kurt_exponent}]),
        (*TWO, "f0", "alpha", "kurt_exponent"),
    ),
    "nishino": Model(_schlick(ref.nishino, variant="microfacet"), (*TWO, "kappa", "gamma", "f0")),
    "low": Model(
        partial(ref.low, variant="microfacet"), ("diffuse_reflectance", "a", "b", "c", "int_ior"),
    ),
    "brady": Model(
        partial(ref.brady, normalization="unit"), (*TWO, "f0", "exponent", "beta"), ranges={"exponent": (0.6, 2)}
    ),
    "burley": Model(
        lambda wi, wo, base_color, subsurface, metallic, roughness: ref.burley(
            wi, wo, base_color * GREY, subsurface, metallic, 0.5, 0, roughness, 0, 0, 0, 0, 1)[:, 0],
        ("base_color", "subsurface", "metallic", "roughness"),
        given={"specular": 0.5, "spec_tint": 0.0, "sheen": None, "sheen_tint": None, "clearcoat": None,
               "clearcoat_gloss": None},
        ranges={"subsurface": (0.3, 0.8)},
    ),
    "metallicroughness": Model(
        partial(ref.metallicroughness, shadowing="direct"), ("base_color", "metallic", "roughness")
    ),
    "microfacet": Model(
        _isotropic(_schlick(ref.microfacet, distribution="beckmann", shadowing="smith")), (*TWO, "alpha", "f0")
    ),
}  # fmt: skip
"""By plugin, isotropic and with the default choices."""


def pairs(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions up to 78°: uniform ones, and in every other row near the mirror direction."""
    rng = np.random.default_rng(seed)

    def uniform() -> np.ndarray:
        z, phi = rng.uniform(np.cos(np.radians(78)), 1, count), rng.uniform(0, 2 * np.pi, count)
        return np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=-1)

    wi, wo = uniform(), uniform()
    near = wi * [-1, -1, 1] + rng.normal(0, 0.25, wi.shape)
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    take = (np.arange(count) % 2 == 1) & (near[:, 2] > np.cos(np.radians(79)))
    return wi.astype(np.float32), np.where(take[:, None], near, wo).astype(np.float32)


def measured(name: str, values: dict[str, float], count: int = 3000, seed: int = 1, noise: float = 0.0):
    """Arrays (wi, wo, f) of a reference; with ``noise``, this relative one, a tenth of the values missing, and a
    thirtieth negative."""
    wi, wo = pairs(count, seed)
    f = MODELS[name].reference(wi, wo, **values) / wo[:, 2].astype(np.float64)
    if noise:
        rng = np.random.default_rng(seed + 1000)
        f *= 1 + noise * rng.standard_normal(count)
        f[rng.random(count) < 0.1] = np.nan
        f[rng.random(count) < 0.03] *= -1
    return wi, wo, f
