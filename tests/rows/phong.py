from functools import partial

import reference as ref
from catalogue import BOTH, Row


def row(name, ρd, ρs, n, normalization="energy", sharp=False, **given):
    return Row(
        f"phong {name}",
        {"type": "phong", "normalization": normalization, **given},
        partial(ref.phong, diffuse_reflectance=ρd, specular_reflectance=ρs, exponent=n, normalization=normalization),
        sharp=sharp,
    )


ROWS = [
    row("default", 0.5, 0.2, 30),
    row("exponent 0", 0.4, 0.5, 0, exponent=0, **BOTH),
    row("exponent 3", 0.4, 0.5, 3, exponent=3, **BOTH),
    row("exponent 300 without diffuse", 0, 0.5, 300, exponent=300, diffuse_reflectance=0.0, specular_reflectance=0.5),
    row("exponent 3000", 0.4, 0.5, 3000, sharp=True, exponent=3000, **BOTH),
    row("without specular", 0.5, 0, 30, specular_reflectance=0.0),
    row("none", 0.4, 0.5, 5, "none", exponent=5, **BOTH),
    row("original", 0.4, 0.5, 10, "original", exponent=10, **BOTH),
]

EXTREME = [
    row(f"{normalization} exponent {n:g}", 0.4, 0.5, n, normalization, exponent=n, **BOTH)
    for normalization in ("energy", "none", "original")
    for n in (1.0, 1e4, 1e5)
]

SMOOTH = {
    f"phong {normalization}": {"type": "phong", "exponent": 20.0, "normalization": normalization, **BOTH}
    for normalization in ("energy", "none", "original")
}
