import reference as ref
from catalogue import Row


def row(name, Rd, Rs, n, turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        return ref.ashikhminshirley(ref.rotate(wi, turns), ref.rotate(wo, turns), Rd, Rs, *n)

    return Row(f"ashikhminshirley {name}", {"type": "ashikhminshirley", **given}, reference, sharp=sharp)


ROWS = [
    row("default", 0.5, 0.05, (100, 100)),
    row("exponent 0", 0.5, 0.3, (0, 0), exponent=0, specular_reflectance=0.3),
    row("anisotropic", 0.2, 0.5, (13, 310), exponent_u=13, exponent_v=310, diffuse_reflectance=0.2,
        specular_reflectance=0.5),
    # Turned in float32, h has an azimuth that is 1.5e-7 off, and the exponent, of which the slope is nu - nv, follows.
    row("anisotropic turned", 0.2, 1.0, (300, 4), turns=0.2, exponent_u=300, exponent_v=4, diffuse_reflectance=0.2,
        specular_reflectance=1.0, rotation=0.2),
    row("sharp", 0.5, 0.5, (1e4, 1e4), sharp=True, exponent=10000, specular_reflectance=0.5),
    row("without diffuse", 0, 0.05, (30, 30), exponent=30, diffuse_reflectance=0.0),
]  # fmt: skip

EXTREME = [
    row(f"exponents {n:g}", 0.4, 0.5, (n, n / 5), exponent_u=n, exponent_v=n / 5, diffuse_reflectance=0.4,
        specular_reflectance=0.5)
    for n in (1.0, 1e5)
]  # fmt: skip

SMOOTH = {
    "ashikhminshirley": {
        "type": "ashikhminshirley", "exponent_u": 60.0, "exponent_v": 8.0, "rotation": 0.1,
        "diffuse_reflectance": 0.4, "specular_reflectance": 0.3,
    },
    "ashikhminshirley isotropic": {"type": "ashikhminshirley", "exponent": 30.0, "specular_reflectance": 0.3},
}  # fmt: skip
