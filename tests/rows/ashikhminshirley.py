import reference as ref
from catalogue import rows_of

row = rows_of(
    "ashikhminshirley", ref.ashikhminshirley, "exponent", diffuse_reflectance=0.5, specular_reflectance=0.05,
    exponent=100,
)  # fmt: skip

ROWS = [
    row("default"),
    row("exponent 0", exponent=0, specular_reflectance=0.3),
    row("anisotropic", exponent_u=13, exponent_v=310, diffuse_reflectance=0.2, specular_reflectance=0.5),
    # Turned in float32, h has an azimuth that is 1.5e-7 off, and the exponent, of which the slope is nu - nv, follows.
    row("anisotropic turned", exponent_u=300, exponent_v=4, diffuse_reflectance=0.2, specular_reflectance=1.0,
        rotation=0.2),
    row("sharp", sharp=True, exponent=10000, specular_reflectance=0.5),
    row("without diffuse", exponent=30, diffuse_reflectance=0.0),
]  # fmt: skip

EXTREME = [
    row(f"exponents {n:g}", exponent_u=n, exponent_v=n / 5, diffuse_reflectance=0.4, specular_reflectance=0.5)
    for n in (1.0, 1e5)
]

SMOOTH = {
    "ashikhminshirley": {
        "type": "ashikhminshirley", "exponent_u": 60.0, "exponent_v": 8.0, "rotation": 0.1,
        "diffuse_reflectance": 0.4, "specular_reflectance": 0.3,
    },
    "ashikhminshirley isotropic": {"type": "ashikhminshirley", "exponent": 30.0, "specular_reflectance": 0.3},
}  # fmt: skip
