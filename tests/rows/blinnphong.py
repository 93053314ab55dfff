from functools import partial

import reference as ref
from catalogue import BOTH, Row

NORMALIZATIONS = ("energy", "approximate", "ndf", "none", "original")


def row(name, ρd, ρs, n, normalization="energy", sharp=False, **given):
    return Row(
        f"blinnphong {name}",
        {"type": "blinnphong", "normalization": normalization, **given},
        partial(
            ref.blinnphong, diffuse_reflectance=ρd, specular_reflectance=ρs, exponent=n, normalization=normalization
        ),
        sharp=sharp,
    )


ROWS = [
    row("default", 0.5, 0.2, 30),
    row("exponent 0", 0.4, 0.5, 0, exponent=0, **BOTH),
    row("exponent 3", 0.4, 0.5, 3, exponent=3, **BOTH),
    row("exponent 10000", 0.4, 0.5, 1e4, sharp=True, exponent=10000, **BOTH),
    *(row(normalization, 0.4, 0.5, 10, normalization, exponent=10, **BOTH) for normalization in NORMALIZATIONS[1:]),
]

EXTREME = [
    row(f"{normalization} exponent {n:g}", 0.4, 0.5, n, normalization, exponent=n, **BOTH)
    for normalization in NORMALIZATIONS
    for n in (1.0, 1e5)
]

SMOOTH = {
    f"blinnphong {normalization}": {"type": "blinnphong", "exponent": 20.0, "normalization": normalization, **BOTH}
    for normalization in NORMALIZATIONS
}
