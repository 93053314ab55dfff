import reference as ref
from catalogue import Row

KEYS = ("specular_reflectance", "f0", "alpha_u", "alpha_v", "kurt_exponent")


def row(name, ρd, lobes, turns=0.0, sharp=False, **given):
    """``lobes`` as (ks, f0, αu, αv, κ)."""
    lobes = [dict(zip(KEYS, lobe, strict=True)) for lobe in lobes]

    def reference(wi, wo):
        return ref.kurt(ref.rotate(wi, turns), ref.rotate(wo, turns), ρd, lobes)

    return Row(f"kurt {name}", {"type": "kurt", **given}, reference, sharp=sharp)


ROWS = [
    row("default", 0.5, [(1, 0.04, 0.1, 0.1, 0.25)]),
    row("metal", 0, [(0.9, 1, 0.5, 0.5, 0)],
        diffuse_reflectance=0.0, specular_reflectance=0.9, f0=1.0, alpha=0.5, kurt_exponent=0),
    row("anisotropic turned", 0.3, [(0.6, 0.5, 0.1, 0.4, 0.25)], turns=0.1, diffuse_reflectance=0.3,
        specular_reflectance=0.6, f0=0.5, alpha_u=0.1, alpha_v=0.4, rotation=0.1),
    row("bright at grazing", 0.3, [(0.5, 0.6, 0.3, 0.3, 0.5)], diffuse_reflectance=0.3, specular_reflectance=0.5,
        f0=0.6, alpha=0.3, kurt_exponent=0.5),
    row("three lobes", 0.3, [(1, 0.3, 0.1, 0.1, 0.25), (0.4, 0.5, 0.5, 0.5, 0.25), (1, 0.04, 0.1, 0.3, 0.1)],
        diffuse_reflectance=0.3, f0_1=0.3, specular_reflectance_2=0.4, f0_2=0.5, alpha_2=0.5,
        alpha_u_3=0.1, alpha_v_3=0.3, kurt_exponent_3=0.1),
    row("sharp", 0.3, [(1, 0.5, 0.02, 0.02, 0.25)], sharp=True, diffuse_reflectance=0.3, f0=0.5, alpha=0.02),
]  # fmt: skip

EXTREME = [
    row(f"alpha {α:g} exponent {κ:g}", 0.4, [(0.5, 0.2, α, 3 * α, κ)], diffuse_reflectance=0.4,
        specular_reflectance=0.5, f0=0.2, alpha_u=α, alpha_v=3 * α, kurt_exponent=κ)
    for α in (1e-3, 0.5)
    for κ in (0.0, 0.5)
]  # fmt: skip

SMOOTH = {
    "kurt": {
        "type": "kurt", "diffuse_reflectance": 0.3, "specular_reflectance": 0.6, "f0": 0.3, "alpha_u": 0.12,
        "alpha_v": 0.4, "kurt_exponent": 0.2, "rotation": 0.1,
    },
    "kurt two lobes": {
        "type": "kurt", "specular_reflectance_1": 0.6, "f0_1": 0.3, "alpha_1": 0.15, "kurt_exponent_1": 0.2,
        "specular_reflectance_2": 0.8, "f0_2": 0.9, "alpha_2": 0.4, "kurt_exponent_2": 0.3,
    },
}  # fmt: skip
