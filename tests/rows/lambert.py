from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρ, **given):
    return Row(f"lambert {name}", {"type": "lambert", **given}, partial(ref.lambert, reflectance=ρ))


ROWS = [
    row("default", 0.5),
    row("white", 1.0, reflectance=1.0),
    row("dark", 0.02, reflectance=0.02),
    row("texture", 0.3, reflectance={"type": "checkerboard", "color0": 0.3, "color1": 0.3}),
]

SMOOTH = {"lambert": {"type": "lambert"}}
