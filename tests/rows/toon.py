from functools import partial

import numpy as np
import reference as ref
from catalogue import BOTH, Row

DEFAULTS = {
    "diffuse_reflectance": 0.5,
    "diffuse_threshold": 0.5,
    "diffuse_smooth": 0.05,
    "diffuse_shadow": 0.0,
    "specular_reflectance": 0.2,
    "specular_threshold": 0.9,
    "specular_smooth": 0.02,
    "normalization": "energy",
}


def row(name, sharp=False, **given):
    # At an edge the reference must know the threshold as the plugin does, in float32.
    exact = {k: v if isinstance(v, str) else float(np.float32(v)) for k, v in {**DEFAULTS, **given}.items()}
    return Row(f"toon {name}", {"type": "toon", **given}, partial(ref.toon, **exact), sharp=sharp)


def lit(threshold, smooth, shadow=0.0):
    return {"diffuse_threshold": threshold, "diffuse_smooth": smooth, "diffuse_shadow": shadow}


def highlight(threshold, smooth):
    return {"specular_threshold": threshold, "specular_smooth": smooth}


ROWS = [
    row("default"),
    # Edges on cell borders of the grid on which densities are integrated: at 180° (5/8)³ and (4/8)³.
    row("hard edges", sharp=True, **BOTH, **lit(0.72, 0.0), **highlight(0.92388, 0.0)),
    row("soft", **BOTH, **lit(0.5, 0.5, 0.2), **highlight(0.6, 0.3)),
    row("clipped ramps", **BOTH, **lit(0.1, 0.4, 0.3), **highlight(1.0, 0.3)),
    row("highlight beyond 90°", **BOTH, **lit(1.0, 0.6), **highlight(0.2, 0.7)),
    row("shadow 1 without specular", specular_reflectance=0.0, **lit(0.5, 0.05, 1.0)),
    row("small highlight without diffuse", sharp=True, diffuse_reflectance=0.0, **highlight(0.9988, 4e-4)),
    row("none", normalization="none", **BOTH, **lit(0.3, 0.1, 0.25), **highlight(0.8, 0.1)),
]

EXTREME = [
    row(f"{normalization} lit {d} highlight {s}", normalization=normalization, **BOTH, **lit(*d), **highlight(*s))
    for normalization in ("energy", "none")
    for d, s in (
        ((0.0, 0.0), (1.0, 0.0)),
        ((0.0, 1.0), (0.0, 1.0)),
        ((1.0, 1.0, 0.5), (0.0, 0.0)),
        ((1.0, 0.0), (0.5, 0.0)),
        ((1.0, 0.0, 0.5), (0.999999, 0.0)),
        ((0.999, 0.0, 1.0), (0.9999, 1e-4)),
    )
]

SMOOTH = {
    f"toon {normalization}": {
        "type": "toon", "normalization": normalization, "diffuse_reflectance": 0.6, "specular_reflectance": 0.3,
        **lit(0.5, 0.3, 0.7), **highlight(0.7, 0.25),
    }
    for normalization in ("energy", "none")
}  # fmt: skip
