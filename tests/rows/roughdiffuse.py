from functools import partial
from math import sqrt

import reference as ref
from catalogue import Row


def row(name, ρ, α, fast=False, **given):
    return Row(
        f"roughdiffuse {name}",
        {"type": "roughdiffuse", **given},
        partial(ref.orennayar, reflectance=ρ, sigma=α / sqrt(2), model="qualitative" if fast else "full"),
    )


ROWS = [
    row("default", 0.5, 0.2),
    row("smooth", 0.8, 0, alpha=0, reflectance=0.8),
    row("rough", 0.8, 1, alpha=1, reflectance=0.8),
    row("fast", 0.5, 0.2, True, use_fast_approx=True),
    row("fast rough", 0.8, 1.5, True, use_fast_approx=True, alpha=1.5, reflectance=0.8),
]

EXTREME = [
    row("roughest", 1, 2.2, alpha=2.2, reflectance=1.0),
    row("fast roughest", 1, 2.2, True, alpha=2.2, reflectance=1.0, use_fast_approx=True),
]

SMOOTH = {
    "roughdiffuse": {"type": "roughdiffuse", "alpha": 0.5},
    "roughdiffuse fast": {"type": "roughdiffuse", "alpha": 0.5, "use_fast_approx": True},
}
