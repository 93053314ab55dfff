from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρ, r, **given):
    return Row(f"eon {name}", {"type": "eon", **given}, partial(ref.eon, reflectance=ρ, roughness=r))


ROWS = [
    row("default", 0.5, 0.5),
    row("smooth", 0.8, 0, roughness=0, reflectance=0.8),
    row("smoother", 0.8, 0.1, roughness=0.1, reflectance=0.8),
    row("rough", 0.8, 1, roughness=1, reflectance=0.8),
    row("rough white", 1, 1, roughness=1, reflectance=1.0),
    row("rough dark", 0.02, 1, roughness=1, reflectance=0.02),
]

EXTREME = [row(f"roughness {r:g}", 1, r, roughness=r, reflectance=1.0) for r in (0.0, 1e-6, 1.0)]

SMOOTH = {"eon": {"type": "eon"}, "eon rough": {"type": "eon", "roughness": 0.9, "reflectance": 0.8}}
