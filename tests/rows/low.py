from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρd, abc, ior=1.5, variant="microfacet", normalization="fit", sharp=False, **given):
    a, b, c = abc
    reference = partial(
        ref.low, diffuse_reflectance=ρd, a=a, b=b, c=c, int_ior=ior, variant=variant, normalization=normalization
    )
    scale = {"normalization": normalization} if variant == "microfacet" else {}
    bsdf = {"type": "low", "variant": variant, **scale, **given}
    return Row(f"low {name}", bsdf, reference, sharp=sharp)


ROWS = [
    row("default", 0, (1, 100, 1.5)),
    row("over diffuse", 0.4, (8, 2000, 1.25), diffuse_reflectance=0.4, a=8.0, b=2000, c=1.25),
    row("paper", 0.4, (0.5, 20, 1), normalization="paper", diffuse_reflectance=0.4, a=0.5, b=20, c=1),
    row("unit", 0.4, (1, 100, 0.75), 4, normalization="unit", diffuse_reflectance=0.4, b=100, c=0.75, int_ior=4),
    row("unit flat", 0.4, (1, 0, 2), 4, normalization="unit", diffuse_reflectance=0.4, b=0, c=2, int_ior=4),
    row("smooth", 0, (1, 100, 1.5), variant="smooth"),
    row("smooth over diffuse", 0.4, (8, 2000, 0.75), 1.25, "smooth", diffuse_reflectance=0.4, a=8.0, b=2000, c=0.75,
        int_ior=1.25),
    row("smooth flat", 0.4, (0.5, 0, 1), variant="smooth", diffuse_reflectance=0.4, a=0.5, b=0, c=1),
    row("smooth sharp", 0.4, (50, 2e4, 1.5), 4, "smooth", sharp=True, diffuse_reflectance=0.4, a=50.0, b=2e4, c=1.5,
        int_ior=4),
]  # fmt: skip

EXTREME = [
    row(f"{variant} b {b:g}", 0.4, (0.5, b, c), 2, variant, normalization, diffuse_reflectance=0.4, a=0.5, b=b, c=c,
        int_ior=2)
    for variant, normalization in (("microfacet", "fit"), ("microfacet", "unit"), ("smooth", "fit"))
    for b, c in ((1.0, 0.5), (8e6, 1.0))
] + [
    row(f"{variant} of vacuum", 0.4, (0.5, 100, 1.5), 1, variant, diffuse_reflectance=0.4, a=0.5, int_ior=1)
    for variant in ("microfacet", "smooth")
]  # fmt: skip

SMOOTH = {
    f"low {variant} {' '.join(given.values())}".strip(): {
        "type": "low", "variant": variant, "diffuse_reflectance": 0.3, "a": 0.7, "b": 150.0, "c": 1.3, "int_ior": 2.5,
        **given,
    }
    for variant, given in (("microfacet", {"normalization": "fit"}), ("microfacet", {"normalization": "unit"}),
                           ("smooth", {}))
}  # fmt: skip
