from functools import partial

import numpy as np
import reference as ref
from catalogue import BOTH, Row

COPPER_LIKE = partial(ref.fresnel_conductor, eta=0.2, k=3.0)


def row(name, ρd, ρs, κ, γ, variant="microfacet", F=np.ones_like, sharp=False, **given):
    def reference(wi, wo):
        return ref.nishino(wi, wo, ρd, ρs, κ, γ, variant, F)

    return Row(f"nishino {name}", {"type": "nishino", "variant": variant, **given}, reference, sharp=sharp)


ROWS = [
    row("default", 0, 1, -5, 100),
    row("peaked", 0.4, 0.5, 4, 25, kappa=4, gamma=25, **BOTH),
    row("flat", 0, 1, -30, 0.5, kappa=-30, gamma=0.5),
    row("broad conductor", 0, 1, -2, 2, F=COPPER_LIKE, kappa=-2, gamma=2, eta=0.2, k=3.0),
    row("dsbrdf", 0.4, 0.5, -8, 40, "dsbrdf", kappa=-8, gamma=40, **BOTH),
    row("dsbrdf peaked", 0, 1, 6, 5, "dsbrdf", kappa=6, gamma=5),
    row("sharp", 0.4, 0.5, -10, 4000, sharp=True, kappa=-10, gamma=4000, **BOTH),
]  # fmt: skip

EXTREME = [
    row(f"kappa {κ:g} gamma {γ:g}", 0.4, 0.5, κ, γ, kappa=κ, gamma=γ, **BOTH)
    for κ, γ in ((0, 20), (-80, 0.1), (-80, 1e5), (-1e-3, 10), (1e-3, 10), (80, 0.1), (80, 1e4), (5, 0), (80, 1))
]

BRIGHT = {"diffuse_reflectance": 0.2, "specular_reflectance": 0.8}

SMOOTH = {
    "nishino": {"type": "nishino", "kappa": -10.0, "gamma": 60.0, "f0": 0.6, **BRIGHT},
    "nishino peaked": {"type": "nishino", "kappa": 3.0, "gamma": 10.0, **BOTH},
    "nishino dsbrdf": {"type": "nishino", "kappa": -6.0, "gamma": 50.0, "variant": "dsbrdf", **BRIGHT},
}
