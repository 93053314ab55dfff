"""Directional albedos as integrals of the float64 reference, for some configurations on the manual pages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import reference as ref
from scipy.stats import qmc
from support import unit

from mi_brdfs.probe.parameter_space import view


class Reference(NamedTuple):
    """A configuration: f cosθ_o in white, and the roughness of lobes about as wide, as functions of its numbers."""

    model: str
    given: dict[str, Any]
    f_cos: Callable
    width: Callable

    def __str__(self):
        return f"{self.model} {self.given}"

    def albedo(self, numbers: dict[str, float], log2_count: int) -> float:
        """The integral over the hemisphere by the points of two rules together, weighted by the sum of their densities:
        one about the normal, and one with half vectors as of GGX."""
        numbers = dict(numbers)
        wi = view(numbers.pop("cosine"), numbers.pop("azimuth"))
        width = np.array(self.width(**numbers))
        u, v = qmc.Sobol(2, scramble=False).random_base2(log2_count).T + 0.5 / (1 << log2_count)
        circle = np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)])
        about_normal = np.stack([*(np.sqrt(u) * circle), np.sqrt(1 - u)], axis=-1)
        h = unit(np.stack([*(width[:, None] * np.sqrt(u / (1 - u)) * circle), np.ones_like(u)], axis=-1))
        about_mirror = 2 * (h @ wi)[:, None] * h - wi
        wo = np.concatenate([about_normal, about_mirror[h @ wi > 0]])
        wo = wo[wo[:, 2] > 0]

        h = unit(wi + wo)
        slope2 = ((h[:, :2] / width) ** 2).sum(axis=-1) / h[:, 2] ** 2
        facets = 1 / (np.pi * width.prod() * h[:, 2] ** 3 * (1 + slope2) ** 2)
        density = wo[:, 2] / np.pi + facets / (4 * (h @ wi))
        return float((self.f_cos(np.tile(wi, (len(wo), 1)), wo, **numbers) / density).sum()) / (1 << log2_count)


def pair(*, alpha_u, alpha_v, **_):
    return alpha_u, alpha_v


def long_tail(*, alpha, gamma):
    """The median slope of the EPD, about."""
    return (alpha * gamma ** (-0.5 / gamma),) * 2


def squared(*, roughness, anisotropic=0.0, **_):
    aspect = np.sqrt(1 - 0.9 * anisotropic)
    return max(roughness**2 / aspect, 0.001), max(roughness**2 * aspect, 0.001)


def ward(variant):
    return Reference(
        "ward", {"variant": variant}, lambda wi, wo, **p: ref.ward(wi, wo, 0, 1, **p, variant=variant), pair
    )


def kurt(**given):
    def f_cos(wi, wo, **p):
        return ref.kurt(wi, wo, 0, [{"specular_reflectance": 1, "f0": 1} | given | p])

    return Reference("kurt", given, f_cos, pair)


def kit(distribution, shadowing, width=pair, **given):
    given = {"distribution": distribution, "shadowing": shadowing} | given
    return Reference("microfacet", given, lambda wi, wo, **p: ref.microfacet(wi, wo, 0, 1, **given, **p), width)


def karis(shadowing):
    return Reference(
        "metallicroughness",
        {"shadowing": shadowing},
        lambda wi, wo, **p: ref.metallicroughness(wi, wo, 1, **p, shadowing=shadowing),
        squared,
    )


REFERENCES = [
    ward("ward"),
    ward("ward-duer"),
    ward("approximate"),
    kurt(kurt_exponent=0.25),
    kurt(),
    kit("beckmann", "schlick"),
    kit("ggx", "schlick"),
    kit("ggx", "ashikhmin-shirley"),
    kit("epd", "neumann", long_tail),
    kit("epd", "ashikhmin-premoze", long_tail),
    kit("epd", "ashikhmin-shirley", long_tail),
    karis("direct"),
    karis("smith"),
    Reference("burley", {}, lambda wi, wo, **p: ref.burley(wi, wo, np.ones(3), **p)[:, 0], squared),
]
