import reference as ref
from catalogue import rows_of

row = rows_of("wrap", ref.wrap, reflectance=0.5, wrap=1, exponent=2, domain="hemisphere", normalization="energy")

ROWS = [
    row("default"),
    row("Lambert", wrap=0, exponent=1, reflectance=0.8),
    row("linear", wrap=0.3, exponent=1, reflectance=0.8),
    row("exponent 0", wrap=0.5, exponent=0, reflectance=0.8),
    row("exponent 20", wrap=0.5, exponent=20, reflectance=0.8),
    row("none", normalization="none"),
    row("sphere", domain="sphere"),
    row("sphere partly wrapped", domain="sphere", wrap=0.6, exponent=1.5, reflectance=0.8),
    row("sphere none", domain="sphere", normalization="none", wrap=0.6, exponent=1),
]

EXTREME = [
    row(f"{domain} wrap {w:g} exponent {n:g}", domain=domain, wrap=w, exponent=n)
    for domain in ("hemisphere", "sphere")
    for w, n in ((0.0, 0.0), (0.0, 100.0), (1.0, 0.0), (1.0, 100.0), (1e-3, 1.0))
]

SMOOTH = {
    f"wrap {domain} {normalization}": {
        "type": "wrap", "wrap": 0.6, "exponent": 1.7, "domain": domain, "normalization": normalization,
    }
    for domain in ("hemisphere", "sphere")
    for normalization in ("energy", "none")
}  # fmt: skip
