from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρ, w, n, domain="hemisphere", normalization="energy", **given):
    return Row(
        f"wrap {name}",
        {"type": "wrap", "domain": domain, "normalization": normalization, **given},
        partial(ref.wrap, reflectance=ρ, wrap=w, exponent=n, domain=domain, normalization=normalization),
        transmits=domain == "sphere",
    )


ROWS = [
    row("default", 0.5, 1, 2),
    row("Lambert", 0.8, 0, 1, wrap=0, exponent=1, reflectance=0.8),
    row("linear", 0.8, 0.3, 1, wrap=0.3, exponent=1, reflectance=0.8),
    row("exponent 0", 0.8, 0.5, 0, wrap=0.5, exponent=0, reflectance=0.8),
    row("exponent 20", 0.8, 0.5, 20, wrap=0.5, exponent=20, reflectance=0.8),
    row("none", 0.5, 1, 2, normalization="none"),
    row("sphere", 0.5, 1, 2, "sphere"),
    row("sphere partly wrapped", 0.8, 0.6, 1.5, "sphere", wrap=0.6, exponent=1.5, reflectance=0.8),
    row("sphere none", 0.5, 0.6, 1, "sphere", "none", wrap=0.6, exponent=1),
]

EXTREME = [
    row(f"{domain} wrap {w:g} exponent {n:g}", 0.5, w, n, domain, wrap=w, exponent=n)
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
