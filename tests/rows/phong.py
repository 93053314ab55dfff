import reference as ref
from catalogue import BOTH, rows_of

row = rows_of(
    "phong", ref.phong, diffuse_reflectance=0.5, specular_reflectance=0.2, exponent=30, normalization="energy"
)

ROWS = [
    row("default"),
    row("exponent 0", exponent=0, **BOTH),
    row("exponent 3", exponent=3, **BOTH),
    row("exponent 300 without diffuse", exponent=300, diffuse_reflectance=0.0, specular_reflectance=0.5),
    row("exponent 3000", sharp=True, exponent=3000, **BOTH),
    row("without specular", specular_reflectance=0.0),
    row("none", normalization="none", exponent=5, **BOTH),
    row("original", normalization="original", exponent=10, **BOTH),
]

EXTREME = [
    row(f"{normalization} exponent {n:g}", normalization=normalization, exponent=n, **BOTH)
    for normalization in ("energy", "none", "original")
    for n in (1.0, 1e4, 1e5)
]

SMOOTH = {
    f"phong {normalization}": {"type": "phong", "exponent": 20.0, "normalization": normalization, **BOTH}
    for normalization in ("energy", "none", "original")
}
