from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρ, k, normalization="energy", **given):
    return Row(
        f"minnaert {name}",
        {"type": "minnaert", "normalization": normalization, **given},
        partial(ref.minnaert, reflectance=ρ, exponent=k, normalization=normalization),
    )


ROWS = [
    row("default", 0.5, 1.5),
    row("exponent 0", 0.8, 0, exponent=0, reflectance=0.8),
    row("exponent 0.5", 0.8, 0.5, exponent=0.5, reflectance=0.8),
    row("exponent 1", 0.8, 1, exponent=1, reflectance=0.8),
    row("exponent 8", 0.8, 8, exponent=8, reflectance=0.8),
    row("published exponent 0.5", 0.5, 0.5, "published", exponent=0.5),
    row("published exponent 3", 0.5, 3, "published", exponent=3),
    row("none exponent 0.5", 0.5, 0.5, "none", exponent=0.5),
    row("none exponent 2", 0.5, 2, "none", exponent=2),
]

EXTREME = [
    row(f"{normalization} exponent {k:g}", 0.5, k, normalization, exponent=k)
    for normalization in ("energy", "published", "none")
    for k in (0.0, 0.999, 1.001, 15.0)
]

SMOOTH = {
    f"minnaert {normalization} {k}": {"type": "minnaert", "exponent": k, "normalization": normalization}
    for normalization, k in [("energy", 0.6), ("energy", 2.0), ("published", 0.7), ("none", 1.5)]
}
