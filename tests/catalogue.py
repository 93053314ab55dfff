"""The configurations that the tests run on: one row each, whose name says what it is.

A row holds the plugin's dict and the same model in the independent float64 reference. Rows of one plugin share a
name's first word.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import reference as ref


@dataclass(frozen=True)
class Row:
    name: str
    bsdf: dict
    reference: Callable
    reciprocal: bool = True
    sharp: bool = False
    """Narrower than the usual resolution of a chi² test."""

    def __str__(self):
        return self.name


def lambert(name, ρ=0.5, **given):
    return Row(f"lambert {name}", {"type": "lambert", **given}, partial(ref.lambert, reflectance=ρ))


def phong(name, ρd=0.5, ρs=0.2, n=30, normalization="energy", sharp=False, **given):
    return Row(
        f"phong {name}",
        {"type": "phong", "normalization": normalization, **given},
        partial(
            ref.phong, diffuse_reflectance=ρd, specular_reflectance=ρs, exponent=n, normalization=normalization
        ),
        reciprocal=normalization != "original",
        sharp=sharp,
    )


def ward(name, ρd=0.5, ρs=0.2, α=(0.1, 0.1), variant="balanced", turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        return ref.ward(ref.rotate(wi, turns), ref.rotate(wo, turns), ρd, ρs, *α, variant)

    return Row(f"ward {name}", {"type": "ward", "variant": variant, **given}, reference, sharp=sharp)


def walter(name, ρd=0.0, ρs=1.0, α=(0.1, 0.1), shadowing="separable", F=None, turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        wi, wo = ref.rotate(wi, turns), ref.rotate(wo, turns)
        return ref.walter(wi, wo, ρd, ρs, *α, shadowing, F or (lambda cos: 1 + 0 * cos))

    return Row(f"walter {name}", {"type": "walter", "shadowing": shadowing, **given}, reference, sharp=sharp)


def conductor(eta, k):
    return partial(ref.fresnel_conductor, eta=eta, k=k)


DIFFUSE, BOTH = {"specular_reflectance": 0.0}, {"diffuse_reflectance": 0.4, "specular_reflectance": 0.5}

ROWS = [
    lambert("default"),
    lambert("white", 1.0, reflectance=1.0),
    lambert("dark", 0.02, reflectance=0.02),
    lambert("texture", 0.3, reflectance={"type": "checkerboard", "color0": 0.3, "color1": 0.3}),
    phong("default"),
    phong("exponent 0", 0.4, 0.5, 0, exponent=0, **BOTH),
    phong("exponent 3", 0.4, 0.5, 3, exponent=3, **BOTH),
    phong("exponent 300 without diffuse", 0, 0.5, 300, exponent=300, diffuse_reflectance=0.0, specular_reflectance=0.5),
    phong("exponent 3000", 0.4, 0.5, 3000, sharp=True, exponent=3000, **BOTH),
    phong("without specular", 0.5, 0, **DIFFUSE),
    phong("none", 0.4, 0.5, 5, "none", exponent=5, **BOTH),
    phong("original", 0.4, 0.5, 10, "original", exponent=10, **BOTH),
    ward("default"),
    ward("balanced rough", 0.4, 0.5, (0.5, 0.5), alpha=0.5, **BOTH),
    ward("balanced roughest", 0.4, 0.5, (1, 1), alpha=1.0, **BOTH),
    ward("balanced sharp", 0.4, 0.5, (0.02, 0.02), sharp=True, alpha=0.02, **BOTH),
    ward("balanced anisotropic", 0.4, 0.5, (0.08, 0.4), alpha_u=0.08, alpha_v=0.4, **BOTH),
    ward("ward", 0.4, 0.5, (0.2, 0.2), "ward", alpha=0.2, **BOTH),
    ward("ward anisotropic turned", 0.4, 0.5, (0.5, 0.1), "ward", turns=0.15,
         alpha_u=0.5, alpha_v=0.1, rotation=0.15, **BOTH),
    ward("ward-duer anisotropic", 0.4, 0.5, (0.15, 0.5), "ward-duer",
         alpha_u=0.15, alpha_v=0.5, **BOTH),
    ward("approximate anisotropic", 0.4, 0.5, (0.1, 0.6), "approximate",
         alpha_u=0.1, alpha_v=0.6, **BOTH),
    ward("approximate roughest", 0.4, 0.5, (1, 1), "approximate", alpha=1.0, **BOTH),
    walter("default"),
    walter("rough", α=(0.5, 0.5), alpha=0.5),
    walter("rougher than 1", α=(1.5, 1.5), alpha=1.5),
    walter("sharp", α=(0.03, 0.03), sharp=True, alpha=0.03),
    walter("anisotropic turned", α=(0.1, 0.5), turns=-0.3, alpha_u=0.1, alpha_v=0.5, rotation=-0.3),
    walter("correlated anisotropic", α=(0.7, 0.2), shadowing="correlated",
           alpha_u=0.7, alpha_v=0.2),
    walter("conductor", 0, 0.9, (0.3, 0.3), F=conductor(0.2, 3.0), alpha=0.3, specular_reflectance=0.9, eta=0.2, k=3.0),
    walter("schlick over diffuse", 0.4, 0.5, (0.4, 0.4), F=partial(ref.fresnel_schlick, f0=0.04),
           alpha=0.4, f0=0.04, **BOTH),
    walter("dielectric over diffuse", 0.4, 0.5, (0.3, 0.3), F=partial(ref.fresnel_dielectric, eta=1.5 / 1.000277),
           alpha=0.3, int_ior=1.5, **BOTH),
    walter("dielectric bubble", 0, 1, (0.3, 0.3), F=partial(ref.fresnel_dielectric, eta=1 / 1.333),
           alpha=0.3, int_ior="vacuum", ext_ior="water"),
]  # fmt: skip


def rows(plugin: str) -> list[Row]:
    return [row for row in ROWS if row.bsdf["type"] == plugin]
