import reference as ref
from catalogue import BOTH, Row

KEYS = ("specular_reflectance", "cx", "cy", "cz", "exponent")


def row(name, ρd, lobes, normalization="energy", turns=0.0, sharp=False, **given):
    """``lobes`` as (ρ, Cx, Cy, Cz, n)."""
    lobes = [dict(zip(KEYS, lobe, strict=True)) for lobe in lobes]

    def reference(wi, wo):
        return ref.lafortune(ref.rotate(wi, turns), ref.rotate(wo, turns), ρd, lobes, normalization)

    bsdf = {"type": "lafortune", "normalization": normalization, **given}
    return Row(f"lafortune {name}", bsdf, reference, sharp=sharp)


ROWS = [
    row("default", 0.5, [(0.2, -1, -1, 1, 30)]),
    row("off-specular", 0.4, [(0.5, -0.75, -0.75, 0.5, 9)], cx=-0.75, cy=-0.75, cz=0.5, exponent=9, **BOTH),
    row("retro-reflective", 0.4, [(0.5, 1, 1, 1, 30)], cx=1, cy=1, cz=1, exponent=30, **BOTH),
    row("anisotropic turned", 0.4, [(0.5, -1, -0.5, 0.75, 20)], turns=0.1,
        cx=-1, cy=-0.5, cz=0.75, exponent=20, rotation=0.1, **BOTH),
    row("three lobes none", 0.2, [(0.5, -1, -1, 1, 20), (0.25, 0.5, 0.5, 0.75, 5), (0.2, -1.25, -1.25, 0.5, 3)], "none",
        diffuse_reflectance=0.2, specular_reflectance_1=0.5, exponent_1=20, specular_reflectance_2=0.25, cx_2=0.5,
        cy_2=0.5, cz_2=0.75, exponent_2=5, cx_3=-1.25, cy_3=-1.25, cz_3=0.5, exponent_3=3),
    row("exponent 0", 0.4, [(0.5, -1, -1, 1, 0)], exponent=0, **BOTH),
    row("sharp", 0.4, [(0.5, -1, -1, 1, 3000)], sharp=True, exponent=3000, **BOTH),
]  # fmt: skip

EXTREME = [
    row("mirror exponent 1e5", 0.4, [(0.5, -1, -1, 1, 1e5)], exponent=100000, **BOTH),
    row("factors 1.5", 0.4, [(0.5, -1.5, -1.5, 1.5, 1e5)], cx=-1.5, cy=-1.5, cz=1.5, exponent=100000, **BOTH),
    row("off-specular exponent 1000", 0.4, [(0.5, -1, -1, 0.75, 1000)], cz=0.75, exponent=1000, **BOTH),
]

SMOOTH = {
    f"lafortune {normalization}": {
        "type": "lafortune", "normalization": normalization, "cx": -0.9, "cy": -0.8, "cz": 0.95, "exponent": 6.0,
        "rotation": 0.1, **BOTH,
    }
    for normalization in ("energy", "none")
}  # fmt: skip
