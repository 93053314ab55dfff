import reference as ref
from catalogue import rows_of

row = rows_of(
    "brady", ref.brady, diffuse_reflectance=0.5, specular_reflectance=1, f0=0.04, exponent=2, beta=0.3,
    normalization="unit",
)  # fmt: skip

ROWS = [
    row("default"),
    row("metal", diffuse_reflectance=0.0, f0=1.0, beta=0.5),
    row("long tail", diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5, exponent=0.6),
    row("longest tail", diffuse_reflectance=0.0, f0=1.0, exponent=0.1, beta=0.2),
    row("steep and broad", diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5, exponent=3, beta=1.5),
    row("none", normalization="none", diffuse_reflectance=0.3, specular_reflectance=20.0, f0=0.3, exponent=1.5),
    row("none broad", normalization="none", diffuse_reflectance=0.0, f0=1.0, exponent=1, beta=2),
    row("sharp", sharp=True, diffuse_reflectance=0.3, specular_reflectance=0.8, f0=0.5, beta=0.13),
]

EXTREME = [
    row(f"exponent {α:g} beta {β:g} {normalization}", normalization=normalization, diffuse_reflectance=0.0,
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
