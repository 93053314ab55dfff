from functools import partial

import numpy as np
import reference as ref
from catalogue import BOTH, Row

GLASS = partial(ref.fresnel_dielectric, eta=1.5 / 1.000277)
CONDUCTOR = partial(ref.fresnel_conductor, eta=0.2, k=3.0)


def row(name, ρd, ρs, α, distribution="beckmann", normalization="modern", F=np.ones_like, sharp=False, **given):
    def reference(wi, wo):
        return ref.cooktorrance(wi, wo, ρd, ρs, α, distribution, normalization, F)

    bsdf = {"type": "cooktorrance", "distribution": distribution, "normalization": normalization, **given}
    return Row(f"cooktorrance {name}", bsdf, reference, sharp=sharp)


ROWS = [
    row("default", 0, 1, 0.1),
    row("rough", 0, 1, 0.5, alpha=0.5),
    row("roughest", 0.4, 0.5, 2, alpha=2.0, **BOTH),
    row("sharp", 0.4, 0.5, 0.02, sharp=True, alpha=0.02, **BOTH),
    row("ggx", 0.4, 0.5, 0.3, "ggx", alpha=0.3, **BOTH),
    row("blinn", 0.4, 0.5, 0.3, "blinn", alpha=0.3, **BOTH),
    row("blinn limited", 0, 1, 1, "blinn", alpha=1.7),
    row("tog82", 0.4, 0.2, 0.3, normalization="tog82", alpha=0.3, diffuse_reflectance=0.4, specular_reflectance=0.2),
    row("dielectric", 0.4, 0.5, 0.2, F=GLASS, alpha=0.2, int_ior=1.5, **BOTH),
    row("conductor", 0, 1, 0.4, F=CONDUCTOR, alpha=0.4, eta=0.2, k=3.0),
]

EXTREME = [
    row(f"{distribution} alpha {α:g}", 0.4, 0.5, α, distribution, alpha=α, **BOTH)
    for distribution in ("beckmann", "ggx", "blinn")
    for α in (4.5e-3 if distribution == "blinn" else 1e-3, 0.6)
]

SMOOTH = {
    f"cooktorrance {distribution}": {"type": "cooktorrance", "alpha": 0.3, "distribution": distribution, **BOTH}
    for distribution in ("beckmann", "ggx", "blinn")
} | {"cooktorrance tog82": {"type": "cooktorrance", "alpha": 0.3, "f0": 0.2, "normalization": "tog82", **BOTH}}
