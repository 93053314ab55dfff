from functools import partial

import reference as ref
from catalogue import BOTH, Row


def row(name, ρd, ρs, α, shadowing="separable", F=lambda cos: 1 + 0 * cos, turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        return ref.walter(ref.rotate(wi, turns), ref.rotate(wo, turns), ρd, ρs, *α, shadowing, F)

    return Row(f"walter {name}", {"type": "walter", "shadowing": shadowing, **given}, reference, sharp=sharp)


CONDUCTOR = partial(ref.fresnel_conductor, eta=0.2, k=3.0)
SCHLICK = partial(ref.fresnel_schlick, f0=0.04)
GLASS = partial(ref.fresnel_dielectric, eta=1.5 / 1.000277)
BUBBLE = partial(ref.fresnel_dielectric, eta=1 / 1.333)

ROWS = [
    row("default", 0, 1, (0.1, 0.1)),
    row("rough", 0, 1, (0.5, 0.5), alpha=0.5),
    row("rougher than 1", 0, 1, (1.5, 1.5), alpha=1.5),
    row("sharp", 0, 1, (0.03, 0.03), sharp=True, alpha=0.03),
    row("anisotropic turned", 0, 1, (0.1, 0.5), turns=-0.3, alpha_u=0.1, alpha_v=0.5, rotation=-0.3),
    row("correlated anisotropic", 0, 1, (0.7, 0.2), "correlated", alpha_u=0.7, alpha_v=0.2),
    row("conductor", 0, 0.9, (0.3, 0.3), F=CONDUCTOR, alpha=0.3, specular_reflectance=0.9, eta=0.2, k=3.0),
    row("schlick over diffuse", 0.4, 0.5, (0.4, 0.4), F=SCHLICK, alpha=0.4, f0=0.04, **BOTH),
    row("dielectric over diffuse", 0.4, 0.5, (0.3, 0.3), F=GLASS, alpha=0.3, int_ior=1.5, **BOTH),
    row("dielectric bubble", 0, 1, (0.3, 0.3), F=BUBBLE, alpha=0.3, int_ior="vacuum", ext_ior="water"),
]

EXTREME = [
    row(f"{shadowing} alpha {α:g}", 0.4, 0.5, (α, 3 * α), shadowing, alpha_u=α, alpha_v=3 * α, **BOTH)
    for shadowing in ("separable", "correlated")
    for α in (1e-3, 0.6)
]

SMOOTH = {
    "walter": {"type": "walter", "alpha_u": 0.12, "alpha_v": 0.4, "rotation": 0.1, **BOTH},
    "walter correlated": {"type": "walter", "alpha": 0.4, "shadowing": "correlated", **BOTH},
    "walter conductor": {"type": "walter", "alpha": 0.3, "eta": 1.2, "k": 2.0, **BOTH},
    # Between nodes of its table, at which derivatives of what is interpolated jump.
    "walter walk": {"type": "walter", "alpha_u": 0.41, "alpha_v": 0.67, "f0": 0.4, "multiscatter": "walk", **BOTH},
    "walter turquin": {"type": "walter", "alpha": 0.6, "eta": 1.2, "k": 2.0, "multiscatter": "turquin", **BOTH},
    "walter schlick": {"type": "walter", "alpha": 0.3, "f0": 0.2, **BOTH},
    "walter dielectric": {"type": "walter", "alpha": 0.3, "int_ior": 1.8, "ext_ior": 1.2, **BOTH},
}
