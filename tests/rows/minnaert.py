import reference as ref
from catalogue import rows_of

row = rows_of("minnaert", ref.minnaert, reflectance=0.5, exponent=1.5, normalization="energy")

ROWS = [
    row("default"),
    row("exponent 0", exponent=0, reflectance=0.8),
    row("exponent 0.5", exponent=0.5, reflectance=0.8),
    row("exponent 1", exponent=1, reflectance=0.8),
    row("exponent 8", exponent=8, reflectance=0.8),
    row("published exponent 0.5", normalization="published", exponent=0.5),
    row("published exponent 3", normalization="published", exponent=3),
    row("none exponent 0.5", normalization="none", exponent=0.5),
    row("none exponent 2", normalization="none", exponent=2),
]

EXTREME = [
    row(f"{normalization} exponent {k:g}", normalization=normalization, exponent=k)
    for normalization in ("energy", "published", "none")
    for k in (0.0, 0.999, 1.001, 15.0)
]

SMOOTH = {
    f"minnaert {normalization} {k}": {"type": "minnaert", "exponent": k, "normalization": normalization}
    for normalization, k in [("energy", 0.6), ("energy", 2.0), ("published", 0.7), ("none", 1.5)]
}
