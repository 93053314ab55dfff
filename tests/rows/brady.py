from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρd, ρs, F0, α, β, normalization="unit", sharp=False, **given):
    reference = partial(
        ref.brady, diffuse_reflectance=ρd, specular_reflectance=ρs, f0=F0, exponent=α, beta=β,
        normalization=normalization,
    )  # fmt: skip
    bsdf = {"type": "brady", "normalization": normalization, **given}
    return Row(f"brady {name}", bsdf, reference, sharp=sharp)


ROWS = [
    row("default", 0.5, 1, 0.04, 2, 0.3),
    row("metal", 0, 1, 1, 2, 0.5, diffuse_reflectance=0.0, f0=1.0, beta=0.5),
    row("long tail", 0.3, 0.8, 0.5, 0.6, 0.3, diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5, exponent=0.6),
    row("longest tail", 0, 1, 1, 0.1, 0.2, diffuse_reflectance=0.0, f0=1.0, exponent=0.1, beta=0.2),
    row("steep and broad", 0.3, 0.8, 0.5, 3, 1.5, diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5,
        exponent=3, beta=1.5),
    row("none", 0.3, 20, 0.3, 1.5, 0.3, "none", diffuse_reflectance=0.3, specular_reflectance=20.0, f0=0.3,
        exponent=1.5),
    row("none broad", 0, 1, 1, 1, 2, "none", diffuse_reflectance=0.0, f0=1.0, exponent=1, beta=2),
    row("sharp", 0.3, 0.8, 0.5, 2, 0.13, sharp=True, diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5,
        beta=0.13),
]  # fmt: skip

EXTREME = [
    row(f"exponent {α:g} beta {β:g} {normalization}", 0, 0.5, 0.2, α, β, normalization, diffuse_reflectance=0.0,
        specular_reflectance=0.5, f0=0.2, exponent=α, beta=β)
    for normalization in ("unit", "none")
    for α in (0.1, 3.0)
    for β in (0.01, 2.0)
]  # fmt: skip

SMOOTH = {
    f"brady {normalization}": {
        "type": "brady", "diffuse_reflectance": 0.3, "specular_reflectance": scale, "f0": 0.3, "exponent": 1.4,
        "beta": width, "normalization": normalization,
    }
    for normalization, scale, width in (("unit", 0.6, 0.5), ("none", 2.0, 0.35))
}  # fmt: skip
