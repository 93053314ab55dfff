import reference as ref
from catalogue import BOTH, rows_of

NORMALIZATIONS = ("energy", "approximate", "ndf", "none", "original")

row = rows_of(
    "blinnphong", ref.blinnphong, diffuse_reflectance=0.5, specular_reflectance=0.2, exponent=30, normalization="energy"
)

ROWS = [
    row("default"),
    row("exponent 0", exponent=0, **BOTH),
    row("exponent 3", exponent=3, **BOTH),
    row("exponent 10000", sharp=True, exponent=10000, **BOTH),
    *(row(normalization, normalization=normalization, exponent=10, **BOTH) for normalization in NORMALIZATIONS[1:]),
]

EXTREME = [
    row(f"{normalization} exponent {n:g}", normalization=normalization, exponent=n, **BOTH)
    for normalization in NORMALIZATIONS
    for n in (1.0, 1e5)
]

SMOOTH = {
    f"blinnphong {normalization}": {"type": "blinnphong", "exponent": 20.0, "normalization": normalization, **BOTH}
    for normalization in NORMALIZATIONS
}
